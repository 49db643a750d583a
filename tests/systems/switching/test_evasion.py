"""Evasion, held against the body itself in the navigation's own loop."""

from math import hypot, inf

import numpy as np
import pytest

from systems.switching.evasion import Body, Evasion, way
from systems.switching.signals import Seen
from systems.switching.switching_rules import LAW, plan, planned, rows
from systems.switching.switching_state import (
    SwitchingParams,
    SwitchingState,
    constants,
)
from tests.benchmarks.navigation_loop import control_law, run, unicycle
from tests.benchmarks.navigation_scenes import TURTLEBOT
from tests.benchmarks.sensed_suite import streams

PARAMS = SwitchingParams()


def collisions(scenes, foresight):
    """How many of those who walk in streams, and do not see the robot, it meets."""

    def planner(scene):
        state = SwitchingState()

        def step(now):
            nonlocal state
            rest = now.place, now.v, scene.goal, *rows(now.seen, [])
            result = planned(record, LAW, state, *rest, now.body)
            state = result.state
            return result.v_x, result.v_y, result.retreat

        return step

    record = constants(SwitchingParams(foresight=foresight))[0]
    return sum(run(scene, planner).outcome == "collided" for scene in scenes)


def test_streams_are_passed_by_who_reckons_with_his_body():
    scenes = streams(222, 3)[2:]
    assert collisions(scenes, 0.0) == 1
    assert collisions(scenes, 3.0) == 0


def test_a_way_is_what_the_body_does():
    body, wanted = Body(0.3, 0.4, 0.2), Evasion(True, -0.2, 0.4, False)
    disc = np.array([[0.0, -0.8, -0.9, 0.3, -0.1, -0.2]])
    record = constants(PARAMS)[0]
    told = way(record, LAW, body, wanted, inf, disc, 0.05)
    pose, speeds, least = (0.0, 0.0, 0.3), (0.4, 0.2), inf
    for k in range(int(PARAMS.foresight / 0.01)):
        command = (wanted.v_x, wanted.v_y, wanted.retreat)
        pose, speeds = unicycle(
            TURTLEBOT, control_law(TURTLEBOT), pose, speeds, command, 0.01
        )
        t = 0.01 * (k + 1)
        x, y = 0.8 - 0.1 * t - pose[0], 0.9 - 0.2 * t - pose[1]
        least = min(least, hypot(x, y) - 0.48)
    assert told == (inf, pytest.approx(least, abs=0.05))


def test_what_ends_well_is_left_alone():
    rest = SwitchingState(), (0.0, 0.0), (0.5, 0.0), (8.0, 0.0)
    passing = [Seen(0.0, 2.0, 1.6, 0.3, 0.0, 1.5)]
    body = Body(0.0, 0.5, 0.0)
    assert plan(PARAMS, *rest, passing, (), body) == plan(PARAMS, *rest, passing)


def test_an_evasion_is_kept_until_what_is_wanted_passes_wide():
    rest = (0.0, 0.0), (0.0, 0.0), (8.0, 0.0)
    front = [Seen(float(k), 2.5, 0.7 * (k - 1), 0.3, -1.6, 0.0) for k in range(3)]
    body = Body(0.0, 0.0, 0.0)
    first = plan(PARAMS, SwitchingState(), *rest, front, (), body)
    flee = first.state.flee_x, first.state.flee_y
    assert hypot(*flee) > 0.0 and (first.v_x, first.v_y) == flee
    assert plan(PARAMS, first.state, *rest, front, (), body).state[-2:] == flee
    assert plan(PARAMS, first.state, *rest, [], (), body).state[-2:] == (0.0, 0.0)

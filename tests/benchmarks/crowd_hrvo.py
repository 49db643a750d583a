"""HRVO among the people of the campaign `crowd`, by the package `navground`.

`python -m tests.benchmarks.crowd_hrvo DIR --runs N`, with `pip install -e '.[peers]'`:
the campaign's own worlds.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from diagrams.campaigns.acts import Figures, Job
from diagrams.campaigns.campaign import base_of, load_campaign
from diagrams.campaigns.run import run_campaign
from diagrams.common.metrics import WALL_CLOCK
from diagrams.common.run import prepare, simulate_diagram
from diagrams.navigation.diagram import make_navigation_diagram
from diagrams.studies import scenario_of
from plants.turtlebot.signals import RobotState
from systems.switching.navigation_planner import (
    PERIOD,
    NavigationPlanner,
    Planned,
    velocity,
)
from systems.switching.signals import Corner, Goal, Mode, PlanarVelocity, Seen
from tests.benchmarks.navigation_loop import Now
from tests.benchmarks.navigation_scenes import Robot, Scene
from tests.benchmarks.navigators import hrvo


class HrvoPlanner(NavigationPlanner):
    """Takes HRVO's velocity; ports as all planners."""

    def __init__(self, scenario: Any) -> None:
        """Makes the block for the scenario's robot and goal."""
        super().__init__(scenario.robot, PERIOD)
        robot = Robot(scenario.robot.radius, scenario.robot.speed)
        ends = (*scenario.start,), (*scenario.goal,)
        self._step = hrvo(Scene("", *ends, lambda step: [], robot, PERIOD))

    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """The velocity to take."""
        pose = robot.x, robot.y, robot.theta
        v_x, v_y, back = self._step(Now(*pose, *velocity(robot), seen, corners))
        return Planned(PlanarVelocity(v_x, v_y), Mode(retreat=float(back)))


def act(job: Job) -> Figures:
    """A run with HRVO for its planner; its figures."""
    tree = base_of(load_campaign("crowd"))
    case = prepare(scenario_of(tree, job["overrides"], job["seed"]))
    planner = HrvoPlanner(case.scenario)
    diagram = make_navigation_diagram(case.scenario, {"planner": planner})
    metrics = simulate_diagram(case, diagram).metrics
    return {k: v for k, v in metrics.items() if k not in WALL_CLOCK}


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, metavar="DIR")
    parser.add_argument("--runs", type=int, default=2000)
    told = parser.parse_args()
    crowd = load_campaign("crowd")
    variants = {name: crowd.variants[name] for name in ("exact", "noisy")}
    act = "tests.benchmarks.crowd_hrvo:act"
    changed = replace(crowd, act=act, runs=told.runs, variants=variants)
    print(run_campaign(changed, told.out, 1))


if __name__ == "__main__":
    main()

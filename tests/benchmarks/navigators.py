"""Every planner of the benchmark: our own, and peers if their packages are there.

All get the same body and control law, and all may retreat backwards from an
obstacle that comes within two seconds.
"""

from functools import partial
from importlib.util import find_spec

import numpy as np

from plants.crowd.signals import Obstacle
from plants.crowd.social_force import social_force_towards
from systems.switching.classical_planner import ClassicalParams, summed_fields
from systems.switching.evasion import HOLONOMIC
from systems.switching.orca_planner import OrcaParams, orca_step, retreats
from systems.switching.statechart_planner import (
    Manoeuvre,
    StatechartParams,
    statechart_step,
)
from systems.switching.switching_rules import LAW, planned, rows
from systems.switching.switching_state import (
    SwitchingParams,
    SwitchingState,
    constants,
)
from tests.benchmarks.dynamic_window import dynamic_window
from tests.benchmarks.navigation_loop import Command, Now, Planner, Step, control_law
from tests.benchmarks.navigation_scenes import Scene

MARGIN = 0.1
"""Distance [m] that the peers keep from obstacles' surfaces."""


def switching(scene: Scene) -> Step:
    """The switching planner with its defaults; only the body is the scene's."""
    robot = scene.robot
    params = SwitchingParams(
        body_radius=robot.radius,
        speed=robot.speed,
        vision=robot.vision,
        braking=robot.acceleration or 1.0,
        response=0.0 if robot.holonomic else SwitchingParams.response,
    )
    record, state = constants(params)[0], SwitchingState()
    law = LAW if robot.holonomic else control_law(robot)

    def step(now: Now) -> Command:
        nonlocal state
        told = rows(now.seen, now.corners)
        body = HOLONOMIC if robot.holonomic else now.body
        result = planned(record, law, state, now.place, now.v, scene.goal, *told, body)
        state = result.state
        return result.v_x, result.v_y, result.retreat

    return step


def noisy(position: float = 0.05, velocity: float = 0.1) -> Planner:
    """The switching planner on obstacles seen with noise [m, m/s], white."""
    generator = np.random.default_rng(7)

    def make(scene: Scene) -> Step:
        inner = switching(scene)

        def step(now: Now) -> Command:
            shown = []
            for o in now.seen:
                a, b, u, v = generator.normal(size=4)
                shown.append(
                    o._replace(
                        x=o.x + position * a,
                        y=o.y + position * b,
                        v_x=o.v_x + velocity * u,
                        v_y=o.v_y + velocity * v,
                    )
                )
            return inner(now._replace(seen=shown))

        return step

    return make


def _retreats(scene: Scene, now: Now) -> bool:
    return retreats(now.place, now.seen, scene.robot.radius + 2.0 * MARGIN)


def classical(scene: Scene) -> Step:
    """Khatib's sum."""
    params = ClassicalParams(body_radius=scene.robot.radius, speed=scene.robot.speed)

    def step(now: Now) -> Command:
        velocity = summed_fields(params, now.place, scene.goal, now.seen)
        return *velocity, _retreats(scene, now)

    return step


def statechart(scene: Scene) -> Step:
    """The thesis's statechart as reconstructed, for obstacles that stand."""
    params = StatechartParams(body_radius=scene.robot.radius, speed=scene.robot.speed)
    memory = Manoeuvre()

    def step(now: Now) -> Command:
        nonlocal memory
        ux, uy, memory = statechart_step(
            params, memory, now.place, scene.goal, now.seen
        )
        return ux, uy, _retreats(scene, now)

    return step


def orca(scene: Scene) -> Step:
    """ORCA as `pyrvo` has it (RVO2)."""
    import pyrvo

    robot = scene.robot

    def step(now: Now) -> Command:
        world = pyrvo.RVOSimulator()
        world.set_time_step(scene.dt)
        world.set_agent_defaults(10.0, 20, 5.0, 5.0, robot.radius, robot.speed)
        world.add_agent([*now.place])
        world.set_agent_velocity(0, [*now.v])
        world.set_agent_radius(0, robot.radius + MARGIN)
        gx, gy = scene.goal[0] - now.x, scene.goal[1] - now.y
        size = max((gx * gx + gy * gy) ** 0.5, 1e-9)
        speed = min(robot.speed, 2.0 * size)
        world.set_agent_pref_velocity(0, [speed * gx / size, speed * gy / size])
        for k, (_, a, b, r, u, v) in enumerate(now.seen, start=1):
            world.add_agent([a, b])
            world.set_agent_radius(k, r)
            world.set_agent_velocity(k, [u, v])
        world.do_step()
        chosen = world.get_agent_velocity(0)
        return chosen.x, chosen.y, _retreats(scene, now)

    return step


def hrvo(scene: Scene) -> Step:
    """HRVO as `navground` has it."""
    return navground("HRVO", scene)


def navground(kind: str, scene: Scene) -> Step:
    """A behaviour of the package `navground`, by its name there."""
    from navground import core

    robot = scene.robot
    behavior = core.Behavior.make_type(kind)
    behavior.kinematics = core.kinematics.OmnidirectionalKinematics(robot.speed)
    behavior.radius = robot.radius
    behavior.safety_margin = MARGIN
    behavior.optimal_speed = robot.speed
    if hasattr(behavior, "horizon"):
        behavior.horizon = 5.0
    behavior.target = core.Target.Point(scene.goal, 0.5 * robot.reach)

    def step(now: Now) -> Command:
        behavior.pose = core.Pose2(now.place, 0.0)
        behavior.twist = core.Twist2(now.v, 0.0)
        behavior.environment_state.neighbors = [
            core.Neighbor(np.array([a, b]), r, np.array([u, v]), int(i))
            for i, a, b, r, u, v in now.seen
        ]
        twist = behavior.compute_cmd(scene.dt)
        ux, uy = twist.velocity
        return float(ux), float(uy), _retreats(scene, now)

    return step


def crowds(model: str) -> Planner:
    """The robot as one of the crowds' people, by ORCA or the social force, our own."""

    def make(scene: Scene) -> Step:
        robot = scene.robot
        params = OrcaParams(robot.radius, robot.speed, MARGIN)

        def step(now: Now) -> Command:
            if model == "social_force":
                me = Obstacle(*now.place, robot.radius + MARGIN, *now.v)
                others = [Obstacle(*o[1:]) for o in now.seen]
                (v,) = social_force_towards(
                    [me, *others], [scene.goal], robot.speed, scene.dt
                )
                return *v, _retreats(scene, now)
            v = orca_step(params, now.place, now.v, scene.goal, now.seen, scene.dt)
            return *v, _retreats(scene, now)

        return step

    return make


def planners() -> dict[str, Planner]:
    """All planners that can run here, by name."""
    found: dict[str, Planner] = {
        "switching": switching,
        "switching, noisy": noisy(),
        "our statechart": statechart,
        "Khatib's sum": classical,
        "DWA (ours)": partial(dynamic_window, MARGIN),
    }
    if find_spec("pyrvo"):
        found["ORCA (pyrvo)"] = orca
    if find_spec("navground"):
        found["HRVO (navground)"] = hrvo
        found["social force (navground)"] = partial(navground, "SocialForce")
    return found

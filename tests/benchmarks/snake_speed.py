"""Speed of the snake: its kinematics, and its plant beside MuJoCo's.

MuJoCo is optional (`pip install trocar[peers]`). Both engines carry the same bodies
through `snake_circle`, each at the largest of the listed steps at which it stays
within 1 mm (rms) of the reference. Best of several runs; wall time, one thread.
MuJoCo is untuned: no armature, default solver; the couplers' softness is tried.
"""

from collections.abc import Callable
from dataclasses import dataclass
import importlib.util
from time import perf_counter
from typing import Any

import numpy as np
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.common.run import simulate
from diagrams.snake.scenario import ELASTIC_STEP
from diagrams.studies import load_scenario
from plants.snake.actuation import angles_of_lengths, wire_lengths
from plants.snake.balls import turns_of
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.inverse_kinematics import positioning, tool_postures
from plants.snake.kinematics import forward
from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.snake import FAR, NEAR, POSITIONS, add_snake
from plants.snake.statics import Statics
from plants.snake.tension import tensions
from systems.resection.wires.tip_reference import reference
from tests.benchmarks.snake_mujoco import model_xml

PARAMS, DRIVE = SnakeParams(), SnakeDriveParams()
DURATION = 4.0
SOFTNESS = (2.0, 4.0, 10.0)
"""Couplers' time constants in steps that MuJoCo is tried with."""
STEPS = (0.02, 0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001)
TOLERANCE = 1e-3


def best(call: Callable[[], Any], repeats: int = 7) -> float:
    """Least wall time of a call, in s."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return min(times)


def kinematics(seed: int) -> list[tuple[str, float, float, str]]:
    """(what, figure, target, unit) of the kinematics and the actuation."""
    rng = np.random.default_rng(seed)
    count = 200_000
    bends = np.zeros((count, 7))
    bends[:, 0] = rng.uniform(*PARAMS.travel, count)
    bends[:, 1::2] = rng.uniform(-np.pi, np.pi, (count, 3))
    bends[:, 2::2] = rng.uniform(0.0, PARAMS.max_bend, (count, 3))
    x = posture_of(bends)
    L = wire_lengths(x, PARAMS)
    straight = x.copy()
    straight[:, 5:] = 0.0
    X = forward(straight, PARAMS)
    n = np.ascontiguousarray(X[:, :3, 2])
    p = X[:, :3, 3] - (PARAMS.straight_module + PARAMS.tool_offset) * n
    assert positioning(p, n, PARAMS).reached.all()
    angles_of_lengths(L, PARAMS)

    def scalar() -> None:
        for i in range(200):
            positioning(p[i], n[i], PARAMS)

    return [
        (
            "forward kinematics",
            count / best(lambda: forward(x, PARAMS)),
            2e6,
            "poses/s",
        ),
        (
            "wire lengths",
            3 * count / best(lambda: wire_lengths(x, PARAMS)),
            0.0,
            "modules/s",
        ),
        (
            "forward actuation",
            3 * count / best(lambda: angles_of_lengths(L, PARAMS)),
            3e6,
            "modules/s",
        ),
        (
            "positioning IK",
            count / best(lambda: positioning(p, n, PARAMS)),
            2e5,
            "poses/s",
        ),
        ("equilibria, warm", 200 / best(equilibria()), 5e3, "postures/s"),
        (
            "the same with friction",
            200 / best(equilibria(SnakeFrictionParams(0.1, 0.1))),
            2e3,
            "steps/s",
        ),
        ("positioning IK, one pose", best(scalar) / 200 * 1e6, 150.0, "us"),
    ]


def equilibria(friction: SnakeFrictionParams | None = None) -> Callable[[], None]:
    """What finds 200 equilibria on a circle, each from the last."""
    bends = np.zeros((200, 7))
    bends[:, 1] = bends[:, 5] = np.linspace(0.0, 2 * np.pi, 200)
    bends[:, 3] = -bends[:, 1]
    bends[:, 2::2] = 0.3, 0.25, 0.2
    x = posture_of(bends)
    wound = wire_lengths(x, PARAMS) - 2e-4
    snake = Statics(PARAMS, DRIVE, friction=friction)

    def sweep() -> None:
        turns, grip = turns_of(x[0]), None
        for lengths in wound:
            start = turns if grip is None else snake.ahead(grip)
            found = snake.equilibrium(
                start, wound=lengths, force=(0.1, 0.0, 0.0), grip=grip
            )
            assert found.converged
            turns, grip = found.turns, found.grip

    return sweep


@dataclass
class Circle:
    """The circle's reference, sampled.

    Attributes:
        time: In s, (n,).
        x: (s, a1, b1, ..., b3), (n, 7).
        p_WT: Tool position in m, (n, 3).
    """

    time: np.ndarray
    x: np.ndarray
    p_WT: np.ndarray


def circle() -> Circle:
    """`snake_circle`, every 2 ms."""
    tip = load_scenario("snake_circle").tip
    time = np.arange(0.0, DURATION + 0.1, 2e-3)
    p_WT, n_WT, n_WI = np.array([reference(tip, t) for t in time]).swapaxes(0, 1)
    x = tool_postures(p_WT, n_WT, n_WI, PARAMS).x
    return Circle(time, x, p_WT)


@dataclass
class Result:
    """One engine at one step."""

    step: float
    real_time_factor: float
    tip_error: float
    coupler_error: float

    @property
    def usable(self) -> bool:
        """Whether it stayed within the tolerance."""
        return bool(self.tip_error < TOLERANCE)


def drake(path: Circle, step: float) -> Result:
    """The drum model, CENIC with fixed steps, commands from a trajectory."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    snake = add_snake(plant, plant.world_frame(), PARAMS, DRIVE)
    plant.Finalize()
    lead = np.array([DRIVE.travel_lead, *[DRIVE.lead] * 6]) + step
    ahead = path.x + np.gradient(path.x, path.time, axis=0) * lead
    desired = np.hstack([ahead, np.zeros_like(ahead)])
    source = builder.AddSystem(
        TrajectorySource(PiecewisePolynomial.FirstOrderHold(path.time, desired.T))
    )
    builder.Connect(
        source.get_output_port(), plant.get_desired_state_input_port(snake.instance)
    )
    diagram = builder.Build()
    start = np.zeros(POSITIONS)
    start[NEAR], start[FAR] = path.x[0], path.x[0, 1:]
    simulator = Simulator(diagram)
    config = SimulatorConfig(
        integration_scheme="cenic",
        accuracy=1e-3,
        max_step_size=step,
        use_error_control=False,
    )
    ApplySimulatorConfig(config, simulator)
    plant_context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(plant_context, start)

    def state() -> tuple[np.ndarray, np.ndarray]:
        x = plant.GetPositions(plant_context)
        return snake.tool.CalcPoseInWorld(plant_context).translation(), x

    def advance(time: float) -> None:
        simulator.AdvanceTo(time)

    simulator.Initialize()
    return _drive(path, step, advance, state)


def mujoco_snake(path: Circle, step: float, tendons: bool, softness: float) -> Result:
    """MuJoCo with servos on the angles, or with its spatial tendons."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        model_xml(PARAMS, DRIVE, step, tendons, softness)
    )
    data = mujoco.MjData(model)
    near, far = NEAR, FAR  # the joints stand in Drake's order

    def place(x: np.ndarray) -> None:
        data.qpos[near], data.qpos[far] = x, x[1:]
        mujoco.mj_forward(model, data)

    commands = np.zeros((len(path.time), model.nu))
    # Pretension as in the elastic variant, 2 N in the slackest wire at zero load.
    for row, x in zip(commands, path.x, strict=True):
        row[0] = x[0]
        if tendons:
            place(x)
            T = tensions(x[1:], np.zeros(6), PARAMS, 2.0)
            row[1:] = data.ten_length - T / DRIVE.wire_stiffness
        else:
            row[1:] = x[1:]
    if not tendons:
        lead = np.array([DRIVE.travel_lead, *[DRIVE.lead] * 6]) + step
        commands += np.gradient(commands, path.time, axis=0) * lead
    mujoco.mj_resetData(model, data)
    place(path.x[0])
    times = np.arange(round((DURATION + 0.05) / step) + 2) * step
    table = np.array(
        [np.interp(times, path.time, column) for column in commands.T]
    ).T.copy()
    count = [0]

    def advance(time: float) -> None:
        while count[0] * step < time - 1e-9:
            data.ctrl[:] = table[count[0]]
            mujoco.mj_step(model, data)
            count[0] += 1

    def state() -> tuple[np.ndarray, np.ndarray]:
        mujoco.mj_kinematics(model, data)
        return data.site("tool").xpos.copy(), data.qpos.copy()

    return _drive(path, step, advance, state)


def _drive(
    path: Circle,
    step: float,
    advance: Callable[[float], None],
    state: Callable[[], tuple[np.ndarray, np.ndarray]],
) -> Result:
    """Advances in frames of 20 ms; only the advance is timed."""
    wall, tips, couplers = 0.0, [], []
    for time in np.arange(1, round(DURATION / 0.02) + 1) * 0.02:
        start = perf_counter()
        try:
            advance(time)
        except (RuntimeError, SystemExit):
            return Result(step, 0.0, np.inf, np.inf)
        wall += perf_counter() - start
        p_WT, x = state()
        wanted = path.p_WT[round(time / 2e-3)]
        tips.append(np.linalg.norm(p_WT - wanted))
        couplers.append(np.abs(x[NEAR[1:]] - x[FAR]).max())
        if not tips[-1] < 0.05:  # lost
            return Result(step, 0.0, np.inf, np.inf)
    rms = float(np.sqrt(np.mean(np.square(tips))))
    return Result(step, DURATION / wall, rms, float(max(couplers)))


def largest_step(runs: list[Callable[[float], Result]], repeats: int = 3) -> Result:
    """The most accurate variant at the largest usable step, best of some repeats."""
    for step in STEPS:
        run = min(runs, key=lambda run: run(step).tip_error)
        if run(step).usable:
            results = [run(step) for _ in range(repeats)]
            return max(results, key=lambda r: r.real_time_factor)
    return Result(0.0, 0.0, np.inf, np.inf)


def plants() -> list[tuple[str, Result]]:
    """All engines, each at its largest usable step."""
    path = circle()
    rows = []
    run = max(
        (simulate(load_scenario("snake_circle", duration=DURATION)) for _ in range(3)),
        key=lambda r: r.metrics["real_time_factor"],
    )
    m = run.metrics
    rows.append(
        (
            "snake_circle, all blocks (CENIC, error-controlled)",
            Result(
                run.scenario.period,
                m["real_time_factor"],
                m["rms_pose_error"],
                m["max_coupler_error"],
            ),
        )
    )
    rows.append(("Drake CENIC, drums", largest_step([lambda h: drake(path, h)])))
    if importlib.util.find_spec("mujoco") is not None:
        for name, tendons in (("servos", False), ("spatial tendons", True)):
            runs = [
                lambda h, t=tendons, s=softness: mujoco_snake(path, h, t, s)
                for softness in SOFTNESS
            ]
            result = largest_step(runs)
            rows.append((f"MuJoCo, {name}", result))
    run = simulate(load_scenario("snake_wire_break", ["elastic.breaks=[]"], 1, 1.0))
    m = run.metrics
    rows.append(
        (
            "snake_circle, elastic wires (SAP), all blocks",
            Result(
                ELASTIC_STEP,
                m["real_time_factor"],
                m["rms_pose_error"],
                m["max_coupler_error"],
            ),
        )
    )
    return rows


def report(seed: int = 1, scenes: int = 0) -> str:
    """Both tables as text; `scenes` is for other benchmarks."""
    del scenes
    lines = [f"{'kinematics':<28}{'measured':>14}{'target':>14}"]
    for name, figure, target, unit in kinematics(seed):
        lines.append(f"{name:<28}{figure:>14,.0f}{target:>14,.0f} {unit}")
    lines += ["", f"{'plant':<52}{'step':>8}{'RTF':>7}{'tip rms':>10}{'coupler':>10}"]
    for name, r in plants():
        lines.append(
            f"{name:<52}{1e3 * r.step:>5.1f} ms{r.real_time_factor:>7.1f}"
            f"{1e3 * r.tip_error:>7.3f} mm{r.coupler_error:>10.1e}"
        )
    if importlib.util.find_spec("mujoco") is None:
        lines += ["", "MuJoCo is not installed: pip install 'trocar[peers]'"]
    return "\n".join(lines)

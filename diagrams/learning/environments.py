"""The environments: the diagrams of scenarios with a policy in the planner's place.

Actions are velocities in m/s, observations metres and metres per second in the world
frame, except where it is said. An episode's world comes from its seed alone.
"""

from abc import abstractmethod
from copy import deepcopy
from dataclasses import asdict
import math
from typing import Any, ClassVar

import gymnasium
from gymnasium.spaces import Box
import numpy as np
from pydrake.common import RandomGenerator

from diagrams.campaigns.draws import operation
from diagrams.campaigns.tape import Tape
from diagrams.common.plots import COLORS, new_figure
from diagrams.common.run import start
from diagrams.gauze.diagram import make_gauze_diagram
from diagrams.learning.command import Command
from diagrams.navigation.diagram import make_navigation_diagram
from diagrams.snake.diagram import make_snake_diagram
from diagrams.studies import get_study, load_scenario, scenario_of
from plants.crowd.signals import ROWS, Obstacle
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.signals import ToolPose, ToolTarget
from plants.turtlebot.signals import RobotState
from systems.auto_guidance.fuzzy_arbiter import Weights
from systems.common.signal import Many, view
from systems.common.signals import Estimate, Guide, RobotTool, Velocity
from systems.switching.signals import SEEN, Goal, Mode, PlanarVelocity

type Array = np.ndarray
type Step = tuple[Array, float, bool, bool, dict[str, Any]]


class Environment(gymnasium.Env[Array, Array]):
    """What the environments share: a diagram, stepped from action to action.

    Attributes:
        scenario: Of this episode.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }
    period = 0.1
    """Between two actions [s]."""
    limit = 15.0
    """Of an episode [s]."""

    def __init__(self, render_mode: str | None = None) -> None:
        """Loads the scenario; the world comes with `reset`.

        Args:
            render_mode: "rgb_array" or None.
        """
        self.render_mode = render_mode
        self.action_space = self.actions()
        self.observation_space = self.observations()
        self._simulator: Any = None

    @abstractmethod
    def actions(self) -> Box:
        """The space of the actions."""

    @abstractmethod
    def observations(self) -> Box:
        """The space of the observations."""

    @abstractmethod
    def world(self, rng: np.random.Generator) -> tuple[Any, Any, Command]:
        """Draws a world: its scenario, diagram, and the block of the action."""

    @abstractmethod
    def observe(self) -> Array:
        """What is seen now."""

    @abstractmethod
    def judge(self) -> tuple[float, bool, dict[str, Any]]:
        """The reward of the last step, whether all is over, and how it went."""

    def commanded(self, action: Array) -> Array:
        """The action as the block has it."""
        return action

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begins an episode, see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        scenario, self._diagram, self._command = self.world(self.np_random)
        self.scenario = scenario
        config = get_study(scenario.system).integrator(scenario)
        self._simulator = start(self._diagram, config)
        self._context = self._simulator.get_mutable_context()
        self._diagram.SetRandomContext(self._context, RandomGenerator(scenario.seed))
        self._simulator.Initialize()
        self._distance = self.distance()
        return self.observe(), {}

    def step(self, action: Array) -> Step:
        """Acts for a period, see `gymnasium.Env.step`."""
        space = self.action_space
        assert isinstance(space, Box)
        action = np.asarray(action, float)
        action = np.where(np.isfinite(action), action, 0.0)  # no number: rest
        action = np.clip(action, space.low, space.high)
        self._command.set_action(self._context, self.commanded(action))
        time = self._context.get_time() + self.period
        self._simulator.AdvanceTo(time)
        reward, is_over, info = self.judge()
        return self.observe(), reward, is_over, time >= self.limit - 1e-9, info

    def progress(self) -> float:
        """By how much the goal came nearer in the last step [m]."""
        before, self._distance = self._distance, self.distance()
        return before - self._distance

    @abstractmethod
    def distance(self) -> float:
        """From the goal [m]."""

    def read(self, port: str, signal: Any) -> Any:
        """A signal of the diagram as it is now."""
        told = self._diagram.GetOutputPort(port).Eval(self._context)
        return view(signal, np.array(told))

    def render(self) -> Any:
        """A picture (400 x 400 x 3) from above."""
        if self.render_mode != "rgb_array":
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        figure = new_figure(4.0, 4.0)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_aspect("equal")
        self.draw(axes)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    @abstractmethod
    def draw(self, axes: Any) -> None:
        """Draws what there is into axes."""


def box(low: list[float], high: list[float]) -> Box:
    """A space of numbers."""
    return Box(np.array(low, np.float32), np.array(high, np.float32))


class GauzeDelivery(Environment):
    """Gauze to the surgeon's tool while the other one moves across.

    Action: velocity of the tip (3), at most 60 mm/s along each axis. The hard clearance
    and the limits behind it stay in place. Observation (22): tip; of the target,
    relative to the tip, position and velocity; of the obstacle's tip the same, and its
    fulcrum; the robot's fulcrum relative to the tip; whether O is known. Reward: 10 for
    each metre nearer, 1 for arriving within 2 mm, -1 for touching.
    """

    def actions(self) -> Box:
        """Velocities of the tip."""
        return box([-0.06] * 3, [0.06] * 3)

    def observations(self) -> Box:
        """Places and velocities, generously bounded."""
        return box([-1.0] * 22, [1.0] * 22)

    def world(self, rng: np.random.Generator) -> tuple[Any, Any, Command]:
        """An operation as in the campaigns, on a patient who holds still."""
        base = asdict(load_scenario("gauze_dynamic"))
        seed = int(rng.integers(2**31))
        drawn = operation(Tape([seed]))
        kept = ("robot.", "target.", "obstacle.p_WG", "obstacle.t", "obstacle.points")
        told = {k: v for k, v in drawn.items() if k.startswith((*kept, "camera."))}
        scenario = scenario_of(deepcopy(base), told, seed)
        obstacles = tuple(tool.name for tool in scenario.obstacles)
        inputs = {f"v{k}": Velocity for k in (1, 2, 3)} | {
            "guide": Guide,
            "robot_tool": RobotTool,
            "obstacles": Many(Estimate, obstacles),
            "target": Estimate,
        }
        rest = Velocity((0.0, 0.0, 0.0))
        outputs = {"weights": Weights(1.0, 0.0, 0.0), "v_R": rest}
        command = Command(inputs, outputs, "v_R", [0.0] * 3)
        diagram = make_gauze_diagram(scenario, swaps={"fuzzy_arbiter": command})
        return scenario, diagram, command

    def commanded(self, action: Array) -> Array:
        """The guide point is s times as fast as the tip."""
        return action * float(self.read("planner.guide", Guide).s)

    def distance(self) -> float:
        """Of the tip from its target [m]."""
        tool = self.read("robot.tool", RobotTool)
        target = self.read("target.estimate", Estimate)
        return float(np.linalg.norm(target.p - tool.tip)) if target.known else 0.2

    def observe(self) -> Array:
        """See the class."""
        tool = self.read("robot.tool", RobotTool)
        target = self.read("target.estimate", Estimate)
        other = self.read("obstacle.estimate", Estimate)
        parts = [
            tool.tip,
            target.p - tool.tip,
            target.v,
            other.p - tool.tip,
            other.v,
            other.fulcrum - tool.tip,
            tool.fulcrum - tool.tip,
            [float(other.known)],
        ]
        return np.clip(np.concatenate(parts), -1.0, 1.0).astype(np.float32)

    def judge(self) -> tuple[float, bool, dict[str, Any]]:
        """Nearer is better, touching the obstacle ends it."""
        gap = float(self._diagram.GetOutputPort("clearance").Eval(self._context)[0])
        reward = 10.0 * self.progress()
        reached, contact = self._distance < 0.002, gap <= 0.0
        info = {"is_success": reached and not contact, "contact": contact, "gap": gap}
        return reward + reached - contact, reached or contact, info

    def draw(self, axes: Any) -> None:
        """Shafts as seen from above."""
        tool = self.read("robot.tool", RobotTool)
        shafts = {"robot": (tool.fulcrum, tool.tip)}
        for name in ("target", "obstacle"):
            told = self.read(f"{name}.estimate", Estimate)
            shafts[name] = (told.fulcrum, told.p)
        for name, (fulcrum, tip) in shafts.items():
            xs, ys = (1e3 * np.array([fulcrum[k], tip[k]]) for k in (0, 1))
            axes.plot(xs, ys, color=COLORS[name], linewidth=3)
            axes.plot(xs[1:], ys[1:], "o", color=COLORS[name])
        axes.set(xlim=(-150, 150), ylim=(-150, 150), xlabel="x [mm]", ylabel="y [mm]")


class CrowdCrossing(Environment):
    """A mobile robot crosses a circle of people who do not see it.

    Action: velocity wanted (2), at most 0.5 m/s along each axis. Observation (45): the
    goal relative to the robot, its heading as cosine and sine, its speed; of the eight
    people nearest to it, within 3 m: relative place, relative velocity, radius; zeros
    for none. Reward: 1 for each metre nearer, 5 for arriving, -5 for a collision.
    """

    limit = 40.0
    people = 10
    nearest = 8
    sight = 3.0

    def actions(self) -> Box:
        """Velocities."""
        return box([-0.5] * 2, [0.5] * 2)

    def observations(self) -> Box:
        """Places and velocities, generously bounded."""
        return box([-20.0] * (5 + 5 * self.nearest), [20.0] * (5 + 5 * self.nearest))

    def world(self, rng: np.random.Generator) -> tuple[Any, Any, Command]:
        """The crossing of `nav_crowd`, other people each time."""
        crowd = f"crowd={{people: {self.people}, seed: {int(rng.integers(2**31))}}}"
        scenario = load_scenario("nav_crowd", [crowd], int(rng.integers(2**31)))
        self._goal = np.array(scenario.goal)
        self._radius = scenario.robot.radius
        inputs = {"robot": RobotState, "seen": SEEN, "goal": Goal}
        outputs = {"v_R": PlanarVelocity(0.0, 0.0), "mode": Mode()}
        command = Command(inputs, outputs, "v_R", [0.0, 0.0])
        diagram = make_navigation_diagram(scenario, swaps={"planner": command})
        return scenario, diagram, command

    def distance(self) -> float:
        """Of the robot from its goal [m]."""
        return float(np.linalg.norm(self._goal - self._state()[:2]))

    def _state(self) -> Array:
        told: Array = self._diagram.GetOutputPort("robot.state").Eval(self._context)
        return told

    def _people(self) -> Array:
        told = self._diagram.GetOutputPort("obstacles.rows").Eval(self._context)
        rows = np.array(told).reshape(len(ROWS), len(Obstacle._fields))
        return rows[rows[:, 2] > 0.0]

    def observe(self) -> Array:
        """See the class."""
        x, y, theta, v, _ = self._state()
        velocity = v * np.array([math.cos(theta), math.sin(theta)])
        people = self._people()
        place = people[:, :2] - (x, y)
        rows = np.hstack([place, people[:, 3:5] - velocity, people[:, 2:3]])
        away = np.linalg.norm(place, axis=1)
        order = [i for i in np.argsort(away) if away[i] <= self.sight][: self.nearest]
        seen = np.zeros((self.nearest, 5))
        seen[: len(order)] = rows[order]
        own = [*(self._goal - (x, y)), math.cos(theta), math.sin(theta), v]
        told = np.concatenate([own, seen.ravel()])
        return np.clip(told, -20.0, 20.0).astype(np.float32)

    def judge(self) -> tuple[float, bool, dict[str, Any]]:
        """Nearer is better, a collision ends it."""
        people, place = self._people(), self._state()[:2]
        gaps = np.linalg.norm(people[:, :2] - place, axis=1) - people[:, 2]
        reward = self.progress()
        collided = bool((gaps <= self._radius).any())
        reached = self._distance < 0.1
        info = {"is_success": reached and not collided, "collided": collided}
        return reward + 5.0 * reached - 5.0 * collided, reached or collided, info

    def draw(self, axes: Any) -> None:
        """Discs."""
        from matplotlib.patches import Circle

        x, y, *_ = self._state()
        axes.add_patch(Circle((x, y), self._radius, color=COLORS["robot"]))
        for px, py, radius, *_ in self._people():
            axes.add_patch(Circle((px, py), radius, color=COLORS["obstacle"]))
        axes.plot(*self._goal, "*", color=COLORS["target"], markersize=12)
        axes.set(xlim=(-6, 6), ylim=(-6, 6), xlabel="x [m]", ylabel="y [m]")


class SnakeReach(Environment):
    """The snake's tool to a point, its axes kept along the channel.

    Action: velocity of the tool (3), at most 10 mm/s along each axis. Observation (10):
    the tool, the goal relative to it, the last action over its bound, and the distance;
    lengths in cm. Reward: 100 for each metre nearer, 1 for arriving within 0.5 mm.
    """

    limit = 10.0

    def actions(self) -> Box:
        """Velocities of the tool."""
        return box([-0.01] * 3, [0.01] * 3)

    def observations(self) -> Box:
        """Centimetres."""
        return box([-30.0] * 10, [30.0] * 10)

    def world(self, rng: np.random.Generator) -> tuple[Any, Any, Command]:
        """A goal within reach."""
        along = (0.0, 0.0, 1.0)
        first = ToolTarget((0.0, 0.0, 0.045), along, along)
        pose = "tip.poses=[{p_WT: [0, 0, 0.045], n_WT: [0, 0, 1], n_WI: [0, 0, 1]}]"
        scenario = load_scenario("snake_circle", [pose], int(rng.integers(2**31)))
        while True:
            goal = rng.uniform([-0.012, -0.012, 0.036], [0.012, 0.012, 0.055])
            if tool_postures(goal, along, along, scenario.snake).reached:
                break
        self._goal, self._wanted = goal, np.array(first.p)
        self._last = np.zeros(3)
        outputs = {"target": first, "reference": ToolPose(first.p, along)}
        rest = [*first.p, *along, *along]
        command = Command({}, outputs, "target", rest)
        diagram = make_snake_diagram(scenario, swaps={"tip_reference": command})
        return scenario, diagram, command

    def commanded(self, action: Array) -> Array:
        """The pose that is wanted moves with the velocity, a step ahead of the tool."""
        self._last = action / 0.01
        self._wanted = self._tool() + 2.0 * self.period * action
        return np.concatenate([self._wanted, [0.0, 0.0, 1.0] * 2])

    def _tool(self) -> Array:
        tool: Array = np.array(self.read("snake.tool", ToolPose).p)
        return tool

    def distance(self) -> float:
        """Of the tool from the goal [m]."""
        return float(np.linalg.norm(self._goal - self._tool()))

    def observe(self) -> Array:
        """See the class."""
        tool = self._tool()
        away = 1e2 * (self._goal - tool)
        told = [1e2 * tool, away, self._last, [np.linalg.norm(away)]]
        return np.clip(np.concatenate(told), -30.0, 30.0).astype(np.float32)

    def judge(self) -> tuple[float, bool, dict[str, Any]]:
        """Nearer is better."""
        reward = 100.0 * self.progress()
        reached = self._distance < 5e-4
        return reward + reached, reached, {"is_success": reached}

    def draw(self, axes: Any) -> None:
        """Tool and goal as seen along the channel."""
        for name, point in (("robot", self._tool()), ("target", self._goal)):
            axes.plot(*(1e3 * point[:2]), "o", color=COLORS[name], label=name)
        axes.set(xlim=(-15, 15), ylim=(-15, 15), xlabel="x [mm]", ylabel="y [mm]")
        axes.legend()


ENVIRONMENTS: dict[str, type[Environment]] = {
    "GauzeDelivery-v0": GauzeDelivery,
    "CrowdCrossing-v0": CrowdCrossing,
    "SnakeReach-v0": SnakeReach,
}

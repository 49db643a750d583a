"""A crowd that crosses a circle, everyone avoiding everyone, the robot if they see it.

The circle crossing of the CrowdNav benchmark (C. Chen et al., ICRA 2019): humans start
on a circle and walk to the opposite point, by ORCA there, and do not see the robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, sin
import random
from typing import Any

import numpy as np

from plants.crowd.orca import orca_towards
from plants.crowd.signals import CAPACITY, OBSTACLES, Obstacle
from plants.crowd.social_force import social_force_towards
from plants.turtlebot.signals import RobotState
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import size

MODELS = ("orca", "social_force")
OBSTACLE_SIZE = size(Obstacle)
PERIOD = 0.25
"""Of everyone's decisions [s]."""


@dataclass
class CrowdParams:
    """A crowd; everyone is alike."""

    people: int = parameter(0, "how many there are", least=0, most=CAPACITY)
    radius: float = parameter(0.3, "of a person", "m", least=0.05, most=1.0)
    speed: float = parameter(0.4, "a person's greatest", "m/s", above=0.0, most=3.0)
    circle: float = parameter(
        4.0, "radius of the circle they start on", "m", least=1.0, most=50.0
    )
    x: float = parameter(0.0, "of the circle's centre", "m", least=-100.0, most=100.0)
    y: float = parameter(0.0, "of the circle's centre", "m", least=-100.0, most=100.0)
    model: str = parameter("orca", "by what they avoid each other", choices=MODELS)
    sees_robot: bool = parameter(False, "whether they avoid the robot as well")
    seed: int = parameter(1, "of the starts", least=0, most=2**31 - 1)

    def rules(self) -> Rules:
        """They must fit on their circle."""
        most = int(2.0 * pi * self.circle / (2.8 * self.radius))
        yield self.people <= most, "people", f"<= {most}: no more fit on the circle"


def starts(params: CrowdParams) -> list[Obstacle]:
    """Everyone at the start, clear of each other and of the lowest point.

    Raises:
        ValueError: If no room is found for everyone.
    """
    rng = random.Random(params.seed)
    clear = 2.0 * params.radius + 0.2
    places = [(0.0, -params.circle)]  # the robot's, by custom
    tries = 0
    while len(places) <= params.people:
        tries += 1
        if tries > 20_000:
            raise ValueError(f"crowd.people={params.people}: no room for all of them")
        angle = rng.uniform(0.0, 2.0 * pi)
        x = params.circle * cos(angle) + rng.uniform(-0.5, 0.5)
        y = params.circle * sin(angle) + rng.uniform(-0.5, 0.5)
        if all(
            hypot(x - a, y - b) >= clear and hypot(x + a, y + b) >= clear
            for a, b in places
        ):
            places.append((x, y))
    return [
        Obstacle(params.x + x, params.y + y, params.radius, 0.0, 0.0)
        for x, y in places[1:]
    ]


@compiled
def straight_on(people: np.ndarray, decided: np.ndarray, time: float) -> np.ndarray:
    """Rows of `Obstacle`, `CAPACITY` of them, a time after people have decided."""
    table, dt = np.zeros(CAPACITY * OBSTACLE_SIZE), time - decided[0]
    table[: len(people)] = people
    for k in range(0, len(people), OBSTACLE_SIZE):
        table[k] += dt * people[k + 3]
        table[k + 1] += dt * people[k + 4]
    return table


class CrowdMotion(Block):
    """Moves a crowd by ORCA or the social force.

    Port ``robot`` accepts the `RobotState`; it need not be connected.
    Port ``obstacles`` emits everyone, rows of `Obstacle`.
    """

    def __init__(
        self, params: CrowdParams | None = None, robot_radius: float = 0.18
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            robot_radius: Of whom they may see [m].

        Raises:
            ParameterError: If a parameter is out of range.
            ValueError: If the circle has no room for the crowd.
        """
        super().__init__()
        self.params = params or CrowdParams(people=3)
        check(self.params)
        people = starts(self.params)
        x, y = 2.0 * self.params.x, 2.0 * self.params.y
        self.goals = [(x - o.x, y - o.y) for o in people]
        self._radius = robot_radius
        self._robot = self.signal_in("robot", RobotState)
        self._decided = self.DeclareDiscreteState([0.0])
        self._people = self.DeclareDiscreteState(np.ravel(people))
        self.signal_out(
            "obstacles",
            OBSTACLES,
            self._now,
            {self.xd_ticket(), self.time_ticket()},
        )
        self.update_every(PERIOD, self._update)

    def _now(self, context: Any) -> np.ndarray:
        """Everyone at the context's time, as the port has them."""
        state = context.get_discrete_state
        now: np.ndarray = straight_on(
            state(self._people).value(),
            state(self._decided).value(),
            context.get_time(),
        )
        return now

    def _update(self, context: Any) -> Sequence[Any]:
        rows = self._now(context).reshape(-1, size(Obstacle))[: len(self.goals)]
        people, seen = [*map(Obstacle._make, rows.tolist())], []
        if self.params.sees_robot and self._robot.HasValue(context):
            robot = RobotState(*self._robot.Eval(context).tolist())
            c, s = cos(robot.theta), sin(robot.theta)
            here = (robot.x, robot.y, self._radius, robot.v * c, robot.v * s)
            seen = [Obstacle(*here)]
        if self.params.model == "orca":
            goals = [*self.goals, *((o.x + o.v_x, o.y + o.v_y) for o in seen)]
            agents = [*people, *seen]
            moves = orca_towards(agents, goals, self.params.speed, 5.0, PERIOD)
            moves = moves[: len(people)]
        else:
            moves = social_force_towards(
                [*people, *seen], self.goals, self.params.speed, PERIOD
            )
        rows[:, 3:] = moves
        return np.array([context.get_time()]), rows.ravel()

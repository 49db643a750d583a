"""A crowd that crosses a circle, everyone avoiding everyone but the robot.

The circle crossing of the CrowdNav benchmark (C. Chen et al., ICRA 2019): humans
start on a circle, walk to the opposite point by ORCA, and do not see the robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, isfinite, pi, sin
import random
from typing import Any

from plants.crowd.orca import orca_towards
from systems.common.block import Block
from systems.switching.signals import CAPACITY

PERIOD = 0.25
"""Of everyone's decisions [s]."""


@dataclass
class CrowdParams:
    """A crowd."""

    # How many people; none by default.
    people: int = 0
    # Radius of a person [m].
    radius: float = 0.3
    # Greatest speed of a person [m/s].
    speed: float = 0.4
    # Radius of the circle they start on [m], and its centre [m].
    circle: float = 4.0
    x: float = 0.0
    y: float = 0.0
    # Seed of the starts.
    seed: int = 1

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is out of range; tells the range.
        """
        if self.people < 0:
            raise ValueError(f"crowd: people={self.people} must be >= 0")
        for name in ("radius", "speed", "circle"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"crowd: {name}={value} must be positive")
        if self.people * 2.8 * self.radius > 2.0 * pi * self.circle:
            most = int(2.0 * pi * self.circle / (2.8 * self.radius))
            raise ValueError(
                f"crowd: people={self.people} do not fit on the circle; nearest {most}"
            )


def starts(params: CrowdParams) -> list[tuple[float, float]]:
    """Where everyone starts [m], clear of each other and of the lowest point."""
    rng = random.Random(params.seed)
    clear = 2.0 * params.radius + 0.2
    places = [(0.0, -params.circle)]  # the robot's, by custom
    tries = 0
    while len(places) <= params.people:
        tries += 1
        if tries > 20_000:
            raise ValueError(f"crowd: no room for people={params.people}")
        angle = rng.uniform(0.0, 2.0 * pi)
        x = params.circle * cos(angle) + rng.uniform(-0.5, 0.5)
        y = params.circle * sin(angle) + rng.uniform(-0.5, 0.5)
        if all(
            hypot(x - a, y - b) >= clear and hypot(x + a, y + b) >= clear
            for a, b in places
        ):
            places.append((x, y))
    return [(params.x + x, params.y + y) for x, y in places[1:]]


class CrowdMotion(Block):
    """Moves a crowd by ORCA; the robot is invisible to it.

    Port ``obstacles`` emits x, y, radius, v_x, v_y of each person, world frame
    (5 each; radius zero for none).
    """

    def __init__(
        self, params: CrowdParams | None = None, capacity: int = CAPACITY
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or CrowdParams(people=3)
        self.params.check()
        if self.params.people > capacity:
            raise ValueError(
                f"crowd: people={self.params.people}: expected at most {capacity}"
            )
        self._capacity = capacity
        places = starts(self.params)
        centre = (2.0 * self.params.x, 2.0 * self.params.y)
        self.goals = [(centre[0] - x, centre[1] - y) for x, y in places]
        # Time of the last decision, then x, y, v_x, v_y of everyone at that time.
        state = [0.0]
        for x, y in places:
            state += [x, y, 0.0, 0.0]
        self._state = self.DeclareDiscreteState(state)
        self.vector_out(
            "obstacles",
            5 * capacity,
            self._calc_obstacles,
            {self.xd_ticket(), self.time_ticket()},
        )
        self.update_every(PERIOD, self._update)

    def _now(self, context: Any) -> list[tuple[float, float, float, float, float]]:
        """x, y, v_x, v_y, radius of everyone at the context's time."""
        held = context.get_discrete_state(self._state).value().tolist()
        dt = context.get_time() - held[0]
        people = []
        for k in range(1, len(held), 4):
            x, y, vx, vy = held[k : k + 4]
            people.append((x + dt * vx, y + dt * vy, vx, vy, self.params.radius))
        return people

    def _calc_obstacles(self, context: Any) -> Sequence[float]:
        rows: list[float] = []
        for x, y, vx, vy, radius in self._now(context):
            rows += [x, y, radius, vx, vy]
        return rows + [0.0] * (5 * self._capacity - len(rows))

    def _update(self, context: Any) -> Sequence[float]:
        people = self._now(context)
        moves = orca_towards(people, self.goals, self.params.speed, 5.0, PERIOD)
        state = [context.get_time()]
        for (x, y, _, _, _), (vx, vy) in zip(people, moves, strict=True):
            state += [x, y, vx, vy]
        return state

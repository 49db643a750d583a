"""The switching planner's parameters, memory and result."""

from dataclasses import dataclass, field
from math import inf, isfinite
from typing import NamedTuple

ATTRACTIVE, BYPASS, GROUP, LEAVE, YIELD, UNREACHABLE = range(6)
MODES = ("attractive", "bypass", "group", "leave", "yield", "unreachable")
"""Names of the planner's states, by number."""


@dataclass
class SwitchingParams:
    """Parameters of the switching planner; the defaults are a TurtleBot's."""

    # Radius of the body [m].
    body_radius: float = 0.18
    # Speed of the body [m/s].
    speed: float = 0.5
    # Radius of vision R_v [m].
    vision: float = 3.0
    # Distances to keep from obstacles' surfaces [m], the preferred one first; the
    # next is taken where no heading keeps the one before.
    margins: list[float] = field(default_factory=lambda: [0.2, 0.1])
    # Fractions of the speed to try where no heading at full speed is free.
    slower: list[float] = field(default_factory=lambda: [0.5])
    # The body takes this long to follow [s]: it plans from where it will be then.
    response: float = 0.2
    # Obstacles that cannot be met within this time [s] do not matter.
    horizon: float = 6.0
    # The same for obstacles that stand [s].
    standing_horizon: float = 2.5
    # An obstacle slower than this [m/s] stands.
    standing_speed: float = 0.05
    # Advantage of the obstacle and side chosen last [rad].
    hysteresis: float = 0.3
    # Cost of turning away from the last bypass [rad per rad].
    commitment: float = 0.6
    # Advantage of passing behind an obstacle of the body's own speed [rad].
    behind_bias: float = 0.35
    # Standing obstacles that turn the body by more than this [rad] are a trap.
    trap_turn: float = 1.4
    # Gaps between safety circles up to this width [m] count as closed.
    closed_gap: float = 0.02
    # A group is left for a place nearer to the goal than any before by this [m].
    leave_gain: float = 0.05
    # Deceleration that limits the speed towards standing obstacles [m/s^2].
    deceleration: float = 0.4
    # The body may retreat backwards from obstacles that come within this time [s].
    retreat_time: float = 2.0
    # Speed per distance to the goal [1/s], near the goal.
    approach_gain: float = 2.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is out of range; tells the range.
        """
        positive = [
            *("body_radius", "speed", "vision", "horizon", "standing_horizon"),
            *("trap_turn", "deceleration", "approach_gain"),
        ]
        for name in positive:
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"planner: {name}={value} must be positive and finite")
        others = [
            *("response", "standing_speed", "hysteresis", "commitment", "behind_bias"),
            *("closed_gap", "leave_gain", "retreat_time"),
        ]
        for name in others:
            value = getattr(self, name)
            if not (value >= 0.0 and isfinite(value)):
                raise ValueError(f"planner: {name}={value} must be >= 0 and finite")
        margins = self.margins
        if not margins or not all(m > 0.0 and isfinite(m) for m in margins):
            raise ValueError(
                f"planner: margins={margins} must be distances > 0 m, e.g. [0.2, 0.1]"
            )
        if margins != sorted(margins, reverse=True):
            raise ValueError(
                f"planner: margins={margins} must fall; nearest "
                f"{sorted(margins, reverse=True)}"
            )
        if any(not 0.0 < f < 1.0 for f in self.slower):
            raise ValueError(
                f"planner: slower={self.slower} must be fractions between 0 and 1"
            )
        if self.vision <= self.body_radius + margins[0]:
            raise ValueError(
                f"planner: vision={self.vision} m must be greater than body_radius "
                f"and the first margin together, {self.body_radius + margins[0]} m"
            )


class SwitchingState(NamedTuple):
    """What the planner remembers from step to step: nine numbers."""

    # One of MODES.
    mode: float = 0.0
    # Identity of the obstacle followed; -1 for none.
    track: float = -1.0
    # Sense about it: +1 counter-clockwise, -1 clockwise.
    side: float = 1.0
    # Least distance from the goal [m] to which a straight way to it has led; from a
    # group the body leaves only for a place that is nearer.
    best: float = inf
    # Where the body first touched the group's boundary [m].
    hit_x: float = 0.0
    hit_y: float = 0.0
    # -1 before that, 0 near that place, 1 away from it; how often it came back.
    away: float = -1.0
    laps: float = 0.0
    # Heading of the last bypass [rad].
    heading: float = 0.0


class Plan(NamedTuple):
    """A step's result."""

    # Velocity to take [m/s].
    v_x: float
    v_y: float
    # What to remember.
    state: SwitchingState
    # Whether an obstacle in sight is at least as fast as the body. Then no method
    # can promise anything; the planner goes on doing its best.
    outrun: bool = False
    # Whether an obstacle will meet the body soon if it stays where it is: time to
    # get away at once, backwards if need be.
    retreat: bool = False

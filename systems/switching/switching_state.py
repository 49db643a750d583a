"""The switching planner's parameters, memory and result."""

from dataclasses import dataclass
from math import inf, pi
from typing import NamedTuple

import numpy as np

from systems.common.compiled import packed
from systems.common.parameter import Rules, check, parameter
from systems.switching.body import BodyParams

ATTRACTIVE, BYPASS, GROUP, LEAVE, YIELD, UNREACHABLE, EVADE = range(7)
MODES = ("attractive", "bypass", "group", "leave", "yield", "unreachable", "evade")
"""Names of the planner's states, by number; the last one leaves the others waiting."""


@dataclass
class SwitchingParams(BodyParams):
    """Parameters of the switching planner; the defaults are a TurtleBot's."""

    vision: float = parameter(3.0, "radius of vision R_v", "m", above=0.0, most=100.0)
    margins: list[float] = parameter(
        [0.2, 0.1],
        "distances to keep from obstacles' surfaces, the preferred one first; the next "
        "is taken where no heading keeps the one before",
        "m",
        shape=(-1,),
        least=0.02,
        most=2.0,
    )
    slower: list[float] = parameter(
        [0.5],
        "fractions of the speed to try where no heading at full speed is free",
        shape=(-1,),
        least=0.05,
        most=0.95,
    )
    response: float = parameter(
        0.2,
        "the body takes this long to follow: it plans from where it will be then",
        "s",
        least=0.0,
        most=2.0,
    )
    horizon: float = parameter(
        6.0,
        "obstacles that cannot be met within this time do not matter",
        "s",
        least=1.0,
        most=60.0,
    )
    standing_horizon: float = parameter(
        2.5, "the same for obstacles that stand", "s", least=1.0, most=60.0
    )
    standing_speed: float = parameter(
        0.05, "an obstacle that is slower stands", "m/s", least=0.0, most=0.5
    )
    hysteresis: float = parameter(
        0.3,
        "advantage of the obstacle and side chosen last",
        "rad",
        least=0.0,
        most=1.5,
    )
    commitment: float = parameter(
        0.6, "cost of turning away from the last bypass, per angle", least=0.0, most=5.0
    )
    behind_bias: float = parameter(
        0.35,
        "advantage of passing behind an obstacle of the body's own speed",
        "rad",
        least=0.0,
        most=1.5,
    )
    trap_turn: float = parameter(
        1.4,
        "standing obstacles that turn the body by more than this are a trap",
        "rad",
        least=0.5,
        most=pi,
    )
    closed_gap: float = parameter(
        0.02,
        "gaps between safety circles up to this width count as closed",
        "m",
        least=0.0,
        most=1.0,
    )
    leave_gain: float = parameter(
        0.05,
        "a group is left for a place nearer to the goal than any before by this",
        "m",
        least=0.0,
        most=1.0,
    )
    deceleration: float = parameter(
        0.4,
        "limits the speed towards standing obstacles",
        "m/s^2",
        above=0.0,
        most=10.0,
    )
    retreat_time: float = parameter(
        2.0,
        "the body may retreat backwards from obstacles that come within this time",
        "s",
        least=0.0,
        most=10.0,
    )
    unseen_speed: float = parameter(
        0.5,
        "of who may step out from where the body does not see; 0 for nobody",
        "m/s",
        least=0.0,
        most=5.0,
    )
    braking: float = parameter(
        1.0, "deceleration when somebody does", "m/s^2", above=0.0, most=10.0
    )
    reaction: float = parameter(
        0.2,
        "until it brakes: a scan, a step, the wheels' lag",
        "s",
        least=0.0,
        most=2.0,
    )
    notice: float = parameter(
        0.2,
        "until a track tells that somebody turned: two scans",
        "s",
        least=0.0,
        most=2.0,
    )
    foresight: float = parameter(
        3.0,
        "evasions are carried on for so long; 0 for none",
        "s",
        least=0.0,
        most=10.0,
    )
    approach_gain: float = parameter(
        2.0, "speed per distance, near the goal", "1/s", above=0.0, most=20.0
    )

    def rules(self) -> Rules:
        """Margins fall, and the widest one lies within sight."""
        falling = sorted(self.margins, reverse=True)
        yield bool(self.margins), "margins", "at least one, e.g. [0.2, 0.1]"
        yield self.margins == falling, "margins", f"falling: {falling}"
        least = self.body_radius + self.margins[0]
        told = f"> {least:.6g}, body_radius and the first margin together"
        yield self.vision > least, "vision", told


def constants(params: SwitchingParams) -> np.ndarray:
    """The parameters as the compiled functions take them.

    Their `rungs` are rows of a margin [m] and a speed [m/s], tried one after the other.

    Raises:
        ParameterError: If a parameter is out of range.
    """
    check(params)
    rungs = [(margin, params.speed) for margin in params.margins]
    rungs += [(params.margins[-1], f * params.speed) for f in params.slower]
    least = params.margins[-1]
    return packed(params, margin=params.margins[0], least=least, rungs=rungs)


class Sight(NamedTuple):
    """The world as a step sees it: place, way to the goal, rows of `Disc` [m, m/s]."""

    px: float
    py: float
    gx: float  # unit vector to the goal
    gy: float
    distance: float  # to the goal
    standing: np.ndarray
    solid: np.ndarray  # what stands, and where it ends, to the point
    moving: np.ndarray


class SwitchingState(NamedTuple):
    """What the planner remembers from step to step: eleven numbers."""

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
    # Velocity of the evasion under way [m/s], 0 for none.
    flee_x: float = 0.0
    flee_y: float = 0.0


START = SwitchingState()
"""What the planner remembers at first."""


class Plan(NamedTuple):
    """A step's result."""

    # Velocity to take [m/s].
    v_x: float
    v_y: float
    # What to remember.
    state: SwitchingState
    # Whether an obstacle in sight is at least as fast as the body. Then no method
    # can promise anything; the planner goes on doing its best.
    outrun: bool
    # Whether an obstacle will meet the body soon if it stays where it is: time to
    # get away at once, backwards if need be.
    retreat: bool

"""The signals that the arm's blocks, the tools and the wall exchange.

Those of one room alone are declared beside their block. World frame W, SI units.
"""

from typing import Annotated, NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.signal import AXES, Field, Vector, finiteness, reader


class RobotTool(NamedTuple):
    """The robot's instrument R."""

    fulcrum: Annotated[Vector, Field("m", "p_WG of G_R", (0.0, 0.0, 0.0))]
    tip: Annotated[Vector, Field("m", "p_WP of R", (0.02, 0.0, -0.12))]


class Shaft(NamedTuple):
    """A tool's true shaft: a line that ends at its tip."""

    tip: Annotated[Vector, Field("m", "p_WP", (0.05, 0.0, -0.12))]
    u: Annotated[Vector, Field("1", "unit vector towards the tip", (0.0, 0.0, -1.0))]


class TrackedShaft(NamedTuple):
    """A shaft as the optical tracker saw it."""

    tip: Annotated[Vector, Field("m", "p_WP", (0.05, 0.0, -0.12))]
    u: Annotated[Vector, Field("1", "towards the tip", (0.0, 0.0, -1.0))]
    time: Annotated[float, Field("s", "of exposure, -1 before the first frame", 0.0)]
    valid: Annotated[float, Field("1", "1 if it was seen, else 0", 1.0)]


class Alignment(NamedTuple):
    """Error of the tracker's registration, as it is believed."""

    t: Annotated[Vector, Field("m", "shift at the origin of W", (1e-3, 0.0, 0.0))]
    theta: Annotated[Vector, Field("rad", "rotation vector", (0.0, 0.01, 0.0))]
    sigma: Annotated[float, Field("m", "of a point of the cavity", 1e-4)]
    residual: Annotated[float, Field("m", "of the last frame, smoothed", 1e-4)]


ALIGNED = Alignment((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)
"""Of a tracker that is taken for registered exactly."""


class Estimate(NamedTuple):
    """What is known of a tool and where it goes."""

    p: Annotated[Vector, Field("m", "tip p_WP", (-0.02, 0.01, -0.1))]
    v: Annotated[Vector, Field("m/s", "v_WP", (0.0, -0.03, 0.0))]
    a: Annotated[Vector, Field("m/s^2", "a_WP", (0.0, 0.0, 0.0))]
    fulcrum: Annotated[Vector, Field("m", "p_WG", (0.0, 0.1, 0.0))]
    sigma_p: Annotated[float, Field("m", "standard deviation of the tip", 3e-4)]
    sigma_v: Annotated[float, Field("m/s", "of its velocity", 3e-3)]
    sigma_a: Annotated[float, Field("m/s^2", "of its acceleration", 0.05)]
    known: Annotated[float, Field("1", "1 if it is usable, else 0", 1.0)]
    age: Annotated[float, Field("s", "of the last good frame", 0.0)]


NEVER_SEEN = 1.0
"""An estimate's standard deviation before the tool was ever seen [m]."""


class ViewCone(NamedTuple):
    """What the endoscope sees."""

    apex: Annotated[Vector, Field("m", "p_WC", (0.02, -0.1, 0.0))]
    u: Annotated[Vector, Field("1", "unit vector of its axis", (-0.41, 0.55, -0.727))]
    half: Annotated[float, Field("rad", "half its opening angle", 0.6)]


class Guide(NamedTuple):
    """The closest points of R and O, and where R's one is to go (section 4.1)."""

    M_R: Annotated[Vector, Field("m", "guide point on R", (0.012, 0.0, -0.072))]
    M_O: Annotated[Vector, Field("m", "its nearest on O", (-0.01, 0.02, -0.08))]
    rho: Annotated[float, Field("m", "their distance", 0.03)]
    s: Annotated[float, Field("1", "proportion of R's inserted length at M_R", 0.6)]
    l_over_L: Annotated[float, Field("1", "proportion of O's at M_O", 0.7)]
    M_Rf: Annotated[Vector, Field("m", "where M_R is to go", (-0.03, 0.0, -0.072))]


class Velocity(NamedTuple):
    """A velocity."""

    v: Annotated[Vector, Field("m/s", "of a point", (0.05, 0.0, 0.0), AXES)]


class ToolMotion(NamedTuple):
    """A commanded motion of R."""

    tip: Annotated[Vector, Field("m", "p_WP", (0.0, 0.0, -0.18))]
    u: Annotated[Vector, Field("1", "towards the tip", (0.0, 0.0, -1.0))]
    v: Annotated[Vector, Field("m/s", "v_WP", (0.0, 0.0, 0.0))]
    du: Annotated[Vector, Field("1/s", "rate of u", (0.0, 0.0, 0.0))]
    time: Annotated[float, Field("s", "at which they hold", 0.0)]


class Permission(NamedTuple):
    """What the passive wrist allows the task."""

    speed_scale: Annotated[float, Field("1", "share of its speed, 0 to stand", 1.0)]
    code: Annotated[float, Field("1", "why it stands: a `Stop`", 0.0)]


FREE = Permission(1.0, 0.0)
"""What the passive wrist permits where there is none."""


class ClearanceStatus(NamedTuple):
    """What the constraint sees and does."""

    room: Annotated[float, Field("m", "the least rho - D_safe", 0.02)]
    near: Annotated[float, Field("1", "1 while a tool is near, else 0", 0.0)]
    condition: Annotated[
        float, Field("1", "1 while evasion can keep it for all that are near", 1.0)
    ]
    dodge: Annotated[float, Field("1", "1 while R dodges, else 0", 0.0)]
    change: Annotated[float, Field("m/s", "of the tip's velocity", 0.0)]
    missed: Annotated[float, Field("m/s", "by how much a row is missed", 0.0)]
    escape: Annotated[
        float, Field("1", "1 while a tool leaves the planner no choice, else 0", 0.0)
    ]
    blind: Annotated[float, Field("1", "1 while the view gives way to it", 0.0)]
    forth: Annotated[float, Field("m/s", "as `Leeway`", 1.0)]
    back: Annotated[float, Field("m/s", "as `Leeway`", 1.0)]


class Leeway(NamedTuple):
    """How fast R's fulcrum may move across its shaft, the tip at rest.

    Along the first axis of the shaft's lateral basis (`wall_model.lateral_basis`), and
    against it: no tool is in the way.
    """

    forth: Annotated[float, Field("m/s", "along it", 1.0)]
    back: Annotated[float, Field("m/s", "against it", 1.0)]


UNHINDERED = Leeway(1.0, 1.0)
"""That of a shaft which no tool is near: faster than any wrist."""
CALM = ClearanceStatus(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *UNHINDERED)
"""Of a constraint that sees nothing."""


class Point(NamedTuple):
    """A point."""

    p: Annotated[Vector, Field("m", "p_W", (0.0, 0.0, 0.0), AXES)]


class MovingPoint(NamedTuple):
    """A point and how it moves: the true fulcrum."""

    p: Annotated[Vector, Field("m", "p_W", (0.0, 0.0, 0.0), AXES)]
    v: Annotated[Vector, Field("m/s", "v_W", (0.0, 0.0, 0.0), ("vx", "vy", "vz"))]


class ShaftMotion(NamedTuple):
    """The robot's shaft as the arm's encoders have it, at the sensor S."""

    p: Annotated[Vector, Field("m", "p_WS", (0.0, 0.0, 0.22), ("px", "py", "pz"))]
    u: Annotated[Vector, Field("1", "to the tip", (0.0, 0.0, -1.0), ("ux", "uy", "uz"))]
    v: Annotated[Vector, Field("m/s", "v_WS", (0.0, 0.0, 0.0), ("vx", "vy", "vz"))]
    du: Annotated[
        Vector, Field("1/s", "rate of u", (0.0, 0.0, 0.0), ("dux", "duy", "duz"))
    ]


class Bend(NamedTuple):
    """How the robot's shaft is bent: where its end is, against a straight one."""

    tip: Annotated[Vector, Field("m", "of the tip, in W", (1e-4, 0.0, 0.0))]
    turn: Annotated[
        Vector, Field("rad", "of the end, in W", (0.0, 5e-4, 0.0), ("tx", "ty", "tz"))
    ]


class Wrench(NamedTuple):
    """What the wall does to the shaft."""

    f: Annotated[Vector, Field("N", "force", (0.1, 0.0, 0.0), ("fx", "fy", "fz"))]
    m: Annotated[
        Vector, Field("N m", "moment about S", (0.0, 0.02, 0.0), ("mx", "my", "mz"))
    ]
    valid: Annotated[float, Field("1", "1 if the sensor is alive, else 0", 1.0)]


class Force(NamedTuple):
    """A force."""

    f: Annotated[Vector, Field("N", "on the shaft", (0.1, 0.0, 0.0), AXES)]


class Fulcrum(NamedTuple):
    """The fulcrum I as the force tells of it."""

    p: Annotated[Vector, Field("m", "p_WI", (0.0, 0.0, 0.0), AXES)]
    v: Annotated[Vector, Field("m/s", "v_WI", (0.0, 0.0, 0.0), ("vx", "vy", "vz"))]
    sigma_across: Annotated[float, Field("m", "deviation across the shaft", 1e-4)]
    sigma_along: Annotated[float, Field("m", "deviation along it", 1e-3)]
    stiffness: Annotated[float, Field("N/m", "K", 500.0)]
    sigma_ln_stiffness: Annotated[float, Field("1", "of its logarithm", 0.1)]
    rate: Annotated[float, Field("Hz", "of breathing, 0 while unknown", 0.0)]
    phase: Annotated[float, Field("1", "of the filter", 1.0)]
    jumps: Annotated[float, Field("1", "how many were followed", 0.0)]
    refused: Annotated[float, Field("1", "how many samples were refused", 0.0)]


read_estimate = reader(Estimate)
finite_estimate = finiteness(Estimate)
finite_guide = finiteness(Guide)
finite_tool = finiteness(RobotTool)
finite_cone = finiteness(ViewCone)
finite_permission = finiteness(Permission)


@compiled
def usable(estimate: Estimate) -> bool:
    """True if the estimator knows the tool and gives numbers only."""
    return estimate.known > 0.5 and finite_estimate(estimate)


@compiled
def all_usable(estimates: np.ndarray) -> bool:
    """True if every tool's estimate (n, 17) is usable."""
    good = True
    for i in range(len(estimates)):
        good = good and usable(read_estimate(estimates[i]))
    return good

"""Touch watch: whether a tool pushes the robot's shaft, how hard, and how far down.

`TipLoad` tells what of the wrist's moment no force at the fulcrum explains, as a force
at the tip, f_t, and leaves the wall the rest, f_w. Tissue is touched by the tip; a tool
pushes the shaft anywhere. While something pushes, the wall is taken to bear nothing:
the shaft goes through the fulcrum that is believed. So all of the smooth force is the
touch's, and the moment says where it acts, between fulcrum (0) and tip (1):

    f = f_w + f_t,    share = |f_t| / |f|.

A touch begins with a force at the tip that is clear of what is not known of it, and is
over with `TipLoad`'s. What is passed on as the wall's is what is left, so that a push
moves no estimate of the fulcrum; what the wall does meanwhile is taken for the push.
One that is nearer to the trocar than the moment can tell is the wall's, as before.
"""

from dataclasses import dataclass
from math import exp
from typing import Annotated, Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, norm, plus, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, finiteness
from systems.common.signals import ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.passive_wrist.tip_load import TipForce

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)
finite_force = finiteness(TipForce)
_STILL = (0.0, 0.0, 0.0)


class Touched(NamedTuple):
    """What pushes the shaft."""

    f: Annotated[Vector, Field("N", "on the shaft, across it", (0.6, 0.0, 0.0))]
    share: Annotated[float, Field("1", "where: 0 at the fulcrum, 1 at the tip", 0.6)]
    touched: Annotated[float, Field("1", "1 while something does, else 0", 1.0)]


class Smooth(NamedTuple):
    """The wrench's smooth part, in N and N m, and 1 while something touches."""

    f: Vector
    m: Vector
    touched: float


@dataclass
class TouchWatchParams:
    """From when on a tool is said to touch."""

    least: float = parameter(
        0.4, "force at the tip from which it does", "N", above=0, most=10
    )
    sure: float = parameter(
        5.0, "of its standard deviations, at the least", least=0, most=20
    )
    smooth: float = parameter(
        0.02, "time constant of the force", "s", above=0, most=0.5
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


@compiled
def watch_touch(
    c: Any, old: Smooth, shaft: ShaftMotion, wrench: Wrench, tip: TipForce
) -> tuple[Smooth, Wrench, Touched]:
    """One reading: what is remembered, the wall's share, and what pushes.

    Args:
        c: A record of the parameters, and `part`, what a reading counts.
        old: What was remembered.
        shaft: As the encoders have it.
        wrench: What `TipLoad` leaves to the wall.
        tip: What it says of the tip.
    """
    sound = finite_shaft(shaft) and finite_wrench(wrench) and finite_force(tip)
    if not sound or wrench.valid < 0.5:
        return Smooth(_STILL, _STILL, 0.0), wrench, Touched(_STILL, 1.0, 0.0)
    f = along(old.f, c.part, sub(wrench.f, old.f))
    m = along(old.m, c.part, sub(wrench.m, old.m))
    clear = norm(tip.f) > max(c.least, c.sure * tip.sigma)
    touched = 1.0 if tip.contact > 0.5 and (clear or old.touched > 0.5) else 0.0
    state = Smooth(f, m, touched)
    if touched < 0.5:
        return state, wrench, Touched(_STILL, 1.0, 0.0)
    push = plus(across(f, shaft.u), tip.f)
    share = min(1.0, norm(tip.f) / max(norm(push), 1e-6))
    wall = Wrench(sub(wrench.f, f), sub(wrench.m, m), wrench.valid)
    return state, wall, Touched(push, share, 1.0)


class TouchWatch(StepBlock):
    """Says whether a tool pushes the robot's, and keeps its push from the wall's.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` that `TipLoad` leaves to the wall.

    Port ``tip_force`` accepts its `TipForce`.

    Port ``wall`` emits the `Wrench` of the wall alone.

    Port ``touch`` emits what is `Touched`.
    """

    def __init__(self, params: TouchWatchParams | None = None) -> None:
        """Makes the block; raises ParameterError for a value out of range."""
        super().__init__()
        params = check(params or TouchWatchParams())
        self.declare_step(
            watch_touch,
            [packed(params, part=1.0 - exp(-params.period / params.smooth))],
            {"shaft": ShaftMotion, "wrench": Wrench, "tip_force": TipForce},
            Smooth(_STILL, _STILL, 0.0),
            {"wall": Wrench, "touch": Touched},
            params.period,
            timed=False,
        )

"""Shaft bend: how the wrist's wrench bends the shaft, and what lies where for it.

A beam that is held in the mount and pushed at its tip, l farther, goes by F l^3 / 3EI
and turns by F l^2 / 2EI there: as a rigid piece would behind a joint of stiffness
k = 4EI / 3l, a third of l from the mount (`plants.instruments.instrument`). What the
joint is turned by is the moment about it of all that acts behind it: the wrench about
the sensor S, and the weight of that piece,

    theta = P (m - a u x f + (c - a) u x w) / k,    P = 1 - u u^T,

a and c being the places of joint and centre of mass from S. The piece's line goes along
u' = u + theta x u through S' = S + a (u - u'): to whoever is told S', u' and the wrench
about S' it is a straight shaft again.

The piece also swings, at 34 Hz a rod of steel, and the sensor cannot tell its swinging
from a wall that pulls; a wrist that follows that sets it swinging the more. So pose and
wrench are made smooth, both alike, for they must belong together.
"""

from dataclasses import dataclass
from math import exp
from typing import Any, NamedTuple

from plants.instruments.instrument import InstrumentParams
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    Vector,
    across,
    along,
    cross,
    over,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import check, parameter
from systems.common.signal import finiteness
from systems.common.signals import Bend, ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.sensing.wrench_kernel import GRAVITY

_STILL = (0.0, 0.0, 0.0)
finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)


class Smooth(NamedTuple):
    """Pose and wrench as they are remembered, and 1 once there are any."""

    p: Vector
    u: Vector
    v: Vector
    du: Vector
    f: Vector
    m: Vector
    begun: float


@dataclass
class ShaftBendParams:
    """How the bend is reckoned."""

    active: bool = parameter(False, "if not, the shaft is taken for straight")
    told_stiffness: float | None = parameter(
        None,
        "EI as the robot is told; as it is if null",
        "N m^2",
        above=0,
        most=1e3,
    )
    smooth: float = parameter(
        0.02, "time constant of pose and wrench", "s", above=0, most=0.2
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


_START = Smooth(_STILL, (0.0, 0.0, -1.0), _STILL, _STILL, _STILL, _STILL, 0.0)


@compiled
def turn_of(c: Any, shaft: ShaftMotion, wrench: Wrench) -> Vector:
    """By how much the piece behind the joint is turned: theta in rad, in W.

    Args:
        c: A record: `joint`, `centre` [m], `weight` [N], `stiffness` [N m/rad].
        shaft: Of the mount.
        wrench: What acts on the shaft, its weight and inertia left out.
    """
    u = shaft.u
    m = along(wrench.m, -c.joint, cross(u, wrench.f))
    w = (0.0, 0.0, -c.weight)
    return over(across(along(m, c.centre - c.joint, cross(u, w)), u), c.stiffness)


@compiled
def bent(
    c: Any, theta: Vector, shaft: ShaftMotion, wrench: Wrench
) -> tuple[ShaftMotion, Wrench, Bend]:
    """Line and wrench of the piece behind the joint, and where the tip is.

    Args:
        c: As `turn_of` has it, with the `length` to the tip [m].
        theta: What the piece is turned by, in rad.
        shaft: Of the mount.
        wrench: About its origin.
    """
    u = unit(plus(shaft.u, cross(theta, shaft.u)), shaft.u)
    back = sub(shaft.u, u)
    p = along(shaft.p, c.joint, back)
    m = sub(wrench.m, cross(sub(p, shaft.p), wrench.f))
    line = ShaftMotion(p, u, shaft.v, plus(shaft.du, cross(theta, shaft.du)))
    tip = scaled(c.joint - c.length, back)
    return line, Wrench(wrench.f, m, wrench.valid), Bend(tip, theta)


@compiled
def _step(
    c: Any, old: Smooth, shaft: ShaftMotion, wrench: Wrench
) -> tuple[Smooth, ShaftMotion, Wrench, Bend]:
    share = 1.0 - exp(-c.period / c.smooth) if old.begun > 0.5 else 1.0
    p, u, v, du = old.p, old.u, old.v, old.du
    if finite_shaft(shaft):
        p, u = along(p, share, sub(shaft.p, p)), along(u, share, sub(shaft.u, u))
        v, du = along(v, share, sub(shaft.v, v)), along(du, share, sub(shaft.du, du))
    f, m, valid = old.f, old.m, 0.0
    if finite_shaft(shaft) and wrench.valid > 0.5 and finite_wrench(wrench):
        f, m = along(f, share, sub(wrench.f, f)), along(m, share, sub(wrench.m, m))
        valid = 1.0
    now = Smooth(p, u, v, du, f, m, max(old.begun, valid))
    calm, felt = ShaftMotion(p, unit(u, shaft.u), v, du), Wrench(f, m, valid)
    line, there, bend = bent(c, turn_of(c, calm, felt), calm, felt)
    return now, line, there, bend


class ShaftBend(StepBlock):
    """Reckons the bend of the shaft from the wrist's wrench.

    Port ``shaft`` accepts the `ShaftMotion` of the mount, by the arm's joints.

    Port ``wrench`` accepts the `Wrench` about its origin.

    Port ``bent_shaft`` emits the `ShaftMotion` of the piece that goes through the wall.

    Port ``bent_wrench`` emits the `Wrench` about its origin.

    Port ``bend`` emits the `Bend`.
    """

    def __init__(
        self,
        params: ShaftBendParams | None = None,
        instrument: InstrumentParams | None = None,
    ) -> None:
        """Makes the block for an instrument."""
        super().__init__()
        params = check(params or ShaftBendParams())
        tool = instrument or InstrumentParams()
        mass, centre = tool.bent_mass, tool.bent_centre
        share = 1.0
        if params.told_stiffness is not None and tool.bending_stiffness:
            share = params.told_stiffness / tool.bending_stiffness
        record = packed(
            joint=tool.bend_joint,
            length=float(tool.length),
            centre=centre,
            weight=GRAVITY * mass,
            stiffness=share * tool.bend_stiffness,
            smooth=float(params.smooth),
            period=float(params.period),
        )
        self.declare_step(
            _step,
            [record],
            {"shaft": ShaftMotion, "wrench": Wrench},
            _START,
            {"bent_shaft": ShaftMotion, "bent_wrench": Wrench, "bend": Bend},
            params.period,
            timed=False,
        )

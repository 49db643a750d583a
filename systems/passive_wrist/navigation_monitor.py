"""Navigation monitor: whether the navigation is accurate, while it is performed.

The sensor's first purpose in the paper's section 3, which says no more of it. Where R
is navigated accurately its shaft goes through the fulcrum, so nothing pushes it, and
what the sensor feels is what the estimate of the fulcrum I explains. With the shaft's
origin S and direction u, depth lambda = u . (p_I - p_S) and P = 1 - u u^T three forces
across the shaft should vanish:

- the *load*, P f, what is left for the emulation to relax;
- the *gap*, P f - K P (p_I - p_S), felt and not explained: the estimate is wrong;
- the *mismatch*, P f - (m x u) / lambda: force and moment are not of one contact at
  that depth, so the sensor is wrong.

Each is smoothed over more than the noise, less than a motion. The navigation is not
accurate from when one exceeds its bound until all have been below half of it for a
while. Nor is it without a reading, or while the estimate is not sure. A wrist that
probes loads the wall on purpose, and navigates nothing: that is no alarm.
"""

from dataclasses import dataclass
from math import exp
from typing import Annotated, Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, cross, dot, norm, over, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Vector, finiteness
from systems.common.signals import Fulcrum, Permission, ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.common.stops import Code, Stop

finite_shaft, finite_wrench = finiteness(ShaftMotion), finiteness(Wrench)
finite_fulcrum, finite_permission = finiteness(Fulcrum), finiteness(Permission)
_STILL = (0.0, 0.0, 0.0)


class Doubt(Code):
    """Why the navigation is not said to be accurate."""

    NONE = 0, "it is accurate"
    PROBING = 1, "the wall is probed"
    LOAD = 2, "the wall is loaded"
    GAP = 3, "what is felt is not what the estimate explains"
    MISMATCH = 4, "force and moment do not belong together"
    SILENT = 5, "no reading"
    UNSURE = 6, "the estimate is not sure"


class Accuracy(NamedTuple):
    """Whether the navigation is accurate, and the forces that say so."""

    accurate: Annotated[float, Field("1", "1 if it is, else 0", 1.0)]
    doubt: Annotated[float, Field("1", "why it is not: a `Doubt`", 0.0)]
    load: Annotated[float, Field("N", "of the wall, across the shaft", 0.05)]
    gap: Annotated[float, Field("N", "that the estimate does not explain", 0.02)]
    mismatch: Annotated[float, Field("N", "between force and moment", 0.02)]
    alarms: Annotated[float, Field("1", "how often it was found not to be", 0.0)]


class State(NamedTuple):
    """The smooth forces in N; s of silence and of calm; the doubt, and how many."""

    load: Vector
    gap: Vector
    mismatch: Vector
    silent: float
    calm: float
    doubt: float
    alarms: float


@dataclass
class NavigationMonitorParams:
    """From when on navigation is not accurate."""

    load: float = parameter(
        0.5, "of the wall, from which it is not", "N", above=0, most=20
    )
    gap: float = parameter(
        0.25, "unexplained force from which it is not", "N", above=0, most=20
    )
    mismatch: float = parameter(
        0.2, "between force and moment, from which it is not", "N", above=0, most=20
    )
    sigma: float = parameter(
        1e-3,
        "across the shaft, above which the estimate is not sure",
        "m",
        above=0,
        most=0.02,
    )
    smooth: float = parameter(0.1, "time constant of the forces", "s", above=0, most=2)
    silence: float = parameter(
        0.05, "without a reading, from which it is not", "s", least=0, most=1
    )
    calm: float = parameter(
        0.2, "below half of all bounds, after which it is again", "s", least=0, most=5
    )
    least_depth: float = parameter(
        0.05, "of the fulcrum from the sensor", "m", above=0, most=0.3
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)


_PROBES = float(Stop.PROBING.value)
_PROBING, _LOAD = float(Doubt.PROBING.value), float(Doubt.LOAD.value)
_GAP, _MISMATCH = float(Doubt.GAP.value), float(Doubt.MISMATCH.value)
_SILENT, _UNSURE = float(Doubt.SILENT.value), float(Doubt.UNSURE.value)


@compiled
def doubted(c: Any, state: State, sigma: float, share: float) -> float:
    """The doubt that a share of the bounds gives; the most telling one first."""
    if state.silent > c.silence:
        return _SILENT
    if norm(state.mismatch) > share * c.mismatch:
        return _MISMATCH
    if norm(state.gap) > share * c.gap:
        return _GAP
    if norm(state.load) > share * c.load:
        return _LOAD
    if sigma > share * c.sigma:
        return _UNSURE
    return 0.0


@compiled
def judge(
    c: Any,
    old: State,
    shaft: ShaftMotion,
    wrench: Wrench,
    estimate: Fulcrum,
    permission: Permission,
) -> tuple[State, Accuracy]:
    """One reading: what is remembered, and what is said.

    Args:
        c: A record of the parameters, and `share`, what a reading counts.
        old: What was remembered.
        shaft: As the encoders have it.
        wrench: What the wall does to it.
        estimate: Of the fulcrum.
        permission: Of the wrist, which says when it probes.
    """
    load, gap, mismatch, silent = old.load, old.gap, old.mismatch, 0.0
    sound = finite_shaft(shaft) and finite_fulcrum(estimate)
    if sound and wrench.valid > 0.5 and finite_wrench(wrench):
        u, r = shaft.u, sub(estimate.p, shaft.p)
        f, depth = across(wrench.f, u), max(dot(u, r), c.least_depth)
        unexplained = along(f, -estimate.stiffness, across(r, u))
        unmatched = sub(f, over(cross(wrench.m, u), depth))
        load = along(load, c.share, sub(f, load))
        gap = along(gap, c.share, sub(unexplained, gap))
        mismatch = along(mismatch, c.share, sub(unmatched, mismatch))
    else:
        silent = old.silent + c.period
    if finite_permission(permission) and permission.code == _PROBES:
        told = Accuracy(
            0.0, _PROBING, norm(load), norm(gap), norm(mismatch), old.alarms
        )
        return State(_STILL, _STILL, _STILL, silent, 0.0, _PROBING, old.alarms), told
    sigma = estimate.sigma_across if sound else 0.0
    felt = State(load, gap, mismatch, silent, 0.0, 0.0, 0.0)
    doubt, calm, alarms = old.doubt, 0.0, old.alarms
    now = doubted(c, felt, sigma, 1.0)
    if now > 0.0:
        alarms += 1.0 if doubt == 0.0 or doubt == _PROBING else 0.0
        doubt = now
    elif doubt > 0.0 and doubted(c, felt, sigma, 0.5) == 0.0:
        calm = old.calm + c.period
        if calm >= c.calm:
            doubt = calm = 0.0
    accurate = 1.0 if doubt == 0.0 else 0.0
    told = Accuracy(accurate, doubt, norm(load), norm(gap), norm(mismatch), alarms)
    return State(load, gap, mismatch, silent, calm, doubt, alarms), told


class NavigationMonitor(StepBlock):
    """Says whether the navigation is accurate, from residual force and estimate.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench` that the estimate is made of.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`.

    Port ``permission`` accepts the passive wrist's `Permission`.

    Port ``accuracy`` emits the `Accuracy`.
    """

    def __init__(self, params: NavigationMonitorParams | None = None) -> None:
        """Makes the block; raises ParameterError for a value out of range."""
        super().__init__()
        params = check(params or NavigationMonitorParams())
        self.declare_step(
            judge,
            [packed(params, share=1.0 - exp(-params.period / params.smooth))],
            {
                "shaft": ShaftMotion,
                "wrench": Wrench,
                "estimate": Fulcrum,
                "permission": Permission,
            },
            State(_STILL, _STILL, _STILL, 0.0, 0.0, _UNSURE, 0.0),
            {"accuracy": Accuracy},
            params.period,
            timed=False,
        )

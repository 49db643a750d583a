"""The phases of an operation as a statechart: probe, approach, station, resect, ...

Each transition has its condition and its reason. The tool leaves the tube in one phase
alone, RESECT, which is entered through the gate: tube at its station, shaft unloaded,
fulcrum and organ known, everything calm for a while.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import across, along, norm, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Vector, finiteness
from systems.common.signals import Fulcrum, Permission, ShaftMotion, Wrench
from systems.common.step_block import StepBlock
from systems.common.stops import Code
from systems.keyhole.signals import BodyDeviation, Phase, SnakeStatus, TubeStatus
from systems.resection.wires.wire_watch import Alarm
from systems.sensing.organ_estimator import OrganMotion


class Phases(IntEnum):
    """Of an operation."""

    PROBE = 0
    APPROACH = 1
    STATION = 2
    RESECT = 3
    RETRACT = 4
    STOPPED = 5


class Reason(Code):
    """Why a phase was entered."""

    BEGIN = 0, "the operation begins"
    PROBED = 1, "the wall has been probed"
    ARRIVED = 2, "the tube is at its station"
    GATE = 3, "tube unloaded, fulcrum and organ known: the gate is open"
    DONE = 4, "the plan is done"
    ORGAN = 5, "the organ does not move as it did: a cough, a held breath"
    LOADED = 6, "the wall is loaded"
    SENSOR = 7, "the wrist does not permit motion"
    WIRE = 8, "a wire is slack"
    NUMBERS = 9, "an input is not a number"
    CALM = 10, "everything is calm again"
    GIVEN_UP = 11, "it does not become calm: the tool goes home"
    AWAY = 12, "the tube has left its station"
    TILTED = 13, "the tube's tilt and offset bend the snake's body off its plan"


@dataclass
class PhasesParams:
    """Conditions of the transitions."""

    near: float = parameter(
        1.5e-3, "distance of the tube from its station", "m", above=0.0, most=0.02
    )
    slow: float = parameter(
        5e-3, "its speed against the station", "m/s", above=0.0, most=0.1
    )
    far: float = parameter(
        8e-3, "distance at which it has left its station", "m", above=0.0, most=0.05
    )
    unloaded: float = parameter(
        0.3, "smoothed lateral force at the gate", "N", above=0.0, most=5.0
    )
    loaded: float = parameter(
        3.0, "smoothed lateral force that stops", "N", above=0.0, most=20.0
    )
    smooth: float = parameter(
        0.5, "time constant of the force", "s", above=0.0, most=10.0
    )
    sure_across: float = parameter(
        1e-3, "sigma of the fulcrum across the shaft", "m", above=0.0, most=0.02
    )
    sure_organ: float = parameter(
        3e-4, "sigma of the organ's motion", "m", above=0.0, most=0.02
    )
    deviation: float = parameter(
        1.5e-4, "of the snake's body from its plan", "m", above=0.0, most=0.1
    )
    calm: float = parameter(
        2.0, "how long all must hold at the gate", "s", least=0.0, most=60.0
    )
    patience: float = parameter(
        60.0, "how long it waits before the tool goes home", "s", above=0.0, most=1e4
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0.0, most=0.1)


class Chart(NamedTuple):
    """The statechart's memory: phase, its start and reason, calm so far, force."""

    code: float
    since: float
    reason: float
    calm: float
    force: Vector


finite_organ, finite_fulcrum = finiteness(OrganMotion), finiteness(Fulcrum)
finite_tube, finite_snake = finiteness(TubeStatus), finiteness(SnakeStatus)
finite_deviation = finiteness(BodyDeviation)
finite_alarm, finite_permission = finiteness(Alarm), finiteness(Permission)


@compiled
def fault(
    c: Any,
    chart: Chart,
    tube: TubeStatus,
    organ: OrganMotion,
    alarm: Alarm,
    permission: Permission,
    deviation: BodyDeviation,
) -> int:
    """The `Reason` to stop, or that of the beginning if there is none."""
    if alarm.time >= 0.0:
        return Reason.WIRE.value
    if organ.alarm != 0.0 or organ.sure == 0.0:
        return Reason.ORGAN.value
    if permission.speed_scale <= 0.0:
        return Reason.SENSOR.value
    if norm(chart.force) > c.loaded:
        return Reason.LOADED.value
    if deviation.distance > c.deviation:
        return Reason.TILTED.value
    return Reason.AWAY.value if tube.distance > c.far else Reason.BEGIN.value


@compiled
def is_calm(c: Any, chart: Chart, organ: OrganMotion, fulcrum: Fulcrum) -> bool:
    """Whether the gate may open: unloaded, fulcrum and organ known."""
    sure = fulcrum.sigma_across < c.sure_across and organ.sigma < c.sure_organ
    return norm(chart.force) < c.unloaded and organ.sure == 1.0 and sure


@compiled
def entered(chart: Chart, phase: int, time: float, reason: int) -> Chart:
    """The chart in another of the `Phases`, for a `Reason`."""
    return Chart(float(phase), time, float(reason), 0.0, chart.force)


@compiled
def step(
    c: Any,
    chart: Chart,
    time: float,
    tube: TubeStatus,
    snake: SnakeStatus,
    organ: OrganMotion,
    fulcrum: Fulcrum,
    shaft: ShaftMotion,
    wrench: Wrench,
    permission: Permission,
    alarm: Alarm,
    deviation: BodyDeviation,
) -> Chart:
    """One step of the statechart."""
    sound = finite_tube(tube) and finite_snake(snake) and finite_organ(organ)
    sound = sound and finite_fulcrum(fulcrum) and finite_permission(permission)
    if not (sound and finite_alarm(alarm) and finite_deviation(deviation)):
        if chart.code >= Phases.RETRACT.value:
            return Chart(chart.code, chart.since, chart.reason, 0.0, chart.force)
        return entered(chart, Phases.STOPPED.value, time, Reason.NUMBERS.value)
    force = chart.force
    if wrench.valid > 0.5:
        now = across(wrench.f, shaft.u)
        force = along(force, c.period / c.smooth, sub(now, force))
        if not norm(force) < 1e9:
            force = chart.force
    chart = Chart(chart.code, chart.since, chart.reason, chart.calm, force)
    why = fault(c, chart, tube, organ, alarm, permission, deviation)
    arrived = tube.distance < c.near and tube.speed < c.slow
    quiet = is_calm(c, chart, organ, fulcrum) and arrived and not why
    calm = chart.calm + c.period if quiet else 0.0
    chart = Chart(chart.code, chart.since, chart.reason, calm, force)
    code = chart.code
    if code == Phases.PROBE.value and permission.speed_scale > 0.0 and time > c.smooth:
        return entered(chart, Phases.APPROACH.value, time, Reason.PROBED.value)
    if code == Phases.APPROACH.value and arrived:
        return entered(chart, Phases.STATION.value, time, Reason.ARRIVED.value)
    if code == Phases.STATION.value and calm >= c.calm:
        return entered(chart, Phases.RESECT.value, time, Reason.GATE.value)
    if code == Phases.RESECT.value and why:
        return entered(chart, Phases.STOPPED.value, time, why)
    if code == Phases.RESECT.value and snake.left <= 0.0:
        return entered(chart, Phases.RETRACT.value, time, Reason.DONE.value)
    if code == Phases.STOPPED.value and calm >= c.calm:
        return entered(chart, Phases.RESECT.value, time, Reason.CALM.value)
    if code == Phases.STOPPED.value and time - chart.since > c.patience:
        return entered(chart, Phases.RETRACT.value, time, Reason.GIVEN_UP.value)
    return chart


@compiled
def _update(
    c: Any,
    phase: Phase,
    chart: Chart,
    time: float,
    tube: TubeStatus,
    snake: SnakeStatus,
    organ: OrganMotion,
    fulcrum: Fulcrum,
    shaft: ShaftMotion,
    wrench: Wrench,
    permission: Permission,
    alarm: Alarm,
    deviation: BodyDeviation,
) -> tuple[Phase, Chart]:
    chart = step(
        c,
        chart,
        time,
        tube,
        snake,
        organ,
        fulcrum,
        shaft,
        wrench,
        permission,
        alarm,
        deviation,
    )
    pace = permission.speed_scale if finite_permission(permission) else 0.0
    return Phase(chart.code, chart.since, chart.reason, pace), chart


class OperationPhases(StepBlock):
    """The statechart of an operation.

    Port ``tube`` accepts the `TubeStatus`.

    Port ``snake`` accepts the `SnakeStatus`.

    Port ``organ`` accepts the entry's `OrganMotion`.

    Port ``fulcrum`` accepts the estimated `Fulcrum`.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench`.

    Port ``permission`` accepts the passive wrist's `Permission`.

    Port ``alarm`` accepts the wires' `Alarm`.

    Port ``deviation`` accepts the snake's `BodyDeviation`.

    Port ``phase`` emits the `Phase`, from the next instant on.
    """

    def __init__(self, params: PhasesParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or PhasesParams())
        self.declare_update(
            _update,
            [packed(params)],
            {
                "tube": TubeStatus,
                "snake": SnakeStatus,
                "organ": OrganMotion,
                "fulcrum": Fulcrum,
                "shaft": ShaftMotion,
                "wrench": Wrench,
                "permission": Permission,
                "alarm": Alarm,
                "deviation": BodyDeviation,
            },
            {
                "phase": Phase(0.0, 0.0, 0.0, 0.0),
                "_chart": Chart(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)),
            },
            params.period,
        )

"""The statechart: each transition has its condition, and none is unsafe."""

from dataclasses import fields

import numpy as np
import pytest

from systems.common.compiled import packed
from systems.common.signal import example
from systems.common.signals import Fulcrum, Permission, ShaftMotion, Wrench
from systems.keyhole.phases import (
    Chart,
    Phases,
    PhasesParams,
    Reason,
    step,
)
from systems.keyhole.signals import BodyDeviation, SnakeStatus, TubeStatus
from systems.resection.wires.wire_watch import Alarm
from systems.sensing.organ_estimator import OrganMotion

PARAMS = PhasesParams(calm=1.0, patience=3.0)
C = packed(PARAMS)[0]
GOOD = {
    "tube": TubeStatus(0.0, 0.0),
    "snake": SnakeStatus(0.0, 0.0, 0.0, 0.0, 10.0, 0.0),
    "organ": OrganMotion((0.0, 0.0, -0.12), (0.0, 0.0, 0.0), 1e-4, 1.0, 0.0),
    "fulcrum": example(Fulcrum),
    "shaft": example(ShaftMotion),
    "wrench": example(Wrench)._replace(f=(0.0, 0.0, 0.0)),
    "permission": Permission(1.0, 0.0),
    "alarm": Alarm(-1.0, -1.0),
    "deviation": BodyDeviation(2e-5),
}
ORGAN = GOOD["organ"]
BAD = {
    "organ in alarm": ({"organ": ORGAN._replace(alarm=1.0)}, Reason.ORGAN),
    "organ not known": ({"organ": ORGAN._replace(sure=0.0)}, Reason.ORGAN),
    "wrist frozen": ({"permission": Permission(0.0, 8.0)}, Reason.SENSOR),
    "wire slack": ({"alarm": Alarm(1.0, 2.0)}, Reason.WIRE),
    "tube away": ({"tube": TubeStatus(0.02, 0.0)}, Reason.AWAY),
    "tube tilted": ({"deviation": BodyDeviation(3e-4)}, Reason.TILTED),
    "no number": ({"tube": TubeStatus(np.nan, 0.0)}, Reason.NUMBERS),
}
HINDERED = {
    **{name: change for name, (change, _) in BAD.items()},
    "organ unsure": {"organ": ORGAN._replace(sigma=2e-3)},
    "fulcrum unsure": {"fulcrum": example(Fulcrum)._replace(sigma_across=5e-3)},
    "loaded": {"wrench": example(Wrench)._replace(f=(1.0, 0.0, 0.0))},
    "tube fast": {"tube": TubeStatus(0.0, 0.05)},
}


def played(code: Phases, seconds: float, start: float = 10.0, **change) -> Chart:
    """The chart after some time with constant inputs."""
    told = {**GOOD, **change}
    chart = Chart(float(code), start, 0.0, 0.0, (0.0, 0.0, 0.0))
    for i in range(round(seconds * 120)):
        chart = step(C, chart, start + i / 120, *told.values())
    return chart


def test_the_gate_opens_only_when_all_is_known():
    chart = played(Phases.STATION, PARAMS.calm + 0.1)
    assert chart.code == Phases.RESECT and chart.reason == Reason.GATE
    assert played(Phases.STATION, PARAMS.calm - 0.1).code == Phases.STATION
    for change in HINDERED.values():
        assert played(Phases.STATION, 20.0, **change).code != Phases.RESECT


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_stops_the_tool_at_once(name):
    change, reason = BAD[name]
    chart = played(Phases.RESECT, 0.02, **change)
    assert chart.code == Phases.STOPPED and chart.reason == reason


def test_a_loaded_wall_stops_it_after_its_low_pass():
    push = {"wrench": example(Wrench)._replace(f=(4.0, 0.0, 0.0))}
    assert played(Phases.RESECT, 0.3, **push).code == Phases.RESECT
    chart = played(Phases.RESECT, 1.0, **push)
    assert chart.code == Phases.STOPPED and chart.reason == Reason.LOADED


def test_no_phase_is_entered_unsafely():
    """Whatever the inputs, the tool leaves the tube through the gate alone."""
    rng = np.random.default_rng(3)
    changes = [{}, *HINDERED.values()]
    allowed = {
        (Phases.PROBE, Phases.APPROACH),
        (Phases.APPROACH, Phases.STATION),
        (Phases.STATION, Phases.RESECT),
        (Phases.RESECT, Phases.STOPPED),
        (Phases.RESECT, Phases.RETRACT),
        (Phases.STOPPED, Phases.RESECT),
        (Phases.STOPPED, Phases.RETRACT),
    }
    broken = {(phase, Phases.STOPPED) for phase in Phases} - {
        (Phases.STOPPED, Phases.STOPPED)
    }
    seen = set()
    chart = Chart(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0))
    time = 0.0
    for _ in range(400):
        told = {**GOOD, **changes[int(rng.integers(len(changes)) * rng.integers(2))]}
        left = float(rng.choice([0.0, 10.0], p=[0.05, 0.95]))
        told["snake"] = told["snake"]._replace(left=left)
        for _ in range(int(rng.integers(1, 500))):
            after = step(C, chart, time, *told.values())
            time += 1 / 120
            if after.code != chart.code:
                pair = Phases(int(chart.code)), Phases(int(after.code))
                seen.add(pair)
                is_broken = not np.isfinite(told["tube"].distance)
                assert pair in (broken if is_broken else allowed)
                if pair[1] == Phases.RESECT:
                    assert chart.calm >= PARAMS.calm - 1 / 60
            chart = after
        if chart.code == Phases.RETRACT:
            chart = Chart(0.0, time, 0.0, 0.0, (0.0, 0.0, 0.0))
    assert allowed <= seen


def test_each_reason_has_a_text_and_parameters_their_bounds():
    assert len({reason.text for reason in Reason}) == len(Reason)
    assert all("parameter" in field.metadata for field in fields(PhasesParams))

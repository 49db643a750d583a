"""The emulation's law: through the fulcrum, within limits, safe."""

import numpy as np
import pytest

from systems.common.signals import (
    UNHINDERED,
    Fulcrum,
    Leeway,
    MovingPoint,
    ShaftMotion,
    ToolMotion,
    Wrench,
)
from systems.common.stops import Stop
from systems.passive_wrist.wrist_law import (
    DONE,
    FREEZES,
    FROZEN,
    PIVOT,
    SCALE,
    TIME,
    TIP,
    WristParams,
    command,
    constants,
    initial,
    next_state,
    permission,
)

DT = 1.0 / 120.0
STILL, DOWN = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
P_WP = (0.0, 0.0, -0.18)
SHAFT = ShaftMotion((0.0, 0.0, 0.22), DOWN, STILL, STILL)


def pivot(state) -> np.ndarray:
    return state[PIVOT : PIVOT + 3]


def tip(state) -> np.ndarray:
    return state[TIP : TIP + 3]


class Law:
    """The law with inputs by name, and sensible ones where none are given."""

    def __init__(self, **change) -> None:
        values = {"guess": [0.01, 0.0, 0.0], "probe": False} | change
        self.p = WristParams(**values)
        self.c = constants(self.p)[0]

    def steps(self, count: int, state=None, **change) -> np.ndarray:
        """The state after some updates."""
        state = initial(self.p) if state is None else state
        for _ in range(count):
            state = self.step(state, **change)
        return state

    def step(
        self,
        state,
        p_WP=P_WP,
        f=STILL,
        valid=1.0,
        p_WI=(0.003, 0.0, 0.0),
        v_WI=STILL,
        stiffness_sigma=0.05,
        sigma_along=1e-3,
        leeway=UNHINDERED,
    ) -> np.ndarray:
        """One update."""
        time = state[TIME] + DT
        known = [1e-4, sigma_along, 500.0, stiffness_sigma, 0.0, 2.0, 0.0, 0.0]
        return next_state(
            self.c,
            state,
            time,
            ToolMotion(p_WP, DOWN, STILL, STILL, time),
            SHAFT,
            Wrench(f, STILL, valid),
            Fulcrum(p_WI, v_WI, *known),
            MovingPoint(p_WI, v_WI),
            leeway,
        )

    def pose(self, state, v_WP=STILL) -> ToolMotion:
        """The commanded instrument."""
        return command(state, ToolMotion(STILL, STILL, v_WP, STILL, 0.0))


law = Law


def steps(dut: Law, count: int, state=None, **change) -> np.ndarray:
    return dut.steps(count, state, **change)


def test_shaft_points_from_tip_through_the_fulcrum():
    dut = law()
    pose = dut.pose(steps(dut, 1))
    np.testing.assert_allclose(pose.tip, P_WP)
    way = np.array(P_WP) - [0.003, 0.0, 0.0]
    np.testing.assert_allclose(pose.u, way / np.linalg.norm(way))
    np.testing.assert_allclose([pose.v, pose.du], 0.0, atol=1e-15)


def test_direction_turns_at_the_rate_of_tip_and_fulcrum():
    dut = law()
    v_P, v_I = (0.02, 0.01, 0.0), (0.0, 0.03, 0.01)
    state = steps(dut, 1, v_WI=v_I)
    np.testing.assert_allclose(pivot(state), [0.003, 0.0, 0.0], atol=1e-15)
    pose = dut.pose(state, v_P)
    small = 1e-6
    away = np.subtract(P_WP, [0.003, 0.0, 0.0]) + small * np.subtract(v_P, v_I)
    turned = away / np.linalg.norm(away)
    np.testing.assert_allclose((turned - pose.u) / small, pose.du, atol=1e-4)


def test_modes():
    off = pivot(steps(law(mode="off"), 1))
    np.testing.assert_array_equal(off, [0.01, 0.0, 0.0])
    spring = pivot(steps(law(mode="spring"), 200, f=(1.0, 0.0, 0.0)))
    # p_C + f / K, at the first guess's depth.
    np.testing.assert_allclose(spring, [1.0 / 2000.0, 0.0, 0.0], atol=1e-6)


def test_the_pivot_keeps_within_the_wrists_limits():
    dut = law(wrist_speed=0.25, wrist_acceleration=5.0)
    state = steps(dut, 1)
    ratio = 0.18 / 0.40  # fulcrum's travel for the wrist's, the tip held
    places = [pivot(state)[0]]
    for _ in range(60):
        state = dut.step(state, p_WI=(0.021, 0.0, 0.0))
        places.append(pivot(state)[0])
    v = np.diff(places) / DT
    assert v.max() <= 0.25 * ratio * 1.1
    assert np.diff(v).max() <= 5.0 * ratio * DT * 1.1
    assert places[-1] == pytest.approx(0.021, abs=1e-5)
    assert max(places) < 0.0225


def test_a_pivot_that_slides_follows_along_the_shaft_at_once():
    """And does not turn it: the tip stands below."""
    for slides in (True, False):
        dut = law(slides=slides, probe=False)
        first = steps(dut, 2, p_WI=(0.0, 0.0, 0.0))
        after = dut.step(first, p_WI=(0.0, 0.0, 0.04))
        assert (abs(pivot(after)[2] - 0.04) < 1e-9) == slides
        still = (0.0, 0.0, 0.0)
        turned = np.subtract(dut.pose(after, still).u, dut.pose(first, still).u)
        assert np.linalg.norm(turned) < 1e-9


def test_over_the_force_limit_the_task_freezes_and_the_pivot_does_not():
    dut = law()
    state = steps(dut, 30, f=(4.9, 0.0, 0.0))
    assert state[FROZEN] == 0.0
    state = steps(dut, 30, state, f=(5.1, 0.0, 0.0))  # 0.25 s
    assert state[FROZEN] == 0.0
    moved = {"p_WP": (0.01, 0.0, -0.18), "p_WI": (0.006, 0.0, 0.0)}
    state = steps(dut, 20, state, f=(5.1, 0.0, 0.0))
    assert state[FROZEN] == Stop.WALL_LOADED
    assert state[FREEZES] == 1.0 and state[SCALE] == 0.0
    assert permission(state) == (0.0, Stop.WALL_LOADED)
    state = steps(dut, 60, state, f=(5.1, 0.0, 0.0), **moved)
    np.testing.assert_array_equal(tip(state), P_WP)
    assert pivot(state)[0] == pytest.approx(0.006, abs=1e-4)
    state = steps(dut, 20, state, f=(0.5, 0.0, 0.0), **moved)
    assert state[FROZEN] != 0.0  # not yet calm for long enough
    state = steps(dut, 60, state, f=(0.5, 0.0, 0.0), **moved)
    assert state[FROZEN] == 0.0
    assert tip(state)[0] == pytest.approx(0.01, abs=1e-6)


def test_a_lost_sensor_stops_and_lets_go_again():
    dut = law()
    state = steps(dut, 3, valid=0.0)
    assert state[FROZEN] == 0.0
    state = steps(dut, 10, state, valid=0.0)
    assert state[FROZEN] == Stop.SENSOR_LOST
    assert steps(dut, 40, state)[FROZEN] == 0.0
    assert steps(dut, 10, state, f=(4.0, 0.0, 0.0))[FROZEN] == Stop.SENSOR_LOST
    assert steps(dut, 40, state, f=(4.0, 0.0, 0.0))[FROZEN] == 0.0


def test_an_estimate_that_is_no_number_counts_as_a_lost_sensor():
    dut = law()
    state = steps(dut, 3)
    before = pivot(state).copy()
    state = dut.step(state, p_WI=(np.nan, 0.0, 0.0))
    assert permission(state).speed_scale == 0.0
    state = steps(dut, 10, state, p_WI=(np.nan, 0.0, 0.0))
    assert state[FROZEN] == Stop.SENSOR_LOST
    assert np.isfinite(state).all()
    np.testing.assert_array_equal(pivot(state), before)
    assert steps(dut, 40, state)[FROZEN] == 0.0


def test_unsure_means_slow_and_never_still():
    dut = law()
    assert steps(dut, 1)[SCALE] == 1.0
    slow = steps(dut, 1, sigma_along=0.01)[SCALE]
    assert slow == pytest.approx(0.5, rel=0.02)
    assert steps(dut, 1, sigma_along=1.0)[SCALE] == dut.p.slowest


def test_the_probe_keeps_its_force_and_its_time():
    dut = law(probe=True)
    state, true, push = initial(dut.p), 500.0, []
    unsure = {"stiffness_sigma": 0.8, "p_WI": (0.0, 0.0, 0.0)}
    for _ in range(400):
        offset = pivot(state)[1]  # the probe moves along y, the shaft following at once
        state = dut.step(state, f=(0.0, -true * offset, 0.0), **unsure)
        push.append(true * abs(offset))
        if state[DONE]:
            break
    assert state[DONE] == 1.0
    assert 1.0 <= max(push) < 1.3
    assert len(push) * DT < 1.5 + 0.3
    assert push[-1] < 0.2


def probed(leeways) -> np.ndarray:
    """How far the probe has moved the pivot along its axis at each update, in m."""
    dut = law(probe=True)
    state, offsets = initial(dut.p), []
    unsure = {"stiffness_sigma": 0.8, "p_WI": (0.0, 0.0, 0.0)}
    for leeway in leeways:
        state = dut.step(state, leeway=leeway, **unsure)
        offsets.append(-pivot(state)[1])  # its first axis is -y here
    return np.array(offsets)


def test_the_probe_goes_no_faster_than_other_tools_allow():
    free = probed([Leeway(1.0, 1.0)] * 30)
    slow = probed([Leeway(0.01, 1.0)] * 30)
    assert 0.0 < slow.max() == pytest.approx(30 * DT * 0.01, rel=0.05)
    assert free.max() > 2.0 * slow.max()


def test_the_probe_turns_round_where_a_tool_is_in_its_way():
    offsets = probed([Leeway(0.0, 1.0)] * 60)
    assert offsets.max() == 0.0 and offsets.min() < -3e-3


def test_the_probe_ends_though_a_tool_has_come_into_its_way_back():
    offsets = probed([Leeway(1.0, 1.0)] * 150 + [Leeway(1.0, 0.0)] * 400)
    assert offsets.max() > 5e-3
    assert offsets[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mode": "pew"}, "passive_wrist.mode='pew': .*pwe, spring, off, known"),
        ({"force_limit": -1.0}, "force_limit=-1.0 N: expected > 0"),
        ({"force_limit": 1e3}, "force_limit=1000.0 N: .*<= 50; the default is 5"),
        ({"release_force": 6.0}, "release_force=6.0 N: expected at most force_limit"),
        ({"spring_stiffness": -300.0}, "spring_stiffness=-300.0"),
        ({"wrist_speed": float("nan")}, "wrist_speed=nan"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ValueError, match=message):
        law(**change)

"""Tests of the touch watch: a push is told from the wall by where it acts."""

import numpy as np
import pytest

from systems.common.geometry import cross
from systems.common.signal import example, flat, view
from systems.common.signals import Fulcrum, Guide, Permission, ShaftMotion, Wrench
from systems.common.stops import Stop
from systems.sensing.touch_watch import Touched, TouchWatch, TouchWatchParams

LENGTH, DEPTH = 0.4, 0.28
SHAFT = ShaftMotion(
    (0.0, 0.0, DEPTH), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
)
FOUND = example(Fulcrum)._replace(p=(0.0, 0.0, 0.0), sigma_ln_stiffness=0.05)
PERIOD = TouchWatchParams().period


FAR = example(Guide)._replace(rho=0.05)
BESIDE = FAR._replace(M_R=(0.0, 0.0, -0.045), rho=0.0055)


def after(rows, probing=False, found=FOUND, wall=None, guide=FAR):
    """The outputs after readings: pairs of a force in N and where it acts below S.

    Args:
        rows: The readings.
        probing: Whether the wrist does.
        found: What the estimator says, who follows what the wall does.
        wall: The wall's force beside that of each reading, N.
        guide: Where the tracker has a tool.
    """
    wall = np.zeros(len(rows)) if wall is None else wall
    dut = TouchWatch(TouchWatchParams(length=LENGTH))
    context = dut.CreateDefaultContext()
    code = float(Stop.PROBING) if probing else 0.0
    for name, value in (
        ("shaft", SHAFT),
        ("permission", Permission(1.0, code)),
        ("guide", guide),
    ):
        dut.GetInputPort(name).FixValue(context, flat(value))
    rng, told = np.random.default_rng(2), []
    for (force, below), borne in zip(rows, wall, strict=True):
        f = (force + borne, 0.0, 0.0)
        m = np.add(
            np.multiply(below, cross(SHAFT.u, (force, 0.0, 0.0))),
            np.multiply(DEPTH, cross(SHAFT.u, (borne, 0.0, 0.0))),
        )
        p = np.add(found.p, (borne / found.stiffness, 0.0, 0.0))
        follows = flat(found._replace(p=tuple(p)))
        dut.GetInputPort("estimate").FixValue(context, follows)
        noise = rng.normal(size=6) * np.repeat([0.05, 0.005], 3)
        read = np.array([*f, *m, 1.0])
        read[:6] += noise
        for name in ("wrench", "believed"):
            dut.GetInputPort(name).FixValue(context, read)
        out = [dut.GetOutputPort(n).Eval(context) for n in ("touch", "told", "wall")]
        told.append([out[0].copy(), out[1].copy(), out[2].copy()])
        update = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(update)
    return told


CALM = [(0.0, DEPTH)] * 120


def test_a_push_is_found_with_its_size_and_place():
    *_, (touch, told, wall) = after(CALM + [(1.5, DEPTH + 0.08)] * 60)
    said = view(Touched, touch)
    assert said.touched == 1.0
    assert said.f[0] == pytest.approx(1.5, abs=0.1)
    assert said.share == pytest.approx(0.08 / (LENGTH - DEPTH), abs=0.1)
    assert view(Wrench, told).valid == 0.0  # the estimator predicts
    assert np.linalg.norm(view(Wrench, wall).f) < 0.3


def test_it_is_found_within_a_tenth_of_a_second_and_over_as_soon():
    rows = after(CALM + [(1.5, DEPTH + 0.08)] * 60 + CALM)
    touched = np.array([view(Touched, row[0]).touched for row in rows])
    first = int(touched.argmax())
    assert len(CALM) < first < len(CALM) + 0.1 / PERIOD
    assert touched[first : len(CALM) + 60].all()
    assert not touched[len(CALM) + 60 + int(0.3 / PERIOD) :].any()


def test_a_wall_that_jumps_is_no_push_and_the_estimator_is_told_of_it():
    rows = after(CALM + [(3.0, DEPTH)] * 60)
    assert not any(view(Touched, row[0]).touched for row in rows)
    assert view(Wrench, rows[-1][1]).f[0] > 2.5
    waited = [view(Wrench, row[1]).valid for row in rows[len(CALM) :]].index(1.0)
    assert waited * PERIOD < 0.1


def test_noise_alone_is_no_push():
    rows = after([(0.0, DEPTH)] * 3000)
    assert not any(view(Touched, row[0]).touched for row in rows)


def test_a_wall_that_breathes_is_no_push_though_its_depth_is_wrong():
    rows = after(
        [(0.0, DEPTH)] * 1200,
        found=FOUND._replace(p=(0.0, 0.0, 0.015), sigma_along=0.01),
        wall=0.3 * np.sin(2.0 * np.pi * 0.25 * PERIOD * np.arange(1200)),
    )
    assert not any(view(Touched, row[0]).touched for row in rows)
    heard = [view(Wrench, row[1]).valid for row in rows]
    assert np.mean(heard) > 0.95


def test_what_the_wall_does_meanwhile_is_told_apart_by_the_moment():
    rows = CALM + [(1.5, DEPTH + 0.08)] * 120
    borne = np.r_[np.zeros(150), np.linspace(0.0, 1.0, 60), np.ones(30)]
    rows = after(rows, found=FOUND._replace(sigma_across=2e-3), wall=borne)[-20:]
    assert all(view(Touched, row[0]).touched for row in rows)
    told = np.mean([row[1] for row in rows], axis=0)
    assert view(Wrench, told).valid == 1.0
    assert view(Wrench, told).f[0] == pytest.approx(1.0, abs=0.2)
    lever = view(Wrench, told).m[1] / view(Wrench, told).f[0]
    assert abs(lever) == pytest.approx(DEPTH, abs=0.02)


@pytest.mark.parametrize(("guide", "felt"), [(BESIDE, True), (FAR, False)])
def test_a_push_that_the_wall_bears_is_felt_where_a_tool_was_seen(guide, felt):
    """The wrist has unloaded the sum of both: no force is left, but its moment."""
    rows = CALM + [(0.8, DEPTH + 0.045)] * 60
    borne = np.r_[np.zeros(120), np.full(60, -0.8)]
    rows = after(rows, wall=borne, guide=guide)
    touched = [view(Touched, row[0]).touched for row in rows]
    assert not any(touched[:120])
    assert any(touched[120:132]) == felt
    if felt:
        said = view(Touched, rows[-1][0])
        assert said.f[0] == pytest.approx(0.8, abs=0.15)
        assert said.share == pytest.approx(0.045 / (LENGTH - DEPTH), abs=0.02)


def test_a_tool_that_stands_beside_the_shaft_does_not_push():
    """Though the wall breathes, and the fulcrum's depth is wrong."""
    n = round(10.0 / PERIOD)
    rows = after(
        [(0.0, DEPTH)] * n,
        found=FOUND._replace(p=(0.0, 0.0, 0.015), sigma_along=0.01),
        wall=0.3 * np.sin(2.0 * np.pi * 0.25 * PERIOD * np.arange(n)),
        guide=BESIDE,
    )
    assert not any(view(Touched, row[0]).touched for row in rows)


def test_next_to_the_trocar_it_is_the_walls():
    rows = after(CALM + [(1.5, DEPTH + 0.005)] * 60)
    assert not any(view(Touched, row[0]).touched for row in rows)


def test_while_the_wrist_probes_nothing_is_known():
    rows = after(CALM + [(1.5, DEPTH + 0.08)] * 60, probing=True)
    assert not any(view(Touched, row[0]).touched for row in rows)
    assert all(view(Wrench, row[1]).valid for row in rows)

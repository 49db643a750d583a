"""Every point that the trocar allows is reached, far from the joints' limits."""

import math

import numpy as np
import pytest

from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import POSITION_LIMIT, READY_POSTURE
from plants.arm.posture import home_posture


@pytest.fixture(scope="module")
def reach():
    """Solves for a tip, and returns the posture and the shaft it gives."""
    plant = make_controller_plant()
    context = plant.CreateDefaultContext()
    arm = plant.GetModelInstanceByName("pa10")
    tip = plant.GetFrameByName(INSTRUMENT_TIP)

    def solve(p_WG, p_WP):
        q = home_posture(plant, arm, tip, p_WG, p_WP)
        plant.SetPositions(context, q)
        X_WT = tip.CalcPoseInWorld(context)
        return q, X_WT.translation(), X_WT.rotation().col(2)

    return solve


def cone_points():
    """The corners of the cone of +-35 deg, 60 to 180 mm, and points inside."""
    rng = np.random.default_rng(0)
    corners = [(35.0, turn, d) for turn in range(0, 360, 45) for d in (0.06, 0.18)]
    inside = zip(
        rng.uniform(0.0, 35.0, 24),
        rng.uniform(0.0, 360.0, 24),
        rng.uniform(0.06, 0.18, 24),
        strict=True,
    )
    for angle, turn, depth in [*corners, *inside]:
        a, t = math.radians(angle), math.radians(turn)
        sine = math.sin(a)
        yield depth * np.array([sine * math.cos(t), sine * math.sin(t), -math.cos(a)])


@pytest.mark.parametrize("p_WG", [(0.0, 0.0, 0.0), (-0.04, 0.05, 0.0)])
def test_whole_cone_is_reached_through_the_fulcrum(reach, p_WG):
    margin = math.inf
    for inside in cone_points():
        target = np.array(p_WG) + inside
        q, p, u = reach(p_WG, target)
        np.testing.assert_allclose(p, target, atol=1e-7)
        assert np.linalg.norm(np.cross(u, target - p_WG)) < 1e-7
        assert u[2] < 0.0
        margin = min(margin, (POSITION_LIMIT - np.abs(q)).min())
    assert math.degrees(margin) > 5.0


def test_ready_posture_hangs_through_the_origin(reach):
    q, _, _ = reach((0.0, 0.0, 0.0), (0.0, 0.0, -0.12))
    np.testing.assert_allclose(q, READY_POSTURE, atol=1e-4)


def test_out_of_reach_is_said(reach):
    with pytest.raises(ValueError, match="no posture puts the tip at"):
        reach((0.6, 0.0, 0.0), (0.6, 0.0, -0.1))


def test_tip_at_the_fulcrum_is_refused(reach):
    with pytest.raises(ValueError, match="is at the fulcrum"):
        reach((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

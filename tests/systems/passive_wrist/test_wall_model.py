"""The wall as the sensor sees it, against vector algebra."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from systems.common.geometry import dot
from systems.common.signal import vector
from systems.passive_wrist.fulcrum_kernels import lateral_slope
from systems.passive_wrist.wall_model import lateral_basis

unit = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=50, deadline=None)
@given(unit)
def test_basis_is_right_handed_and_across(v):
    u = np.array(v) / np.linalg.norm(v)
    e1, e2 = lateral_basis(vector(u))
    R = np.array([e1, e2, u])
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) > 0.0
    assert dot(e1, e2) == pytest.approx(0.0, abs=1e-12)


def lateral(p_WI, p_WS, u, e1, e2, stiffness):
    """(f1, f2, m1, m2) straight from the definition of the spring."""
    r = p_WI - p_WS
    depth = u @ r
    f = stiffness * (r - depth * u)
    m = depth * np.cross(u, f)
    return np.array([f @ e1, f @ e2, m @ e1, m @ e2])


def test_jacobian_is_the_slope():
    rng = np.random.default_rng(3)
    for _ in range(10):
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        p_WS = rng.normal(size=3)
        p_WI = p_WS + 0.2 * u + 0.01 * rng.normal(size=3)
        e1, e2 = lateral_basis(vector(u))
        f1, f2, *_ = lateral(p_WI, p_WS, u, e1, e2, 700.0)
        J = lateral_slope(f1, f2, u @ (p_WI - p_WS), vector(u), e1, e2, 700.0)
        step = 1e-6
        slope = np.column_stack(
            [
                (
                    lateral(p_WI + step * d, p_WS, u, e1, e2, 700.0)
                    - lateral(p_WI - step * d, p_WS, u, e1, e2, 700.0)
                )
                / (2.0 * step)
                for d in np.eye(3)
            ]
        )
        np.testing.assert_allclose(J, slope, rtol=1e-5, atol=1e-5)

"""The tissue's force told from the wall's."""

import numpy as np
import pytest

from systems.sensing.tissue_force import tissue_force

P_S, P_I, P_P = (0.0, 0.05, 0.25), (0.001, -0.002, 0.0), (0.02, 0.02, -0.09)
N = (0.5, 0.1, 0.86)


def felt(force: float, wall: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Force, and moment about S, of the tissue along N and of the wall in I."""
    n = np.array(N) / np.linalg.norm(N)
    arms = np.subtract(P_P, P_S), np.subtract(P_I, P_S)
    moment = np.cross(arms[0], force * n) + np.cross(arms[1], wall)
    return force * n + wall, moment


@pytest.mark.parametrize("wall", [(0.0, 0.0, 0.0), (1.5, -0.8, 0.0), (0.1, 0.1, 0.5)])
def test_wall_and_friction_do_not_count(wall):
    f, m = felt(0.5, wall)
    n = tuple((np.array(N) / np.linalg.norm(N)).tolist())
    force, lever = tissue_force(tuple(m), tuple(f), P_S, P_I, P_P, n)
    assert force == pytest.approx(0.5)
    assert lever > 0.03


def test_along_the_shaft_there_is_no_lever():
    axis = np.subtract(P_P, P_I)
    n = tuple((axis / np.linalg.norm(axis)).tolist())
    f, m = felt(0.5, (0.0, 0.0, 0.0))
    _, lever = tissue_force(tuple(m), tuple(f), P_S, P_I, P_P, n)
    assert lever == pytest.approx(0.0, abs=1e-9)

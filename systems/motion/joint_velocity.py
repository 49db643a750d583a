"""Joint velocities that move the tool: a quadratic program within bounds.

Mostly its free minimum keeps the bounds, and then it is the solution; where it does
not, quadprog's exact solver is asked. (Drake's own DoDifferentialInverseKinematics
gives the same velocities and takes many times as long; the tests hold the two against
each other.)
"""

import numpy as np
import quadprog

from systems.common.compiled import compiled
from systems.common.elimination import solve_positive

_BOUNDS = np.hstack([np.eye(7), -np.eye(7)])
_LITTLE = 1e-6
"""Weight of the centering against the tool's motion: the arm's spare joint alone."""


@compiled
def product(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x; for 6 x 7 numbers several times faster than a call into BLAS."""
    result = np.zeros(len(A))
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            result[i] += A[i, j] * x[j]
    return result


@compiled
def free_velocity(J: np.ndarray, V: np.ndarray, v_nominal: np.ndarray) -> np.ndarray:
    """Joint velocities that move the tool, without bounds, see `joint_velocity`.

    v = v_nominal + J' (J J' + 1e-6)^-1 (V - J v_nominal).
    """
    n = len(J)
    A = np.zeros((n, n))
    for i in range(n):
        A[i] = product(J, J[i])
        A[i, i] += _LITTLE
    rest = solve_positive(A, V - product(J, v_nominal))
    return v_nominal + product(J.T, rest)


def joint_velocity(
    J: np.ndarray,
    V: np.ndarray,
    v_nominal: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """Joint velocities that move the tool, within bounds.

    Solves min |J v - V|^2 + 1e-6 |v - v_nominal|^2, low <= v <= high.

    Args:
        J: Jacobian of the tool (6 x 7).
        V: Its wanted spatial velocity (6) [rad/s, m/s].
        v_nominal: Where the spare joint drifts to (7) [rad/s].
        low: Lower bounds (7) [rad/s].
        high: Upper bounds (7) [rad/s]. Where a joint stands beyond its end stop,
            the bounds lead it back.

    Returns:
        v (7) [rad/s].
    """
    G = J.T @ J
    G.flat[::8] += _LITTLE
    low = np.minimum(low, high)
    bounds = np.concatenate([low, -high])
    return quadprog.solve_qp(G, V @ J + _LITTLE * v_nominal, _BOUNDS, bounds)[0]

"""Linear equations of few unknowns, for which a call of LAPACK costs more."""

from typing import Any

from systems.common.compiled import compiled


@compiled
def solve_positive(A: Any, b: Any) -> Any:
    """Solves A x = b into b, without pivots; A is destroyed."""
    n = len(b)
    for k in range(n):
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= factor * A[k, j]
            b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return b

"""A step with friction in a few steps of Newton's: tensions and bounds at once.

`equilibrium.slid` fixes what friction can hold, goes downhill, and repeats. Near the
end of a step one can do better. Over ball i, with x_i = tanh(mu theta_i / 2) s_i and
s_i the share of `give` by which the wire has slipped, in [-1, 1],

    T_i = T_(i-1) (1 + x_i) / (1 - x_i),   P_i = T_(i-1) / (1 - x_i) = c_i T,

and a socket's torque is mu_b R sum P: both follow the tension T at the drum, of which
dT = k J_w. The Hessian at fixed bounds, and k (sum_i (c_i - 1) J_wi + sockets) J_w
beside it, is the derivative of all torques but for that of theta and the bows. It is
not symmetric, for friction has no energy, so it is trusted only where it converges.
"""

import math
from typing import Any

import numpy as np

from plants.snake.balls import BALLS, TURNS, turned_by
from plants.snake.friction import turning
from plants.snake.parameters import WIRES
from plants.snake.statics_kernels import ROPES, Forces, Grip, assembled, sliding_axis
from systems.common.compiled import compiled
from systems.common.elimination import solve_positive


@compiled
def _followed(
    turns: Any, stiffness: float, s: Any, grip: Grip, to: Forces, K: Any
) -> None:
    """Bounds as the tensions have them; corrects torques to.g, and adds to K."""
    U = np.zeros((TURNS, ROPES))
    loads, shares = np.zeros(BALLS), np.zeros((BALLS, ROPES))
    for w in range(ROPES):
        T, c = max(to.T[w], 0.0), 1.0
        k = stiffness if to.T[w] > s.pretension else 0.0
        for i in range(2 * (w // WIRES + 1)):
            grasp = math.tanh(0.5 * s.wire * turning(turns[i], w, s))
            x = grasp * min(max(to.slip[i, w] / s.give, -1.0), 1.0)
            near = c / (1 - x)
            P = near * T
            for a in range(3 * i, 3 * i + 3):
                to.g[a] += (P - to.P[i, w]) * to.J[w, a]
                U[a, w] += k * (near - 1.0) * to.J[w, a]
            to.P[i, w], grip.most[i, w] = P, 2 * grasp * P
            loads[i] += P
            shares[i, w] = k * near
            c *= (1 + x) / (1 - x)
    for i in range(BALLS):
        torque = s.socket * s.R * loads[i]
        axis = sliding_axis(i, turns[i], s, grip, to)
        for a in range(3):
            to.g[3 * i + a] += (torque - grip.socket[i]) * axis[a]
            for w in range(ROPES):
                U[3 * i + a, w] += s.socket * s.R * axis[a] * shares[i, w]
        grip.socket[i] = torque
    for a in range(TURNS):
        for b in range(TURNS):
            K[a, b] = to.H[a, b]
            for w in range(WIRES * (b // (3 * 2)), ROPES):
                K[a, b] += U[a, w] * to.J[w, b]


@compiled
def quickly(
    start: Any,
    pull: Any,
    stiffness: float,
    wound: Any,
    load: Any,
    s: Any,
    grip: Grip,
    to: Forces,
    tolerance: float,
    most: int,
) -> tuple[Any, int, bool]:
    """The end of a step, if it is near enough.

    Args:
        start: Turns from which it is looked for.
        pull: As of `assembled`, and so on.
        stiffness: Of a wire.
        wound: L_d.
        load: On the tool.
        s: The snake.
        grip: What friction holds on to; the bounds in it are the end's.
        to: The forces there.
        tolerance: Of the torques that are left, in Nm.
        most: Iterations.

    Returns:
        Turns, iterations, and whether it was reached.
    """
    now, new = start.copy(), start.copy()
    K, step = np.empty((TURNS, TURNS)), np.empty(TURNS)
    before = math.inf
    for count in range(most):
        assembled(now, pull, stiffness, wound, load, s, grip, to)
        _followed(now, stiffness, s, grip, to, K)
        left = np.abs(to.g).max()
        if left < tolerance:
            return now, count, True
        if not left < before:
            break
        before = left
        step[:] = -to.g
        solve_positive(K, step)  # as good as positive
        turned_by(now, step, new)
        now, new = new, now
    return start, most, False

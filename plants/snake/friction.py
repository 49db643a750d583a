"""Friction of wires over balls and through holes, and of balls in their sockets.

Both have a memory. Over ball i wire w pulls with T_(i-1) on one side and T_i on the
other, mean P_i; turning by theta_i in all (hole, ball, hole) it slides once they
differ as on a capstan, T_i = T_(i-1) exp(+-mu theta_i), which is

    |T_i - T_(i-1)| = 2 tanh(mu theta_i / 2) P_i.

A socket slides once the torque on it is mu_b R sum P, of all wires over the ball.
Until then either gives way elastically by some micrometres. Each is a term in the
energy of a step, so that the snake goes downhill and never gains energy; P in the
bounds is the step's own, found by repetition.
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from plants.snake.balls import BALLS, TURNS, times
from plants.snake.parameters import WIRES
from plants.snake.statics_kernels import ROPES, Forces, Grip, sine_of
from systems.common.compiled import compiled
from systems.common.geometry import norm
from systems.common.parameter import parameter


@dataclass
class SnakeFrictionParams:
    """Coulomb friction of wires and sockets; steel on titanium has 0.1 to 0.3.

    No measured one of a wire over balls was found: these are assumed.
    """

    wire: float = parameter(0.0, "mu, of wires on balls and holes", least=0.0, most=1.0)
    socket: float = parameter(0.0, "mu_b, of balls in sockets", least=0.0, most=1.0)
    give: float = parameter(
        3.0e-6, "by which either gives way before it slides", "m", least=1e-7, most=1e-4
    )


@compiled
def turning(Q: Any, w: int, s: Any) -> float:
    """By how much wire w turns at a ball that turns by Q: hole, ball and hole."""
    x, y, d = s.points[w, 0], s.points[w, 1], s.d
    rho2 = s.R * s.R + d * d
    far = Q[2, 0] * x + Q[2, 1] * y + Q[2, 2] * d  # of R c, along the near plate's axis
    near = Q[0, 2] * x + Q[1, 2] * y - Q[2, 2] * d  # of P, along the far plate's
    rc = (Q[0, 0] * x + Q[1, 0] * y - Q[2, 0] * d) * x
    rc += (Q[0, 1] * x + Q[1, 1] * y - Q[2, 1] * d) * y + near * d
    cosine = min(max(rc / rho2, -1.0), 1.0)
    sine = max(math.sqrt(1 - cosine * cosine), 1e-9)
    between = math.acos(cosine)
    # Seen from the centre: from a hole to where the wire touches, or to its middle.
    free = min(math.atan(d / s.R), between / 2)
    total = between - 2 * free
    for z in (far, -near):
        along = d * math.sin(free) + math.cos(free) * (z + cosine * d) / sine
        total += math.acos(min(max(along / math.sqrt(rho2), -1.0), 1.0))
    return total


@compiled
def bound(turns: Any, to: Forces, s: Any, grip: Grip) -> float:
    """Sets what friction can hold at these tensions; the largest change in N."""
    change = 0.0
    for i in range(BALLS):
        total = 0.0
        for w in range(WIRES * (i // 2), ROPES):
            P = max(to.P[i, w], 0.0)
            total += P
            if s.wire > 0.0:
                most = 2 * math.tanh(0.5 * s.wire * turning(turns[i], w, s)) * P
                change = max(change, abs(most - grip.most[i, w]))
                grip.most[i, w] = most
        torque = s.socket * s.R * total
        change = max(change, abs(torque - grip.socket[i]) / s.R)
        grip.socket[i] = torque
    return change


@compiled
def remembered(turns: Any, to: Forces, s: Any, grip: Grip) -> float:
    """Takes over where wires and sockets slid to; the work that became heat, in J."""
    heat = 0.0
    B = np.empty((3, 3))
    for i in range(BALLS):
        times(grip.turns[i].T, turns[i], B)
        sine = sine_of(B)
        for k in range(3):
            grip.step[3 * i + k] = sine[k] if s.wire + s.socket > 0.0 else 0.0
        for w in range(WIRES * (i // 2), ROPES):
            over = abs(to.slip[i, w]) - s.give
            if over > 0.0:
                grip.slip[i, w] -= math.copysign(over, to.slip[i, w])
                heat += grip.most[i, w] * over
        size = norm((to.strain[i, 0], to.strain[i, 1], to.strain[i, 2]))
        most = s.give / s.R
        if size > most:
            heat += grip.socket[i] * (size - most)
        for k in range(3):
            grip.strain[i, k] = to.strain[i, k] * min(1.0, most / max(size, 1e-300))
    grip.turns[:] = turns
    return heat


SHAPES = ((BALLS, 3, 3), (BALLS, ROPES), (BALLS, ROPES), (BALLS,), (BALLS, 3), (TURNS,))
"""Of a `Grip`'s parts."""
GRIP = sum(map(math.prod, SHAPES))
"""Numbers in a grip."""


@compiled
def flat_grip(grip: Grip) -> Any:
    """A grip as a block keeps it, (204,)."""
    return np.concatenate(
        (
            grip.turns.ravel(),
            grip.most.ravel(),
            grip.slip.ravel(),
            grip.socket,
            grip.strain.ravel(),
            grip.step,
        )
    )


@compiled
def grip_of(values: Any) -> Grip:
    """And back, as arrays of its own."""
    a, b = 9 * BALLS, BALLS * ROPES
    c = a + 2 * b + BALLS
    return Grip(
        values[:a].copy().reshape((BALLS, 3, 3)),
        values[a : a + b].copy().reshape((BALLS, ROPES)),
        values[a + b : a + 2 * b].copy().reshape((BALLS, ROPES)),
        values[a + 2 * b : c].copy(),
        values[c : c + 3 * BALLS].copy().reshape((BALLS, 3)),
        values[c + 3 * BALLS :].copy(),
    )

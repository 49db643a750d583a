"""Where the snake stays, compiled: Newton's method downhill, and steps with friction.

See `statics`, whose energy it is, and `friction`.
"""

import math
from typing import Any

import numpy as np

from plants.snake.balls import TURNS, turned_by
from plants.snake.friction import bound, flat_grip, grip_of, remembered
from plants.snake.parameters import MODULES
from plants.snake.sliding import quickly
from plants.snake.statics_kernels import (
    ROPES,
    Forces,
    Grip,
    assembled,
    empty_forces,
)
from systems.common.compiled import compiled

TOLERANCE = 1e-10
"""Of the torques that are left in an equilibrium, in Nm."""
LONGEST = 0.3
"""Step of a ball in an iteration, in rad."""
MOST = 60
"""Iterations."""
AT_ONCE = 1
"""Iterations in which what friction can hold stays as it is."""
PATIENT = 5
"""The same where that does not converge."""
NEAR = 1e-9
"""As `TOLERANCE`, of a step with friction: what `BOUNDED` leaves is 30 times that."""
QUICK = 8
"""Iterations in which a step is tried to be found at once (`sliding`)."""
BOUNDED = 1e-5
"""Change of what friction can hold at which a step is done, in N."""
STEPS = 16
"""In which a period is gone through again to see whether the snake buckles."""


@compiled
def _reduced(to: Forces, s: Any, g: Any, H: Any) -> None:
    """Gradient and Hessian of the freedoms there are: coupled balls turn alike."""
    if not s.coupled:
        g[:], H[:] = to.g, to.H
        return
    for i in range(3 * MODULES):
        a = 6 * (i // 3) + i % 3
        g[i] = (to.g[a] + to.g[a + 3]) / math.sqrt(2.0)
        for j in range(3 * MODULES):
            b = 6 * (j // 3) + j % 3
            H[i, j] = to.H[a, b] + to.H[a + 3, b] + to.H[a, b + 3] + to.H[a + 3, b + 3]
            H[i, j] *= 0.5


@compiled
def _expanded(step: Any, s: Any, delta: Any) -> None:
    if not s.coupled:
        delta[:] = step
        return
    for i in range(3 * MODULES):
        a = 6 * (i // 3) + i % 3
        delta[a] = delta[a + 3] = step[i] / math.sqrt(2.0)


@compiled
def _factored(H: Any, shift: float, U: Any) -> bool:
    """Lower Cholesky factor of H + shift I, and whether there is one."""
    n = len(H)
    for j in range(n):
        for i in range(j, n):
            total = H[i, j] + (shift if i == j else 0.0)
            for k in range(j):
                total -= U[i, k] * U[j, k]
            if i == j:
                if not total > 1e-9:
                    return False
                U[j, j] = math.sqrt(total)
            else:
                U[i, j] = total / U[j, j]
    return True


@compiled
def _descent(g: Any, H: Any, U: Any, step: Any) -> bool:
    """A Newton step; whether the Hessian had to be lifted to be positive."""
    shift = 0.0
    while not _factored(H, shift, U):
        shift = max(2e-3, 3 * shift)
        if not shift < 1e9:  # it has no finite value
            step[:] = 0.0
            return True
    n = len(g)
    for i in range(n):
        total = -g[i]
        for k in range(i):
            total -= U[i, k] * step[k]
        step[i] = total / U[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= U[k, i] * step[k]
        step[i] = total / U[i, i]
    return shift > 0.0


@compiled
def settled(
    start: Any,
    pull: Any,
    stiffness: float,
    wound: Any,
    load: Any,
    s: Any,
    grip: Grip,
    most: int,
) -> tuple[Any, Forces, int, bool, bool]:
    """The equilibrium that is downhill from a start: Newton's method with a search.

    Returns:
        Turns, forces there, iterations, whether the torques that are left are below
        `TOLERANCE`, and whether the way led over a Hessian that is not positive.
    """
    n = 3 * MODULES if s.coupled else TURNS
    now, new = start.copy(), start.copy()
    here, there = empty_forces(), empty_forces()
    g, H, U, step = np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    delta = np.zeros(TURNS)
    energy = assembled(now, pull, stiffness, wound, load, s, grip, here)
    has_moment = load[3] != 0.0 or load[4] != 0.0 or load[5] != 0.0
    done = left_it = False
    count = 0
    for count in range(most + 1):
        _reduced(here, s, g, H)
        left = np.abs(g).max()
        done = left < TOLERANCE
        if done or count == most or not math.isfinite(left):
            break
        left_it = _descent(g, H, U, step) or left_it
        size = np.abs(step).max()
        share = 1.0 if size <= LONGEST else LONGEST / size
        slope = 0.0
        for a in range(n):
            slope += g[a] * step[a]
        better = False
        for _ in range(25):
            _expanded(step * share, s, delta)
            turned_by(now, delta, new)
            e = assembled(new, pull, stiffness, wound, load, s, grip, there)
            # Below rounding, and of a moment, the energy tells nothing; torques do.
            if has_moment or abs(e - energy) < 1e-13 * (1e-3 + abs(energy)):
                _reduced(there, s, g, H)
                better = np.abs(g).max() < left
            if not has_moment:
                better = better or e <= energy + 1e-4 * share * slope
            if better:
                break
            share *= 0.4
        if not better:
            break
        now, new = new, now
        here, there = there, here
        energy = e
    return now, here, count, done, left_it


@compiled
def slid(
    start: Any,
    pull: Any,
    stiffness: float,
    wound: Any,
    load: Any,
    s: Any,
    grip: Grip,
    most: int,
) -> tuple[Any, Forces, Any, int, bool, bool, float]:
    """The equilibrium after a step in which wires and sockets may slide.

    Args:
        start: Turns from which it is looked for.
        pull: As of `assembled`, and so on.
        stiffness: Of a wire.
        wound: L_d.
        load: On the tool.
        s: The snake.
        grip: What friction holds on to, and will after the step.
        most: Iterations.

    Returns:
        Turns, forces, the Hessian of a further step, iterations, whether it is in
        balance, whether it left a state that it could not stay in, and the heat in J.
    """
    n = 3 * MODULES if s.coupled else TURNS
    g, H = np.empty(n), np.empty((n, n))
    rough = s.wire + s.socket > 0.0
    if rough and not s.coupled:
        tried, to = grip_of(flat_grip(grip)), empty_forces()
        now, total, done = quickly(
            start, pull, stiffness, wound, load, s, tried, to, NEAR, QUICK
        )
        if done and _factored(to.H, 0.0, H):
            grip.most[:], grip.socket[:] = tried.most, tried.socket
            heat = remembered(now, to, s, grip)
            return now, to, to.H, total, done, False, heat
    spent, lost, done = 0, False, False
    for at_once in (AT_ONCE, PATIENT) if rough else (most, 0):
        if done or at_once == 0:
            break
        now, total = start, 0
        for _ in range(most + 1):
            now, to, count, done, left = settled(
                now, pull, stiffness, wound, load, s, grip, min(at_once, most - total)
            )
            total, lost = total + count, lost or left
            stuck = count == 0 and not done
            if (bound(now, to, s, grip) < BOUNDED and done) or stuck or total >= most:
                break
        spent += total
    heat = remembered(now, to, s, grip)
    _reduced(to, s, g, H)
    return now, to, H, spent, done, lost, heat


@compiled
def ahead(values: Any) -> Any:
    """Where the balls of a flat grip will be if they turn as in the last step."""
    grip = grip_of(values)
    turns = np.empty_like(grip.turns)
    turned_by(grip.turns, grip.step, turns)
    return turns


@compiled
def followed(
    values: Any, start: Any, stiffness: float, wound: Any, load: Any, s: Any
) -> tuple[Any, Any]:
    """As `held`, looked for from `start`: R_i and the flat grip alone."""
    grip = grip_of(values)
    none = np.zeros(ROPES)
    now = slid(start, none, stiffness, wound, load, s, grip, MOST)[0]
    return now, flat_grip(grip)


@compiled
def held(
    values: Any, start: Any, stiffness: float, wound: Any, load: Any, s: Any
) -> tuple[Any, Any, Any, float, Any, bool, bool]:
    """A step of a snake that a flat grip holds, to what wires and load will be.

    Args:
        values: What friction holds on to, (204,).
        start: R_i from which it is looked for, (6, 3, 3).
        stiffness: Of a wire in N/m.
        wound: L_d in m, (9,).
        load: Force and moment on the tool in W, (6,).
        s: The snake, as `Statics` packs it.

    Returns:
        R_i (6, 3, 3), tensions (9,), P (6, 9), the least eigenvalue of a further
        step's Hessian, the flat grip after it, whether the search led over states in
        which it could not stay, and whether the posture is lost: out of balance or
        unstable. What ends in no number leaves the snake where it was.
    """
    grip, none = grip_of(values), np.zeros(ROPES)
    before = grip.turns.copy()
    now, to, H, _, done, astray, _ = slid(
        start, none, stiffness, wound, load, s, grip, MOST
    )
    after, least = flat_grip(grip), math.nan
    if math.isfinite(np.abs(H).max()):
        least = np.linalg.eigvalsh(H)[0]
    lost = not done or not least > 0.0
    if not math.isfinite(np.abs(after).max()):
        return before, to.T, to.P, least, values.copy(), astray, lost
    return now, to.T, to.P, least, after, astray, lost


@compiled
def leaps(values: Any, stiffness: float, before: Any, now: Any, s: Any) -> bool:
    """Whether the snake buckles between two instants, seen in small steps.

    The search for a distant equilibrium can lead over states in which the snake could
    not stay, though on its own way there it does. It buckles if in a small step the
    search does so, too, and the snake goes more than twice that step's share.

    Args:
        values: What friction holds on to at first, (204,).
        stiffness: Of a wire in N/m.
        before: Wound lengths and force on the tool then, (12,).
        now: The same at the end.
        s: The snake, as `Statics` packs it.
    """
    ways, astray = np.zeros(STEPS), np.zeros(STEPS)
    for k in range(STEPS):
        acting = before + (k + 1) / STEPS * (now - before)
        load = np.append(acting[ROPES:], np.zeros(3))
        start = grip_of(values).turns.copy()
        turns, _, _, _, values, left, lost = held(
            values, start, stiffness, acting[:ROPES], load, s
        )
        if lost:
            return True
        ways[k] = np.abs(turns - start).max()
        astray[k] = 1.0 if left else 0.0
    return bool((ways[astray > 0.5] > 2.0 * ways.mean()).any())

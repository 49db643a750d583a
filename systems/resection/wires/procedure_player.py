"""Procedure player: plays a plan as a smooth stream of tool poses."""

from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolPose, ToolTarget
from plants.snake.tool_target import target_of
from plants.tissue.tissue_carver import Entry, ToolBall
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import check, parameter
from systems.common.signal import Field, flat


class Progress(NamedTuple):
    """How far a plan has been played."""

    posture: Annotated[float, Field("1", "the one last reached", 0.0)]


@dataclass
class ProcedurePlayerParams:
    """Parameters of `ProcedurePlayer`."""

    lead: float = parameter(
        0.02,
        "how far ahead of time `target` is, the control period",
        "s",
        least=1e-3,
        most=0.1,
    )
    bend_rate: float = parameter(
        1.5, "largest rate of a or b of a ball", "rad/s", least=0.01, most=10.0
    )
    travel_rate: float = parameter(
        0.020, "largest speed of the translation", "m/s", least=1e-4, most=0.5
    )
    bend_acceleration: float = parameter(
        40.0, "largest, of a or b of a ball", "rad/s2", least=0.1, most=1e3
    )
    travel_acceleration: float = parameter(
        0.5, "largest, of the translation", "m/s2", least=1e-3, most=10.0
    )
    dwell: float = parameter(
        0.3, "at the beginning and at the end", "s", above=0.0, most=60.0
    )
    ahead: float = parameter(
        1.0,
        "before the end of a procedure at which the next is taken, on line",
        "s",
        least=0.2,
        most=60.0,
    )

    @property
    def turn(self) -> float:
        """Time from rest to the largest rate in s, of the slower to start."""
        return max(
            self.bend_rate / self.bend_acceleration,
            self.travel_rate / self.travel_acceleration,
        )


class Profile(NamedTuple):
    """When each posture of a plan is reached, and how fast.

    Attributes:
        times: At which each is reached in s, whole periods, (n,).
        full: Time of each way between two at full speed, in s, (n - 1,).
        speeds: At each posture, as a share of full speed, (n,).
        waits: Time spent at each in s, whole periods, (n,); a way takes what is left.
    """

    times: NDArray[np.float64]
    full: NDArray[np.float64]
    speeds: NDArray[np.float64]
    waits: NDArray[np.float64]


@compiled
def way_time(full: float, v0: float, v1: float, turn: float) -> float:
    """Time of a way that takes `full` at full speed, from speed v0 to v1."""
    peak = min(math.sqrt((v0 * v0 + v1 * v1) / 2 + full / turn), 1.0)
    ramps = turn * (peak * peak - (v0 * v0 + v1 * v1) / 2)
    return turn * (2 * peak - v0 - v1) + max(full - ramps, 0.0) / max(peak, 1e-9)


@compiled
def way_share(full: float, v0: float, v1: float, turn: float, share: float) -> float:
    """Share of such a way that is gone at a share of its time."""
    if full <= 0.0:
        return share
    time = way_time(full, v0, v1, turn)
    t, left = share * time, (1.0 - share) * time
    peak = min(math.sqrt((v0 * v0 + v1 * v1) / 2 + full / turn), 1.0)
    if t < turn * (peak - v0):
        gone = t * (v0 + t / turn / 2)
    elif left < turn * (peak - v1):
        gone = full - left * (v1 + left / turn / 2)
    else:
        up = turn * (peak - v0)
        gone = up * (v0 + peak) / 2 + (t - up) * peak
    return min(max(gone / full, 0.0), 1.0)


@compiled
def _corner_speeds(full: Any, u: Any, rest: Any, turn: float, jump: float) -> Any:
    """Speeds (n,) at postures, zero at both ends and where it rests.

    No rate jumps by more than a share; full speed is reached in `turn` from rest.
    """
    n = len(full) + 1
    v = np.zeros(n)
    for i in range(1, n - 1):
        most = 1e-9
        for r in range(7):
            most = max(most, abs(u[i, r] - u[i - 1, r]))
        # Means of a period are compared: each is half a ramp faster than the corner.
        v[i] = 0.0 if rest[i] else min(max(jump / most - jump / 2, 0.0), 1.0)
    for i in range(1, n):
        v[i] = min(v[i], math.sqrt(v[i - 1] ** 2 + 2 * full[i - 1] / turn))
    for i in range(n - 2, -1, -1):
        v[i] = min(v[i], math.sqrt(v[i + 1] ** 2 + 2 * full[i] / turn))
    return v


@compiled
def _relax(
    full: Any, u: Any, v: Any, rest: Any, turn: float, jump: float, counts: Any
) -> int:
    """Gives ways a period more where a rate still jumps too far; how many of them."""
    more, before, last = 0, -1, 0.0
    for i in range(len(full)):
        first = way_share(full[i], v[i], v[i + 1], turn, 1.0 / counts[i]) * full[i]
        most = 0.0
        for r in range(7):
            old = 0.0 if before < 0 or rest[i] else last * u[before, r]
            most = max(most, abs(first * u[i, r] - old))
        if most > jump * (1.0 + 1e-9):
            slow = i if before < 0 or rest[i] or first >= last else before
            counts[slow] += 1
            more += 1
        share = way_share(full[i], v[i], v[i + 1], turn, 1.0 - 1.0 / counts[i])
        before, last = i, (1.0 - share) * full[i]
        if (rest[i + 1] or i + 1 == len(full)) and last > jump * (1.0 + 1e-9):
            counts[i] += 1
            more += 1
    return more


def profile(
    x: NDArray[np.float64],
    params: ProcedurePlayerParams,
    waits: NDArray[np.float64] | None = None,
) -> Profile:
    """How a plan is played: every posture at an instant of control, `lead` apart.

    No corner of the path falls between two instants, so the path is the one that was
    checked; from one instant to the next no rate changes by more than its
    acceleration allows.

    Args:
        x: Postures (n, 7) as s, a1, b1, ..., b3.
        params: Rates and accelerations.
        waits: Time to be spent at each posture in s, (n,); none if None.
    """
    lead, n = params.lead, len(x)
    rest = np.zeros(n) if waits is None else np.ceil(waits / lead - 1e-6) * lead
    start = math.ceil(params.dwell / lead) * lead
    if n < 2:
        return Profile(np.array([start]), np.empty(0), np.zeros(n), rest)
    rates = np.array([params.travel_rate] + [params.bend_rate] * 6)
    step = np.diff(x, axis=0) / rates
    full = np.abs(step).max(axis=1)
    u = step / np.maximum(full, 1e-12)[:, None]
    jump = lead / max(params.turn, lead)
    turn, resting = max(params.turn, lead), rest > 0.0
    v = _corner_speeds(full, u, resting, turn, jump)
    times = [way_time(full[i], v[i], v[i + 1], turn) for i in range(n - 1)]
    counts = np.maximum(np.ceil(np.array(times) / lead - 1e-6), 1.0)
    while _relax(full / lead, u, v, resting, turn / lead, jump, counts):
        pass
    ends = np.cumsum(counts * lead + rest[:-1])
    return Profile(start + np.concatenate([[0.0], ends]), full, v, rest)


def schedule(
    x: NDArray[np.float64],
    params: ProcedurePlayerParams,
    waits: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """When each posture is reached, in s, (n,); as `profile`."""
    return profile(x, params, waits).times


@compiled
def posture_at(
    x: Any, times: Any, full: Any, v: Any, waits: Any, turn: float, time: float
) -> Any:
    """The posture (7,) at a time in s, speeding up and slowing down between two.

    Args:
        x: Postures (n, 7).
        times: As `Profile` has them, and so on.
        full: If it is zero, a way is gone at an even speed.
        v: Speeds.
        waits: Waits.
        turn: Time from rest to full speed in s.
        time: Of the posture.
    """
    n = np.searchsorted(times, time)
    if n == 0 or n == len(times):
        return x[min(n, len(x) - 1)].copy()
    begin = times[n - 1] + waits[n - 1]
    share = max(time - begin, 0.0) / (times[n] - begin)
    share = way_share(full[n - 1], v[n - 1], v[n], turn, share)
    return x[n - 1] + share * (x[n] - x[n - 1])


def played(
    x: NDArray[np.float64],
    profile: Profile,
    params: ProcedurePlayerParams,
    time: float,
) -> NDArray[np.float64]:
    """The posture (7,) at a time in s of a profile, see `posture_at`."""
    turn = max(params.turn, params.lead)
    posture: NDArray[np.float64] = posture_at(x, *profile, turn, time)
    return posture


class ProcedurePlayer(Block):
    """Plays the postures of a plan, at the rates the robot can keep.

    Between two postures the way is straight in the modules' angles, as it was
    checked. The intermediate axis goes along, so the inverse kinematics finds the
    planned posture again.

    Port ``target`` emits the `ToolTarget`, ``lead`` ahead of time.
    Port ``reference`` emits the `ToolPose` of this instant.
    Port ``progress`` emits the `Progress`.
    Port ``entry`` emits the `Entry` of the posture last reached.
    Port ``tool`` emits the `ToolBall` that it carries there.
    """

    def __init__(
        self,
        params: ProcedurePlayerParams | None = None,
        snake: SnakeParams | None = None,
        postures: ArrayLike | None = None,
        first: int = 0,
        waits: NDArray[np.float64] | None = None,
        entries: ArrayLike | None = None,
        radii: ArrayLike | None = None,
    ) -> None:
        """Makes the block for a plan.

        Args:
            params: Rates.
            snake: Geometry.
            postures: As s, a1, b1, ..., b3, (n, 7); a short bend if None.
            first: Index of the posture at which the robot stands: those before it
                have been played.
            waits: Time to be spent at each in s, (n,); none if None.
            entries: The channel through which each is reached, (n,); the first if
                None.
            radii: Of the tool's ball at each in m, (n,); the snake's own if None.
        """
        super().__init__()
        self._params = check(params or ProcedurePlayerParams())
        self._snake = check(snake or SnakeParams())
        if postures is None:
            postures = [[0.0] * 7, [0.002, 0.0, 0.1, 0.0, 0.1, 0.2, 0.1]]
        self._x = np.array(postures, float)
        if self._x.ndim != 2 or self._x.shape[1] != 7 or len(self._x) == 0:
            raise ValueError(
                f"postures have shape {self._x.shape}, expected (n, 7) with n > 0"
            )
        if not 0 <= first < len(self._x):
            raise ValueError(f"first={first}: expected 0 to {len(self._x) - 1}")
        self._first, self._x = first, self._x[first:]
        waits = None if waits is None else waits[first:]
        entries = np.zeros(first + len(self._x)) if entries is None else entries
        self._entries = np.asarray(entries, float)
        if radii is None:
            radii = np.full(len(self._entries), self._snake.tool_radius)
        self._radii = np.asarray(radii, float)
        self._profile = profile(self._x, self._params, waits)
        self._times = self._profile.times
        ticket = {self.time_ticket()}
        self.signal_out("target", ToolTarget, self._calc_target, ticket)
        self.signal_out("reference", ToolPose, self._calc_reference, ticket)
        self.signal_out("progress", Progress, self._calc_progress, ticket)
        self.signal_out("entry", Entry, self._calc_entry, ticket)
        self.signal_out("tool", ToolBall, self._calc_tool, ticket)

    @property
    def duration(self) -> float:
        """Of the whole plan in s, both dwells included."""
        return float(self._times[-1]) + self._params.dwell

    @property
    def times(self) -> NDArray[np.float64]:
        """When each posture is reached in s, (n,); 0 for those played before."""
        return np.concatenate([np.zeros(self._first), self._times])

    def target(self, time: float) -> ToolTarget:
        """The tool's pose at a time in s."""
        x = played(self._x, self._profile, self._params, time)
        return target_of(x, self._snake.half_pitch, self._snake.tool_offset)

    def _calc_target(self, context: Any) -> np.ndarray:
        return flat(self.target(context.get_time() + self._params.lead))

    def _calc_reference(self, context: Any) -> np.ndarray:
        target = self.target(context.get_time())
        return flat(ToolPose(target.p, target.n))

    def _calc_progress(self, context: Any) -> list[float]:
        reached = int(np.searchsorted(self._times, context.get_time() + 1e-9, "right"))
        return [float(self._first + max(reached - 1, 0))]

    def _calc_entry(self, context: Any) -> list[float]:
        (posture,) = self._calc_progress(context)
        return [float(self._entries[int(posture)])]

    def _calc_tool(self, context: Any) -> list[float]:
        (posture,) = self._calc_progress(context)
        return [float(self._radii[int(posture)])]

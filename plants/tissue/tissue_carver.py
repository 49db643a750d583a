"""Tissue carver: removes what the tool's true path sweeps, and sees what is touched."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.parameters import SnakeParams
from plants.snake.signals import REST, BallPosture, Posture
from plants.snake.snake_body import (
    CULPRIT,
    OK,
    WHOLE,
    Body,
    between,
    body_of,
    check_body,
    place_any,
)
from plants.tissue.execution import Execution
from plants.tissue.labels import CHANNEL, TUMOUR
from plants.tissue.space import Space, in_voxels, stamp
from plants.tissue.volume import Channel, Volume
from systems.common.block import Block
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import along, norm, sub, xyz
from systems.common.parameter import check, parameter
from systems.common.signal import Field, flat, size


@dataclass
class TissueCarverParams:
    """Parameters of `TissueCarver`."""

    period: float = parameter(0.02, "of the carving", "s", least=1e-3, most=0.1)
    pitch: float = parameter(
        0.25e-3,
        "longest way of the tool between two of its stamps",
        "m",
        least=1e-5,
        most=1e-3,
    )


class Moves(NamedTuple):
    """How many moves were carved."""

    number: Annotated[float, Field("1", "of them", 0.0)]


class Entry(NamedTuple):
    """Through which channel the robot works."""

    number: Annotated[float, Field("1", "0 for the first", 0.0)]


class ToolBall(NamedTuple):
    """Which tool the robot carries."""

    radius: Annotated[float, Field("m", "of its ball", 4e-3)]


class Cutting(NamedTuple):
    """Whether the tool has power: without it, it pushes tissue aside."""

    on: Annotated[float, Field("1", "1 if it cuts, else 0", 1.0)]


class Removed(NamedTuple):
    """What tissue is gone."""

    tumour: Annotated[float, Field("m3", "of the tumour", 0.0)]
    healthy: Annotated[float, Field("m3", "of any other", 0.0)]


class Touched(NamedTuple):
    """What robot and tool came near to."""

    hits: Annotated[float, Field("1", "checks that found the body in tissue", 0.0)]
    critical_distance: Annotated[
        float, Field("m", "least to what is critical, -1 if nothing is", -1.0)
    ]


class Way(NamedTuple):
    """How far the tool went."""

    length: Annotated[float, Field("m", "of its path", 0.0)]


@compiled
def carve(
    s: Space,
    b: Body,
    labels: Any,
    critical: Any,
    x0: Any,
    x1: Any,
    pitch: float,
    time: int,
    cutting: bool,
) -> Any:
    """Moves the true body from one posture to the next, carving.

    Args:
        s: The executed space.
        b: The body, at its true size.
        labels: Of the voxels, flat.
        critical: Distance to what is critical in m, flat; empty if nothing is.
        x0: Posture (7,) or `BallPosture` (19,) before.
        x1: The same now.
        pitch: Longest way of the tool between stamps, in m.
        time: Arrival time of what is freed.
        cutting: Whether anything is.

    Returns:
        Tumour voxels and others freed, checks at which the body met tissue, the
        least distance in m of tool or body to what is critical, and the tool's way
        in m.
    """
    c, x, why = np.empty((POINTS, 3)), np.empty(len(x0)), np.empty(CULPRIT)
    place_any(b, x0, c)
    p = xyz(c[7], 0)
    place_any(b, x1, c)
    way = norm(sub(c[7], p))
    steps = max(1, math.ceil(way / pitch))
    tumour, healthy, hits = 0, 0, 0
    nearest = math.inf
    for n in range(1, steps + 1):
        between(x0, x1, n / steps, x)
        place_any(b, x, c)
        hits += check_body(s, b, c, WHOLE, why) != OK
        first = s.used[0]
        if cutting:
            stamp(s, xyz(c[7], 0), b.radius, time)
        for m in range(first, s.used[0]):
            if labels[s.freed[m]] == TUMOUR:
                tumour += 1
            else:
                healthy += 1
        s.used[0] = 0  # nothing here is ever rolled back by journal
        if len(critical):
            for link in range(6):
                for part in range(4):
                    q = along(c[link], part / 4, sub(c[link + 1], c[link]))
                    nearest = min(nearest, interpolated(s, critical, q) - b.body)
            tool = interpolated(s, critical, xyz(c[7], 0))
            nearest = min(nearest, tool - b.radius)
    return tumour, healthy, hits, nearest, way


@compiled
def interpolated(s: Space, field: Any, p: Numbers) -> float:
    """A field's value at a point, linear between voxels; infinite off the grid."""
    u, v, w = in_voxels(s, p)
    nx, ny, nz = s.size
    i, j, k = math.floor(u), math.floor(v), math.floor(w)
    if i < 0 or j < 0 or k < 0 or i + 1 >= nx or j + 1 >= ny or k + 1 >= nz:
        return math.inf
    fu, fv, fw = u - i, v - j, w - k
    value = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                share = (fu if a else 1 - fu) * (fv if b else 1 - fv)
                share *= fw if c else 1 - fw
                value += share * field[((i + a) * ny + j + b) * nz + k + c]
    return value


class Carving:
    """The executed tissue, shared between contexts.

    It is a memo, not a state: which of its voxels are gone follows from the index
    in the context. Voxels that a later index freed are put back when an earlier one
    goes on from there.
    """

    def __init__(
        self, volume: Volume, params: SnakeParams, done: Execution | None = None
    ) -> None:
        """Makes the executed tissue.

        Args:
            volume: The planned volume; labels and grid are taken from it.
            params: The robot.
            done: What has been carried out before.
        """
        self.volume = volume.fresh()
        self.planned = volume
        self.done = done or Execution()
        if self.done.tau is not None:
            self.volume.tau[:] = self.done.tau
            for channel, index in zip(volume.more, self.done.bored, strict=False):
                self.volume.more.append(replace(channel, time=index))
            self.volume.allow()
            self.volume.refresh()
        self.tau = self.volume.tau.reshape(-1)
        self.labels = volume.labels.reshape(-1)
        self.params = params
        self.body = body_of(params)
        self.bodies: dict[tuple[int, float], Body] = {}
        self.critical: NDArray[np.float32] = volume.to_critical.reshape(-1)
        self.latest = self.done.index
        self.space: Space = self.volume.space()

    @property
    def channels(self) -> list[Channel]:
        """The plan's, which may grow while it is carried out."""
        return self.planned.more

    def move(
        self,
        index: int,
        x0: Any,
        x1: Any,
        pitch: float,
        entry: int = 0,
        cutting: bool = True,
        radius: float | None = None,
    ) -> Any:
        """Carves from posture x0 to x1 as the index after `index`, through an entry.

        The tool's ball has a radius in m, the robot's own if None.

        Its channel is bored if it has not been: the access robot's part, of which
        the tumour counts as removed.
        """
        if index < self.latest:
            self.volume.undo(index)
            self.space = self.volume.space()
        self.latest = index + 1
        bored = 0
        while len(self.volume.more) < entry:
            channel = self.channels[len(self.volume.more)]
            before = int(np.count_nonzero(self.volume.resected))
            self.volume.bore(replace(channel, time=index + 1))
            bored += int(np.count_nonzero(self.volume.resected)) - before
            self.space = self.volume.space()
        tumour, *others = carve(
            self.space,
            self.body_in(entry, radius or self.params.tool_radius),
            self.labels,
            self.critical,
            x0,
            x1,
            pitch,
            index + 1,
            cutting,
        )
        return tumour + bored, *others

    def body_in(self, entry: int, radius: float) -> Body:
        """The body in an entry, with a tool's ball of a radius in m."""
        key = entry, radius
        if key not in self.bodies:
            X_WE = self.channels[entry - 1].X_WE if entry else None
            params = replace(self.params, tool_radius=radius)
            self.bodies[key] = body_of(params, X_WE=X_WE)
        return self.bodies[key]

    @property
    def bored(self) -> list[int]:
        """The indices at which further channels were bored."""
        return [channel.time for channel in self.volume.more]


class TissueCarver(Block):
    """Removes what the tool's true path sweeps, at a finer pitch than the plan's.

    State is the index of the carved moves, the posture there, and the counts; the
    voxels are a memo of it (`Carving`).

    Port ``posture`` accepts the snake's true `Posture`, or its `BallPosture` if the
    block began at one.
    Port ``entry`` accepts the number of the channel it works through; the first if
    nothing is connected.
    Port ``tool`` accepts the `ToolBall` it carries; its own if nothing is connected.
    Port ``cutting`` accepts whether the tool has power, `Cutting`; unconnected it has.
    Port ``index`` emits how many `Moves` were carved.
    Port ``removed`` emits the tissue `Removed`.
    Port ``touched`` emits what was `Touched`.
    Port ``way`` emits the tool's `Way`.
    """

    def __init__(
        self,
        params: TissueCarverParams | None = None,
        snake: SnakeParams | None = None,
        carving: Carving | None = None,
        posture: Sequence[float] = REST,
    ) -> None:
        """Makes the block for tissue, a small block of tumour if None.

        Args:
            params: Of the carving.
            snake: Geometry.
            carving: The tissue.
            posture: Where the snake is at first, (7,), or (19,) of free balls.
        """
        super().__init__()
        self._params = check(params or TissueCarverParams())
        snake = check(snake or SnakeParams())
        self.carving = carving or Carving(_example_volume(), snake)
        self._voxel = self.carving.volume.voxel
        kind = Posture if len(posture) == size(Posture) else BallPosture
        self._posture = self.signal_in("posture", kind)
        self._entry = self.signal_in("entry", Entry)
        self._tool = self.signal_in("tool", ToolBall)
        self._cutting = self.signal_in("cutting", Cutting)
        done = self.carving.done
        self.state_out("index", Moves, flat(Moves(float(done.index))))
        self.state_out("removed", Removed, flat(done.removed))
        self.state_out("touched", Touched, flat(done.touched))
        self.state_out("way", Way, flat(Way(done.way)))
        self.DeclareDiscreteState([*posture])  # where the snake was
        self.update_every(self._params.period, self._update)

    def execution(self, context: Any, posture: int) -> Execution:
        """What has been carried out by now.

        Args:
            context: The block's.
            posture: Index of the plan's posture last reached.
        """
        (index,), removed, touched, (way,), _ = self._state(context)
        tumour, healthy = removed
        hits, nearest = touched
        return Execution(
            posture,
            self.carving.done.time + context.get_time(),
            int(index),
            (tumour, healthy),
            (hits, nearest),
            way,
            self.carving.volume.tau,
            self.carving.bored,
        )

    def _state(self, context: Any) -> list[list[float]]:
        groups = range(context.num_discrete_state_groups())
        return [context.get_discrete_state(i).value().tolist() for i in groups]

    def _update(self, context: Any) -> Sequence[Any]:
        (index,), removed, touched, (way,), before = self._state(context)
        x, entry, cutting = self._posture.Eval(context), 0, True
        if self._entry.HasValue(context):
            entry = int(self._entry.Eval(context)[0])
        radius = None
        if self._tool.HasValue(context):
            radius = float(self._tool.Eval(context)[0])
        if self._cutting.HasValue(context):
            cutting = bool(self._cutting.Eval(context)[0] == 1.0)
        tumour, healthy, hits, nearest, moved = self.carving.move(
            int(index), np.array(before), x, self._params.pitch, entry, cutting, radius
        )
        so_far = Touched(*touched)
        if math.isfinite(nearest):
            nearest = max(nearest, 0.0)
            if so_far.critical_distance >= 0.0:
                nearest = min(nearest, so_far.critical_distance)
        else:
            nearest = so_far.critical_distance
        gone = Removed(*removed)
        return (
            [index + 1.0],
            [gone.tumour + tumour * self._voxel, gone.healthy + healthy * self._voxel],
            [so_far.hits + hits, nearest],
            [way + moved],
            x,
        )


def _example_volume() -> Volume:
    """A cube of tumour before a channel, for a block made without tissue."""
    labels = np.full((32, 32, 32), TUMOUR, np.uint8)
    labels[:, :, :8] = CHANNEL
    return Volume(
        labels, np.array([-0.016, -0.016, 0.03]), 1e-3, 5e-3, 0.037, np.eye(4)
    )

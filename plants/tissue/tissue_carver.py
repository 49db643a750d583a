"""Tissue carver: removes what the tool's true path sweeps, and sees what is touched."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import CULPRIT, OK, body_of, check_body, corners
from plants.tissue.execution import Execution
from plants.tissue.labels import CHANNEL, TUMOUR
from plants.tissue.space import SOLID, Space, stamp
from plants.tissue.volume import Volume
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import check, parameter
from systems.resection.wires.resection_ik import universal


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


@compiled
def carve(
    s: Any,
    b: Any,
    labels: Any,
    critical: Any,
    x0: Any,
    x1: Any,
    pitch: float,
    time: int,
) -> Any:
    """Moves the true body from one posture to the next, carving.

    Args:
        s: The executed space.
        b: The body, at its true size.
        labels: Of the voxels, flat.
        critical: Distance to what is critical in m, flat; empty if nothing is.
        x0: Posture (7,) before.
        x1: Posture (7,) now.
        pitch: Longest way of the tool between stamps, in m.
        time: Arrival time of what is freed.

    Returns:
        Tumour voxels and others freed, checks at which the body met tissue, the
        least distance in m of tool or body to what is critical, and the tool's way
        in m.
    """
    c, x, why = np.empty((8, 3)), np.empty(7), np.empty(CULPRIT)
    corners(x0, b.h, b.tool, c)
    p = c[7].copy()
    corners(x1, b.h, b.tool, c)
    way = math.sqrt(
        (c[7, 0] - p[0]) ** 2 + (c[7, 1] - p[1]) ** 2 + (c[7, 2] - p[2]) ** 2
    )
    steps = max(1, math.ceil(way / pitch))
    tumour, healthy, hits = 0, 0, 0
    nearest = math.inf
    for n in range(1, steps + 1):
        for r in range(7):
            x[r] = x0[r] + n / steps * (x1[r] - x0[r])
        corners(x, b.h, b.tool, c)
        hits += check_body(s, b, c, 0, why) != OK
        first = s.used[0]
        stamp(s, c[7, 0], c[7, 1], c[7, 2], b.radius, time)
        for m in range(first, s.used[0]):
            if labels[s.freed[m]] == TUMOUR:
                tumour += 1
            else:
                healthy += 1
        s.used[0] = 0  # nothing here is ever rolled back by journal
        if len(critical):
            for link in range(1, 8):
                for part in range(4):
                    share = part / 4 if link < 7 else 1.0
                    q0 = c[link - 1, 0] + share * (c[link, 0] - c[link - 1, 0])
                    q1 = c[link - 1, 1] + share * (c[link, 1] - c[link - 1, 1])
                    q2 = c[link - 1, 2] + share * (c[link, 2] - c[link - 1, 2])
                    d = interpolated(s, critical, q0, q1, q2)
                    nearest = min(nearest, d - (b.radius if link == 7 else b.body))
    return tumour, healthy, hits, nearest, way


@compiled
def interpolated(s: Any, field: Any, x: float, y: float, z: float) -> float:
    """A field's value at a point, linear between voxels; infinite off the grid."""
    u = (x - s.origin[0]) / s.spacing
    v = (y - s.origin[1]) / s.spacing
    w = (z - s.origin[2]) / s.spacing
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
        self.done = done or Execution()
        if self.done.tau is not None:
            self.volume.tau[:] = self.done.tau
        self.tau = self.volume.tau.reshape(-1)
        self.labels = volume.labels.reshape(-1)
        self.body = body_of(params)
        self.critical: NDArray[np.float32] = volume.to_critical.reshape(-1)
        self.latest = self.done.index
        self.space: Space = self.volume.space()

    def move(self, index: int, x0: Any, x1: Any, pitch: float) -> Any:
        """Carves from posture x0 to x1 as the index after `index`."""
        if index < self.latest:
            self.tau[(self.tau > index) & (self.tau != SOLID)] = SOLID
            self.volume.roomy[:] = 0
            self.space.used[:] = 0
        self.latest = index + 1
        return carve(
            self.space,
            self.body,
            self.labels,
            self.critical,
            x0,
            x1,
            pitch,
            index + 1,
        )


class TissueCarver(Block):
    """Removes what the tool's true path sweeps, at a finer pitch than the plan's.

    State is the index of the carved moves, the posture there, and the counts; the
    voxels are a memo of it (`Carving`).

    Port ``posture`` accepts s [m], alpha1, beta1, ..., alpha3, beta3 [rad] (7), the
    snake's true posture.

    Port ``index`` emits how many moves were carved (1).

    Port ``removed`` emits tumour and other tissue removed [m3] (2).

    Port ``touched`` emits how many checks found the body in tissue, and the least
    distance of robot and tool to what is critical so far [m], -1 if nothing is (2).

    Port ``way`` emits how far the tool went [m] (1).
    """

    def __init__(
        self,
        params: TissueCarverParams | None = None,
        snake: SnakeParams | None = None,
        carving: Carving | None = None,
        posture: Sequence[float] = (0.0,) * 7,
    ) -> None:
        """Makes the block for tissue, a small block of tumour if None."""
        super().__init__()
        self._params = check(params or TissueCarverParams())
        snake = check(snake or SnakeParams())
        self.carving = carving or Carving(_example_volume(), snake)
        self._voxel = self.carving.volume.voxel
        self._posture = self.vector_in("posture", [0.0] * 7)
        done = self.carving.done
        self.state_out("index", [done.index])
        self.state_out("removed", done.removed)
        self.state_out("touched", done.touched)
        self.state_out("way", [done.way])
        self._at = self.DeclareDiscreteState(universal(posture))
        self.update_every(self._params.period, self._update)

    def execution(self, context: Any, posture: int) -> Execution:
        """What has been carried out by now.

        Args:
            context: The block's.
            posture: Index of the plan's posture last reached.
        """
        index, removed, touched, way = (
            context.get_discrete_state(group).value().tolist() for group in range(4)
        )
        return Execution(
            posture,
            self.carving.done.time + context.get_time(),
            int(index[0]),
            (removed[0], removed[1]),
            (touched[0], touched[1]),
            way[0],
            self.carving.volume.tau,
        )

    def _update(self, context: Any) -> Sequence[Sequence[float]]:
        state = [
            context.get_discrete_state(group).value().tolist() for group in range(5)
        ]
        index, removed, touched, way, x0 = state
        x1 = universal(self._posture.Eval(context).tolist())
        tumour, healthy, hits, nearest, moved = self.carving.move(
            int(index[0]), np.array(x0), np.array(x1), self._params.pitch
        )
        if math.isfinite(nearest):
            nearest = max(nearest, 0.0)
            nearest = nearest if touched[1] < 0.0 else min(nearest, touched[1])
        else:
            nearest = touched[1]
        return (
            [index[0] + 1.0],
            [removed[0] + tumour * self._voxel, removed[1] + healthy * self._voxel],
            [touched[0] + hits, nearest],
            [way[0] + moved],
            x1,
        )


def _example_volume() -> Volume:
    """A cube of tumour before a channel, for a block made without tissue."""
    labels = np.full((32, 32, 32), TUMOUR, np.uint8)
    labels[:, :, :8] = CHANNEL
    return Volume(
        labels, np.array([-0.016, -0.016, 0.03]), 1e-3, 5e-3, 0.037, np.eye(4)
    )

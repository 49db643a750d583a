"""Optical tracker: it measures the surgeon's tools by their markers.

Section 5 of the paper: a Polaris Spectra of NDI "recovers data on surgeon's position
and orientation for both tools simultaneously".
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common import RandomDistribution

from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, cross, plus, sub, unit, xyz
from systems.common.parameter import ParameterError, Rules, check, parameter, part
from systems.common.signal import (
    Field,
    Many,
    Vector,
    finiteness,
    flat,
    reader,
    size,
    writer,
)
from systems.common.signals import Shaft, TrackedShaft

TOOLS = ("target", "obstacle")
NEVER = -1.0  # s, the frame time before the first frame


class MarkerNoise(NamedTuple):
    """What errs in a frame of a tool: independent standard normal numbers."""

    place: Annotated[Vector, Field("1", "of the markers' mean", (0.0, 0.0, 0.0))]
    turn: Annotated[Vector, Field("1", "of the rotation vector", (0.0, 0.0, 0.0))]


UNSEEN = TrackedShaft((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), NEVER, 0.0)
"""A shaft before its first frame."""

read_shaft = reader(Shaft)
read_frame = reader(TrackedShaft)
read_noise = reader(MarkerNoise)
write_frame = writer(TrackedShaft)
finite_shaft = finiteness(Shaft)
_FRAME, _ERRORS = size(TrackedShaft), size(MarkerNoise)


@dataclass
class MarkerBody:
    """The rigid body of markers on a tool's handle, outside the patient.

    A marker is found with noise that is isotropic and white. The body's place is
    the mean of its markers; its orientation comes from how far they are spread, and
    errs all the more the nearer they are to each other. At the tip both add up
    (Fitzpatrick 1998: TRE^2 = FLE^2/N (1 + sum_k d_k^2 / f_k^2 / 3)).
    """

    # 0.25 mm is quoted for a Polaris Spectra, 0.09 mm for a Vega in motion.
    noise: float = parameter(
        0.25e-3, "rms error of one marker in three dimensions", "m", least=0, most=0.01
    )
    markers: int = parameter(4, "their number N", least=3, most=20)
    spread: float = parameter(
        0.035,
        "rms distance of the markers from an axis across",
        "m",
        least=1e-3,
        most=1,
    )
    lever: float = parameter(
        0.35, "from the markers' mean along the shaft to the tip", "m", least=0, most=2
    )

    def sigma_position(self) -> float:
        """Standard deviation of the markers' mean along each axis, in m."""
        return self.noise / math.sqrt(3.0 * self.markers)

    def sigma_direction(self) -> float:
        """Standard deviation of the shaft's direction about each axis, in rad."""
        return self.sigma_position() / self.spread


@dataclass
class SightLoss:
    """A time in which the tracker does not see some tools."""

    start: float = parameter(0.0, "of the first lost frame", "s", least=0, most=1e4)
    end: float = parameter(0.0, "of the first one seen again", "s", least=0, most=1e4)
    tools: list[str] = parameter(
        [], "names of those that are hidden; all if none is named", shape=(-1,)
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield self.start <= self.end, "end", f">= start, {self.start} s"


@dataclass
class OpticalTrackerParams:
    """An optical tracker. The defaults are those of a Polaris."""

    period: float = parameter(1 / 60, "between frames", "s", above=0, most=1)
    # 14.2 ms were measured on a Polaris Vega.
    latency: float = parameter(0.0142, "until it is delivered", "s", least=0, most=1)
    body: MarkerBody = part(MarkerBody)
    # Where it takes the origin of W to be, and how it takes W to be turned.
    shift: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "error of the registration",
        "m",
        least=-0.02,
        most=0.02,
        shape=(3,),
    )
    turn: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "likewise, a rotation vector",
        "rad",
        least=-0.1,
        most=0.1,
        shape=(3,),
    )
    losses: list[SightLoss] = parameter(
        [], "when the line of sight is blocked", shape=(-1,)
    )


def constants(
    body: MarkerBody,
    shift: Sequence[float] = (0.0, 0.0, 0.0),
    turn: Sequence[float] = (0.0, 0.0, 0.0),
) -> np.ndarray:
    """The markers as `disturb` takes them, and the registration's error."""
    return packed(
        misplaced=any((*shift, *turn)),
        shift=np.array(shift, float),
        turn=np.array(turn, float),
        lever=body.lever,
        sigma_position=body.sigma_position(),
        sigma_direction=body.sigma_direction(),
    )


@compiled
def disturb(params: Any, shaft: Shaft, noise: MarkerNoise) -> Shaft:
    """A shaft as its markers show it.

    Args:
        params: A record of `constants`.
        shaft: The true one.
        noise: What errs.
    """
    # A small rotation: u + theta x u, made a unit vector again.
    turn = cross(noise.turn, shaft.u)
    u = unit(along(shaft.u, params.sigma_direction, turn))
    p = along(shaft.tip, params.sigma_position, noise.place)
    return Shaft(along(p, params.lever, sub(u, shaft.u)), u)


@compiled
def misplaced(params: Any, shaft: Shaft) -> Shaft:
    """A shaft as a tracker that is registered wrongly has it."""
    turn = xyz(params.turn, 0)
    u = unit(along(shaft.u, 1.0, cross(turn, shaft.u)))
    tip = plus(shaft.tip, cross(turn, shaft.tip))
    return Shaft(plus(tip, xyz(params.shift, 0)), u)


@compiled
def _expose(
    record: np.ndarray,
    losses: np.ndarray,
    line: np.ndarray,
    time: float,
    noise: np.ndarray,
    *shafts: np.ndarray,
) -> np.ndarray:
    """The delay line with a new frame at its end, and without its oldest.

    Args:
        record: Of `constants`.
        losses: Records of each loss of sight: start and end in s, which tools (n).
        line: Of each frame, of each tool a `TrackedShaft`, the oldest frame first.
        time: Of exposure, in s.
        noise: Of each tool a `MarkerNoise`.
        *shafts: Of each tool a `Shaft`.
    """
    tools = len(shafts)
    frames = line.reshape((-1, tools, _FRAME))
    errors = noise.reshape((tools, _ERRORS))
    after = np.empty_like(frames)
    after[:-1] = frames[1:]
    for tool in range(tools):
        shaft = read_shaft(shafts[tool])
        seen = finite_shaft(shaft)
        for loss in losses:
            if loss.start <= time < loss.end and loss.hides[tool] > 0.0:
                seen = False
        last = read_frame(frames[-1, tool])
        shown = Shaft(last.tip, last.u)
        if seen:
            shown = disturb(record[0], shaft, read_noise(errors[tool]))
            if record[0].misplaced:
                shown = misplaced(record[0], shown)
        frame = TrackedShaft(shown.tip, shown.u, time, 1.0 if seen else 0.0)
        after[-1, tool] = write_frame(frame)
    return after.reshape(-1)


class OpticalTracker(Block):
    """Measures the surgeon's tools (sections 2.2 and 5).

    Every period a frame is exposed; it is delivered at the first of the following
    instants that lies `latency` or more after its exposure (at least one period). A
    delay line in the state holds the frames under way. A tool that is out of sight,
    or whose shaft is not finite, keeps its last pose in the frame and is marked
    invalid. Noise is white; a real tracker's has a slow part as well, which no filter
    removes and which is left out here.

    Ports ``target`` and ``obstacle``, or of whatever names the tools have, accept the
    tools' true `Shaft`.
    Port ``noise`` accepts the `MarkerNoise` of one tool after the other, renewed every
    period. It is declared as Drake's Gaussian random input:
    `AddRandomInputs(params.period, builder)`, or a `RandomSource` of that period,
    feeds it, and `SetRandomContext` seeds it; zeros give a tracker without noise.
    Ports ``target_measured`` and ``obstacle_measured``, likewise, emit the tools' last
    delivered frame, a `TrackedShaft`.
    """

    def __init__(
        self,
        params: OpticalTrackerParams | None = None,
        tools: Sequence[str] = TOOLS,
    ) -> None:
        """Makes the block.

        Args:
            params: Rate, latency, markers, losses of sight.
            tools: Names of the tools.

        Raises:
            ParameterError: If `params` make no sense, or hide a tool that is not there.
        """
        super().__init__()
        params = params or OpticalTrackerParams()
        check(params)
        self._constants = constants(params.body, params.shift, params.turn)
        self._losses = _packed_losses(params.losses, tools)
        self._shafts = [self.signal_in(tool, Shaft) for tool in tools]
        self._noise = self.signal_in(
            "noise", Many(MarkerNoise, tuple(tools)), RandomDistribution.kGaussian
        )
        # The oldest frame of the delay line is the one that has been delivered.
        frames = max(1, math.ceil(params.latency / params.period - 1e-9))
        self.DeclareDiscreteState(flat((UNSEEN,) * (frames * len(tools))))
        for tool in tools:
            self.state_out(f"{tool}_measured", TrackedShaft, flat(UNSEEN))
        firsts = [_FRAME * tool for tool in range(len(tools))]
        self._delivered = [slice(first, first + _FRAME) for first in firsts]
        self.update_every(params.period, self._update)

    def _update(self, context: Any) -> tuple[np.ndarray, ...]:
        line = _expose(
            self._constants,
            self._losses,
            context.get_discrete_state(0).value(),
            context.get_time(),
            self._noise.Eval(context),
            *[port.Eval(context) for port in self._shafts],
        )
        return line, *[line[place] for place in self._delivered]


def _packed_losses(losses: Sequence[SightLoss], tools: Sequence[str]) -> np.ndarray:
    """The losses as `_expose` takes them."""
    layout = [("start", float), ("end", float), ("hides", float, (len(tools),))]
    records = np.zeros(len(losses), np.dtype(layout, align=True))
    for index, (record, loss) in enumerate(zip(records, losses, strict=True)):
        for tool in loss.tools:
            if tool not in tools:
                raise ParameterError(
                    f"optical_tracker.losses[{index}].tools={loss.tools}: there is no "
                    f"tool {tool!r}, expected names among {', '.join(tools)}"
                )
        hides = [float(tool in (loss.tools or tools)) for tool in tools]
        record["start"], record["end"], record["hides"] = loss.start, loss.end, hides
    return records

"""Optical tracker: it measures the surgeon's tools S and O by their markers.

Section 5 of the paper: a Polaris Spectra of NDI "recovers data on surgeon's position
and orientation for both tools simultaneously".
"""

from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.systems.framework import BasicVector

from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import all_finite, along, cross, sub, unit, xyz

TOOLS = ("S", "O")
NEVER = -1.0  # s, the frame time before the first frame


@dataclass
class MarkerBody:
    """The rigid body of markers on a tool's handle, outside the patient.

    A marker is found with noise that is isotropic and white. The body's place is
    the mean of its markers; its orientation comes from how far they are spread, and
    errs all the more the nearer they are to each other. At the tip both add up
    (Fitzpatrick 1998: TRE^2 = FLE^2/N (1 + sum_k d_k^2 / f_k^2 / 3)).
    """

    # Root mean square error of one marker in three dimensions, in m (0.25 mm is
    # quoted for a Polaris Spectra, 0.09 mm for a Vega in motion).
    noise: float = 0.25e-3
    # Number of markers, N.
    markers: int = 4
    # Root mean square distance of the markers from an axis across the shaft, in m.
    spread: float = 0.035
    # From the markers' mean along the shaft to the tip, in m: the lever arm.
    lever: float = 0.35

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        if not 0.0 <= self.noise <= 0.01:
            raise ValueError(
                f"marker body: noise={self.noise} m must lie in [0, 0.01]; "
                f"a Polaris Spectra's is 0.25e-3"
            )
        if self.markers < 3:
            raise ValueError(
                f"marker body: markers={self.markers} give no pose, expected >= 3"
            )
        if not 0.001 <= self.spread <= 1.0:
            raise ValueError(
                f"marker body: spread={self.spread} m must lie in [0.001, 1]"
            )
        if not 0.0 <= self.lever <= 2.0:
            raise ValueError(f"marker body: lever={self.lever} m must lie in [0, 2]")

    def sigma_position(self) -> float:
        """Standard deviation of the markers' mean along each axis, in m."""
        return self.noise / math.sqrt(3.0 * self.markers)

    def sigma_direction(self) -> float:
        """Standard deviation of the shaft's direction about each axis, in rad."""
        return self.sigma_position() / self.spread


@dataclass
class SightLoss:
    """A time in which the tracker does not see some tools."""

    # In s: frames exposed at start <= t < end are lost.
    start: float = 0.0
    end: float = 0.0
    # Which tools are hidden: "S", "O".
    tools: list[str] = field(default_factory=lambda: list(TOOLS))

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        if not self.start <= self.end:
            raise ValueError(
                f"loss of sight: end={self.end} s must not come before "
                f"start={self.start} s"
            )
        for tool in self.tools:
            if tool not in TOOLS:
                raise ValueError(
                    f"loss of sight: there is no tool {tool!r}, expected "
                    f"{' or '.join(TOOLS)}"
                )


@dataclass
class OpticalTrackerParams:
    """An optical tracker. The defaults are those of a Polaris."""

    # Time between frames in s; the planner's period, so that frames fall on its
    # instants.
    period: float = 1.0 / 60.0
    # From exposure to delivery, in s (14.2 ms measured on a Polaris Vega).
    latency: float = 0.0142
    # The markers on each tool.
    body: MarkerBody = field(default_factory=MarkerBody)
    # When the line of sight is blocked.
    losses: list[SightLoss] = field(default_factory=list)

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        if not 0.0 < self.period < 10.0:
            raise ValueError(
                f"optical tracker: period={self.period} s must lie in (0, 10); "
                f"a Polaris has 1/60"
            )
        if not 0.0 <= self.latency <= 1.0:
            raise ValueError(
                f"optical tracker: latency={self.latency} s must lie in [0, 1]"
            )
        self.body.check()
        for loss in self.losses:
            loss.check()


@compiled
def disturb(
    shaft: Numbers,
    noise: Numbers,
    lever: float,
    sigma_position: float,
    sigma_direction: float,
) -> tuple[float, float, float, float, float, float]:
    """A shaft as its markers show it.

    Args:
        shaft: True p_WP in m and u_W (6).
        noise: Six standard normal numbers: markers' mean (3), rotation vector (3).
        lever: From the markers' mean to the tip, in m.
        sigma_position: Of the markers' mean along each axis, in m.
        sigma_direction: Of the rotation about each axis, in rad.

    Returns:
        Measured p_WP in m and u_W (6).
    """
    # A small rotation: u + theta x u, made a unit vector again.
    u = xyz(shaft, 3)
    v = unit(along(u, sigma_direction, cross(xyz(noise, 3), u)))
    p = along(xyz(shaft, 0), sigma_position, xyz(noise, 0))
    return along(p, lever, sub(v, u)) + v


@compiled
def _expose(
    record: np.ndarray,
    losses: np.ndarray,
    line: np.ndarray,
    noise: np.ndarray,
    shaft_S: np.ndarray,
    shaft_O: np.ndarray,
    time: float,
) -> np.ndarray:
    """The delay line with a new frame at its end, and without its oldest."""
    params = record[0]
    after = np.empty(len(line))
    after[:-16] = line[16:]
    frame = after[-16:]
    frame[:] = line[-16:]
    for tool in range(2):
        shaft = shaft_S if tool == 0 else shaft_O
        seen = all_finite(shaft)
        for loss in losses:
            if loss[0] <= time < loss[1] and loss[2 + tool] > 0.0:
                seen = False
        at = 8 * tool
        if seen:
            measured = disturb(
                shaft,
                noise[6 * tool : 6 * tool + 6],
                params.lever,
                params.sigma_position,
                params.sigma_direction,
            )
            for i in range(6):
                frame[at + i] = measured[i]
        frame[at + 6] = time
        frame[at + 7] = 1.0 if seen else 0.0
    return after


class OpticalTracker(Block):
    """Measures both of the surgeon's tools (sections 2.2 and 5).

    Every period a frame is exposed; it is delivered at the first of the following
    instants that lies `latency` or more after its exposure (at least one period). A
    delay line in the state holds the frames under way. A tool that is out of sight,
    or whose shaft is not finite, keeps its last pose in the frame and is marked
    invalid. Noise is white; a real tracker's has a slow part as well, which no filter
    removes and which is left out here.

    Port ``S`` accepts the target tool's true shaft (6): p_WP in m and unit vector u_W,
    world frame W. Port ``O`` accepts the obstacle tool's, likewise (6). Port ``noise``
    accepts twelve independent standard normal numbers, renewed every period, six for S
    and six for O. It is declared as Drake's Gaussian random input:
    `AddRandomInputs(params.period, builder)`, or a `RandomSource` of that period,
    feeds it, and `SetRandomContext` seeds it; zeros give a tracker without noise.
    Port ``S_measured`` emits the last delivered frame of S (8): p_WP in m, u_W, the
    time of its exposure in s (-1 before the first frame), and 1 if valid or 0.
    Port ``O_measured`` emits that of O, likewise (8).

    Args:
        params: Rate, latency, markers, losses of sight.

    Raises:
        ValueError: If `params` make no sense.
    """

    def __init__(self, params: OpticalTrackerParams | None = None) -> None:
        super().__init__()
        params = params or OpticalTrackerParams()
        params.check()
        # Start, end, and whether S and O are hidden; the first one hides nothing.
        losses = [[0.0] * 4]
        for loss in params.losses:
            hides = [float(tool in loss.tools) for tool in TOOLS]
            losses.append([loss.start, loss.end, *hides])
        self._constants = packed(
            lever=params.body.lever,
            sigma_position=params.body.sigma_position(),
            sigma_direction=params.body.sigma_direction(),
        )
        self._losses = np.array(losses)
        example = [0.05, 0.0, -0.12, 0.0, 0.0, -1.0]
        self._shafts = [self.vector_in(tool, example) for tool in TOOLS]
        self._noise = self.DeclareVectorInputPort(
            "noise", BasicVector(np.zeros(12)), RandomDistribution.kGaussian
        )
        # The delay line, oldest frame first: S (8) and O (8) of each frame. The
        # oldest is the one that has been delivered.
        frames = max(1, math.ceil(params.latency / params.period - 1e-9))
        unseen = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, NEVER, 0.0]
        self.DeclareDiscreteState(np.array(2 * unseen * frames))
        self.state_out("S_measured", unseen)
        self.state_out("O_measured", unseen)
        self.update_every(params.period, self._update)

    def _update(self, context: Any) -> tuple[np.ndarray, ...]:
        noise: Any = self._noise.Eval(context)
        line = _expose(
            self._constants,
            self._losses,
            context.get_discrete_state(0).value(),
            noise,
            self._shafts[0].Eval(context),
            self._shafts[1].Eval(context),
            context.get_time(),
        )
        return line, line[:8], line[8:16]

"""What is measured between two rounds, and where the tissue is believed to be after it.

Believed is the first mask, displaced to fit what was seen. An image shows the tumour's
border wherever it is still there. A scan of the cavity's surface shows what was cut,
and a surface that was cut just now tells nothing (`registration`).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from diagrams.resection.scenario import ResectionScenario
from plants.tissue.labels import BRAIN, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.surface import surface
from plants.tissue.volume import Volume
from plants.tissue.yielding import BLUR, CLEAR, Field, YieldingTissue, apart
from systems.resection.planning.registration import Fit, Surface, registered
from systems.resection.planning.session import Session

MOUTH, RIM, ALL = range(3)
"""Stages: what lies beside the channel's mouth, all but a rim, and the rim."""

MODULES = 1
"""Whose length, straight, is beside the mouth: what the last one alone bends to."""

PARTS = 6
"""Of a round, in each of which the tissue is taken to have stood still."""

BESIDE, UNSURE = 1.5, 0.15
"""Voxels about one of which it is not known when it was cut, in shares of a round."""

ALIKE = 4.0 * math.pi * BLUR**2
"""Points of a border in an image that share one error: what its noise is alike over."""


class Sight:
    """What is believed of the tissue, by what was seen.

    Attributes:
        material: The tissue at first, and what of it is believed to be gone.
        fit: Where it has moved to.
    """

    def __init__(self, truth: YieldingTissue, scenario: ResectionScenario) -> None:
        """Begins with tissue of which nothing is gone."""
        self.truth, self.scenario = truth, scenario
        self.material = truth.material.untouched()
        self.volume = self.material.volume
        points = self.volume.points(self.material.labels == TUMOUR)
        self.whole, self.middle = len(points), points.mean(axis=0)
        self.half = float(np.ptp(points, axis=0).max()) / 2
        self.fit, self.share = Fit(), 0.0
        # What the robot believes to do in it; an image needs none.
        self.twin = None if scenario.scan.image else truth.twin()

    @property
    def moved(self) -> Field:
        """The displacement that is believed."""
        return self.fit.displacement(self.middle, self.half)

    def shown(self, stage: int, rim: float) -> NDArray[np.uint8]:
        """Labels where they are believed to be; what is kept for later counts healthy.

        Before the channel there is no rim: the robot could not enter; and what lies
        beside its mouth comes first, before it moves to where no bend reaches it.
        """
        labels, _ = self.material.shown(self.moved)
        kept, _ = self.material.shown(self.moved, rim)
        x, y, z = np.moveaxis(self.material.places.reshape(*labels.shape, 3), -1, 0)
        volume, snake = self.volume, self.scenario.snake
        beside = z <= volume.depth + MODULES * snake.straight_module
        before = (x * x + y * y <= volume.channel**2) & (z <= volume.depth + rim)
        later = (kept != TUMOUR) & ~beside & ~before
        if stage == MOUTH:
            later |= ~beside
        labels[later & (labels == TUMOUR) & (stage < ALL)] = BRAIN
        return labels

    def left(self, gone: NDArray[np.bool_]) -> float:
        """Share of the tumour that is believed to be there."""
        labels, _ = self.material.shown(self.moved)
        return float(np.count_nonzero((labels == TUMOUR) & ~gone)) / self.whole

    def look(
        self,
        session: Session,
        first: int,
        thought: NDArray[np.int32],
        row: dict[str, float],
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.bool_], str]:
        """Measures after a round, and believes what fits.

        Args:
            session: The plan.
            first: Posture at which the round began.
            thought: The plan's arrival times before it.
            row: The round's, which takes how far the tissue moved, and errors.
            rng: Of what is measured.

        Returns:
            What is free, (nx, ny, nz), and why the robot should stop; "" to go on.
        """
        rehearsal, before = self.scenario.rehearsal, self.moved
        if self.twin is None:
            gone, row["rms"] = self._image(rng)
        else:
            went, count = progress_of(session, thought, first)
            feared = rehearsal.feared * count / self.whole
            postures = session.postures[first:]
            tau = session.volume.tau.astype(np.int64)
            again = np.clip(tau - first, 0, len(went) - 1)
            gone, row["rms"] = self._surface(postures, went, again, feared, rng)
        labels, _ = self.material.shown(self.moved)
        left = self.volume.points((labels == TUMOUR) & ~gone)
        if len(left) == 0:
            return gone, ""
        now, yielded = self.moved(left), longest(self.moved(left) - before(left))
        row["moved"] = longest(now)
        row["error"] = longest(now - self.truth.displaced()(left))
        most = rehearsal.most * rehearsal.reserve
        if yielded <= most:
            return gone, ""
        return gone, (
            f"the tissue moved by {1e3 * yielded:.2f} mm since the last scan: "
            f"expected at most {1e3 * most:.2f}"
        )

    def _image(self, rng: np.random.Generator) -> tuple[NDArray[np.bool_], float]:
        scan, volume = self.scenario.scan, self.volume
        labels, gone = self.truth.image(scan, rng)
        whole = (labels == TUMOUR) | gone
        points, _ = surface(whole, volume.origin, volume.spacing)
        points = points[
            beside(volume, points, whole, ~gone)
            & apart(volume, points, self.material.fixed, CLEAR)
        ]
        share = max(1.0 - self.left(gone), self.share)
        if self.share > 0.0:  # what moved so far, moves on alike
            self.fit = self.fit.scaled(share / self.share)
        feared = self.scenario.rehearsal.feared
        self.fit = self.fit.later(feared * (share - self.share))
        self.share = share
        if len(points) == 0:
            return gone, 0.0
        inside = (self.material.labels == TUMOUR) | self.material.fixed
        seen = Surface(points, inside, np.ones(inside.shape), scan.image_noise, ALIKE)
        rms = self._register(seen)
        return gone, rms

    def _register(self, seen: Surface) -> float:
        volume = self.volume
        self.fit, rms = registered(
            [seen], volume.origin, volume.spacing, self.middle, self.half, self.fit
        )
        return rms

    def _surface(
        self,
        postures: NDArray[np.float64],
        went: NDArray[np.float64],
        again: NDArray[np.int64],
        feared: float,
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.bool_], float]:
        twin, scan, before = self.twin, self.scenario.scan, self.fit
        assert twin is not None
        reserve = self.scenario.rehearsal.reserve
        _, gone = twin.material.shown(self.moved)
        swept = twin.last_swept(postures)
        cut = (swept >= 0) & ~gone
        since = np.where(cut, 1.0 - went[swept], 1.0)
        # Where the tool came again later, what is seen may be of either time.
        unsure = cut & (went[swept] - went[again] > UNSURE)
        unsure |= (swept >= 0) & gone
        points = self.truth.scan(scan, rng)
        kept = points[apart(self.volume, points, unsure, BESIDE)]
        points = kept if len(kept) else points[:1]
        noise = float(np.hypot(scan.noise, reserve))
        self.fit = Fit().later(feared + reserve)
        rms = self._register(Surface(points, gone | cut, since, noise))
        step = self.fit.theta
        ends = np.searchsorted(went, np.linspace(0.0, 1.0, PARTS + 1))
        ends[-1] = len(went) - 1
        for part in range(PARTS):  # as it was when each was cut
            d = Fit(before.theta + (part + 0.5) / PARTS * step).displacement(
                self.middle, self.half
            )
            twin.stretch(postures[ends[part] : ends[part + 1] + 1], d)
        self.fit = Fit(before.theta + step)
        _, gone = twin.material.shown(self.moved)
        return gone, rms

    def arrays(self) -> dict[str, Any]:
        """What it goes on from."""
        told: dict[str, Any] = {"theta": self.fit.theta, "spread": self.fit.spread}
        told["share"] = np.array(self.share)
        if self.twin is not None:
            told["believed"] = self.twin.material.gone
        return told

    def resume(self, arrays: dict[str, Any]) -> None:
        """Goes on from what `arrays` had told."""
        self.fit = Fit(arrays["theta"], arrays["spread"])
        self.share = float(arrays["share"])
        if self.twin is not None:
            self.twin.material.gone = arrays["believed"]


def beside(
    volume: Volume, points: NDArray, inside: NDArray, wanted: NDArray
) -> NDArray[np.bool_]:
    """At which points (n, 3) of a mask's border its nearest voxel is a wanted one."""
    _, at = ndimage.distance_transform_edt(~inside, return_indices=True)
    index = np.rint((points - volume.origin) / volume.spacing).astype(int)
    index = np.clip(index, 0, np.array(inside.shape) - 1)
    told: NDArray[np.bool_] = wanted[tuple(at[:, *index.T])]
    return told


def progress_of(
    session: Session, before: NDArray[np.int32], first: int
) -> tuple[NDArray[np.float64], int]:
    """How a round's plan gets on.

    Args:
        session: The plan.
        before: Its arrival times before the round.
        first: Posture at which the round begins.

    Returns:
        At each of its postures the share of the round's tumour that has gone, (n,);
        and how many voxels that are.
    """
    volume = session.volume
    new = (volume.tau != SOLID) & (before == SOLID) & (volume.labels == TUMOUR)
    times = np.sort(volume.tau[new])
    visits = np.arange(first, int(session.tree.size[1]))
    return np.searchsorted(times, visits, "right") / max(len(times), 1), len(times)


def longest(vectors: NDArray[np.float64]) -> float:
    """Of vectors (n, 3) that which all but one in twenty are shorter than."""
    return float(np.quantile(np.linalg.norm(vectors, axis=1), 0.95))

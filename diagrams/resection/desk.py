"""The desk: a console, what its page shows, and what the page wants."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
import io
from pathlib import Path
from threading import Condition
from time import monotonic
from typing import Any

from matplotlib.image import imsave
import numpy as np

from diagrams.common.scenario import refusals
from diagrams.resection.console import Console, open_session, told_map
from diagrams.resection.form import Form, bounds, form_of
from diagrams.resection.scenario import ResectionScenario
from diagrams.resection.slices import EDGES, SIZE, SLICES, Slices
from diagrams.resection.view import (
    draw_around,
    draw_preview,
    draw_tumour,
    look_at,
    shape_of,
)
from plants.tissue.mask import load_image
from systems.resection.planning.feasibility_map import FeasibilityMap, growing_map

NEAR = 1.5e-3
"""Off a slice, of what is in the way in it, in m."""

LONGEST_WAIT = 15.0
"""That a page waits for news in one request, in s."""

SPELL = 0.05
"""Of work on the map between two looks at what the page wants, in s."""

REDRAWN = 250
"""Points between two drawings of a map that grows."""


class Stopped(Exception):
    """Somebody pressed stop."""


class Desk:
    """A console, what its page shows, and what the page wants.

    All work is done by the thread that made it, in `turn`; the server's threads put
    what pages want at the end of `wanted` and read what there is to `show`.
    """

    def __init__(
        self,
        scenario: ResectionScenario,
        file: Path,
        meshcat: Any,
        console: Console | None = None,
    ) -> None:
        """Opens the session, or takes that of a console, and draws it.

        Raises:
            ScenarioError: As `open_session`, or if the image cannot be read.
        """
        image = scenario.image or (
            scenario.mask if scenario.labels.threshold is not None else ""
        )
        self.console = console or Console(open_session(scenario, file), scenario)
        self.console.progress = self.progress
        volume = self.console.session.volume
        with refusals():
            self.slices = Slices(volume, load_image(image) if image else None)
        self.meshcat = meshcat
        self.news = Condition()
        self.wanted: list[tuple[str, Any]] = []
        self.is_over = self.is_stopped = False
        self.pictures: dict[str, bytes] = {}
        self.log: list[tuple[str, str]] = []
        self.form = Form(length=20.0, z=float(round(1e3 * volume.depth + 5.0)))
        self._proposed: tuple[str, str] | None = None
        self._answer, self._is_open = "", True
        self._found: FeasibilityMap | None = None
        self._growing: Iterator[FeasibilityMap] | None = None
        self.show: dict[str, Any] = {
            "version": 0,
            "set": 0,
            "pictures": 0,
            "meshcat": meshcat.port(),
            "name": file.name,
            "bounds": bounds(volume, self.console.session.params),
            "edges": EDGES,
            "size": SIZE,
            "busy": "",
            "robot": "",
        }
        look_at(meshcat, volume, volume.X_PW)  # as in the slices
        self._propose()
        self._draw_all()
        self._publish()

    # What pages want ---------------------------------------------------------

    def want(self, what: str, told: Any) -> None:
        """Takes what a page wants: "move", "point", "view", "line" or "stop".

        Raises:
            ValueError: If it makes no sense.
        """
        if what == "stop":
            self.is_stopped = True
            return
        if what == "move":
            self.form.moved(told)
        elif what == "point":
            ok = isinstance(told, dict) and told.get("slice") in SLICES
            if not (ok and all(0 <= float(told[k]) < SIZE for k in "ij")):
                raise ValueError("expected slice, i and j")
        elif what == "line":
            if not isinstance(told, str) or len(told.splitlines()) != 1:
                raise ValueError("expected a line")
        elif what != "view":
            raise ValueError(f"{what!r}: expected move, point, view, line or stop")
        with self.news:
            if what == "move" and self.wanted and self.wanted[-1][0] == "move":
                told = {**self.wanted.pop()[1], **told}  # only the last one counts
            self.wanted.append((what, told))
            self.news.notify_all()

    def turn(self, patience: float = 0.5) -> None:
        """Does what is wanted next; works on the map if nothing is."""
        with self.news:
            if self._growing is None:
                self.news.wait_for(lambda: self.wanted, patience)
            told: Any
            what, told = self.wanted.pop(0) if self.wanted else ("", "")
        if what == "line":
            self._obey(told)
        elif what == "view":
            self._is_open = bool(told)
            self._draw_tumour()
        elif what:
            if what == "move":
                self.form = self.form.moved(told)
            else:
                p_W = self.slices.point(
                    told["slice"], (float(told["i"]), float(told["j"])), self.form.p_W
                )
                self.form = self.form.at(p_W)
                self._set()
            self._propose()
        elif self._growing is None or not self._grow(monotonic() + SPELL):
            return
        self._publish()

    def _propose(self) -> None:
        """Proposes what the sliders say; only what is there at a command is told."""
        line = self.form.line()
        self._answer = self.console.answer(line)
        self._proposed = (line, self._answer)
        self._draw_preview()

    def _obey(self, line: str) -> None:
        """Hands a line to the console."""
        if line.strip() in ("quit", "exit"):
            self.is_over = True
            return
        if line.strip() == "map":
            is_on = self._found is not None or self._growing is not None
            self._found, self._growing, self.show["busy"] = None, None, ""
            if not is_on:
                self.is_stopped = False
                self._growing = growing_map(self.console.session)
            self._draw_tumour()
            return
        if self._proposed is not None:
            self._tell(*self._proposed)
            self._proposed = None
        before, proposal = self._state(), self.console.proposal
        self.is_stopped = False
        try:
            self._answer = self._said(line)
        except Stopped:
            self._answer = "stopped; what was committed is kept"
        self.show["busy"] = ""
        self._tell(line, self._answer)
        now = self.console.proposal
        if now is not None and now is not proposal:
            self.form = form_of(now, self.form)
            self._set()
        if self._state() != before:
            if self.console.proposal is not None:
                self.console.answer("check")
            else:
                self.console.preview = None
            if self._found is not None or self._growing is not None:
                self._growing = growing_map(self.console.session)
        self._draw_all()

    def _said(self, line: str) -> str:
        """What is answered to a line that counts."""
        return self.console.answer(line)

    def _state(self) -> tuple[int, ...]:
        """What differs when the plan is another."""
        session = self.console.session
        return len(session.steps), *session.standing()

    def _tell(self, line: str, text: str) -> None:
        print(f"> {line}\n{text}")
        self.log.append((line, text))

    def _set(self) -> None:
        """Has the page's sliders moved to the form."""
        self.show["set"] += 1

    @contextmanager
    def progress(self, label: str, unit: str = "") -> Iterator[Callable]:
        """Shows on the page how far long work is, and lets it be stopped."""
        due = 0.0

        def show(value: float, whole: float) -> None:
            nonlocal due
            if self.is_stopped:
                raise Stopped
            if monotonic() >= due:
                due = monotonic() + 0.2
                share = 100 * value / whole if whole else 0.0
                self.show["busy"] = f"{label}: {share:.0f} % {unit}"
                self._publish()

        show(0.0, 1.0)
        yield show

    # What pages show ---------------------------------------------------------

    def _grow(self, until: float) -> bool:
        """Goes on with the map for a while, and says whether it was drawn."""
        is_due = False
        while self._growing is not None and monotonic() < until:
            found = None if self.is_stopped else next(self._growing, None)
            if found is not None:
                self._found, count = found, len(found.points)
                self.show["busy"] = f"map: {count} points"
                is_due = is_due or count % REDRAWN == 0
                continue
            self._growing, self.show["busy"] = None, ""
            if self._found is not None and not self.is_stopped:
                self.console.map, self._answer = self._found, told_map(self._found)
                self._tell("map", self._answer)
        if is_due or self._growing is None:
            self._draw_tumour()
        return is_due or self._growing is None

    def _draw_tumour(self) -> None:
        session, reach = self.console.session, self.console.reach
        reachable = None if reach is None else reach.mask
        draw_tumour(self.meshcat, session, self._found, reachable, self._is_open)

    def _draw_all(self) -> None:
        self._draw_tumour()
        draw_around(self.meshcat, self.console.session)
        self._draw_preview()

    def _draw_preview(self) -> None:
        session, preview = self.console.session, self.console.preview
        draw_preview(self.meshcat, session, preview)
        shape, is_good, where = np.zeros(session.volume.labels.shape, bool), True, None
        if preview is not None:
            shape = shape_of(session.volume, session, preview)
            is_good, where = preview.answer.feasible, preview.answer.where
        marks: dict[str, Any] = {}
        p_W = self.form.p_W
        for name in SLICES:
            at = self.slices.picture(name, p_W, shape, is_good)
            stream = io.BytesIO()
            imsave(stream, at, format="png", pil_kwargs={"compress_level": 1})
            self.pictures[name] = stream.getvalue()
            marks[name] = {"at": self.slices.pixel_of(name, p_W)}
            if where is not None:
                p = np.array(where)
                marks[name]["where"] = self.slices.pixel_of(name, p)
                marks[name]["near"] = self.slices.depth_of(name, p, p_W) < NEAR
        self.show |= {"marks": marks, "pictures": self.show["pictures"] + 1}

    def _publish(self) -> None:
        """Lets the pages know how things stand."""
        console, preview = self.console, self.console.preview
        session = console.session
        is_good = None  # what is said may be of something else
        if preview is not None and preview.answer.text in self._answer:
            is_good = preview.answer.feasible
        with self.news:
            self.show |= {
                "version": self.show["version"] + 1,
                "form": asdict(self.form),
                "line": self.form.line(),
                "answer": self._answer,
                "good": is_good,
                "share": session.fraction,
                "steps": [f"{s.name}, {1e9 * s.gained:.0f} mm³" for s in session.steps],
                "log": self.log[-200:],
                "map": self._found is not None or self._growing is not None,
                "over": self.is_over,
            }
            self.news.notify_all()

    def state(self, after: int) -> dict[str, Any]:
        """What a page shows, as soon as it is newer than what the page has."""
        with self.news:
            self.news.wait_for(
                lambda: self.show["version"] != after or self.is_over, LONGEST_WAIT
            )
            return dict(self.show)

    def close(self) -> None:
        """Lets the pages know that it is over."""
        self.is_over = True
        with self.news:
            self.news.notify_all()
        self.meshcat = None  # it ends in the thread that began it

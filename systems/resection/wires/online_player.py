"""Online player: plays procedures while further ones are being chosen."""

from dataclasses import dataclass
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plants.snake.parameters import SnakeParams
from plants.snake.signals import ToolPose, ToolTarget
from plants.snake.tool_target import target_of
from plants.tissue.tissue_carver import Entry, ToolBall
from systems.common.block import Block
from systems.common.parameter import check
from systems.common.signal import Field, flat
from systems.common.stops import Code
from systems.resection.wires.procedure_player import (
    ProcedurePlayerParams,
    Profile,
    Progress,
    played,
    profile,
)


class Wait(Code):
    """Why the robot waits."""

    PLAYING = 0, "it works"
    NOTHING_CHOSEN = 1, "it waits: no procedure is chosen"
    TOLD = 2, "it waits: told to stop after the last procedure"
    OVER = 3, "all that was chosen is done"
    CHANGED = 4, "it waits: what it had begun is no longer planned"


class Accepted(NamedTuple):
    """Which plan the robot may carry out."""

    page: Annotated[float, Field("1", "of the book of plans", 0.0)]


class Taken(NamedTuple):
    """What of it the robot has begun, and what cannot be taken back."""

    posture: Annotated[float, Field("1", "the last one taken", 0.0)]


class Waiting(NamedTuple):
    """Why the robot waits, if it does."""

    reason: Annotated[float, Field("1", "a `Wait`", 0.0)]


class Stretch(NamedTuple):
    """What is played from rest to rest.

    Attributes:
        page: Of the book, that it was taken from.
        first: Index of the plan's posture at which it begins.
        last: At which it ends.
        begin: When it begins, in s.
    """

    page: float
    first: float
    last: float
    begin: float


@dataclass(frozen=True)
class Page:
    """A plan as it stood when something had been chosen; it never changes.

    Attributes:
        x: Postures as s, a1, b1, ..., b3, (n, 7).
        ends: Index of each step's last posture, rising.
        entries: Channel through which each posture is reached, (n,).
        radii: Of the tool's ball at each in m, (n,).
        waits: Time to be spent at each in s, (n,).
        is_stopped: Whether no further step is to be begun.
        is_over: Whether nothing more will be chosen.
    """

    x: NDArray[np.float64]
    ends: tuple[int, ...]
    entries: NDArray[np.float64]
    radii: NDArray[np.float64]
    waits: NDArray[np.float64]
    is_stopped: bool = False
    is_over: bool = False

    def after(self, posture: int) -> int | None:
        """Where the step after a posture ends; None if there is none to be begun."""
        further = [end for end in self.ends if end > posture]
        return further[0] if further and not self.is_stopped else None


def standing(radius: float) -> Page:
    """The page of a robot that stands straight, with a tool's ball in m."""
    return Page(np.zeros((1, 7)), (), np.zeros(1), np.full(1, radius), np.zeros(1))


def goes_on(old: Profile, new: Profile, time: float) -> bool:
    """Whether one profile is another's until the posture that follows a time in s.

    The path that both are of must be the same so far.
    """
    n = int(np.searchsorted(old.times, time - 1e-9))
    if n >= len(old.times) - 1:
        return False
    upto = (n + 1, n, n + 1, n)
    return all(
        np.array_equal(a[:k], b[:k]) for a, b, k in zip(old, new, upto, strict=True)
    )


class OnlinePlayer(Block):
    """Plays what has been accepted, one step of the plan after the other.

    Shortly before the end of a step (`ProcedurePlayerParams.ahead`) it takes the next
    one, and goes on without a rest as if both had been planned together. If there is
    none, it comes to rest at the end, waits there, and begins from rest when there is.
    Neither jumps: a profile is only exchanged for one that is the same until the
    posture after the next instant.

    State is what is played and since when (`Stretch`); the book of pages is a memo:
    pages are only ever added to it.

    Port ``accepted`` accepts the `Accepted` page.
    Port ``target`` emits the `ToolTarget`, ``lead`` ahead of time.
    Port ``reference`` emits the `ToolPose` of this instant.
    Port ``progress`` emits the `Progress`.
    Port ``entry`` emits the `Entry` of the posture last reached.
    Port ``tool`` emits the `ToolBall` that it carries there.
    Port ``taken`` emits what is `Taken`, this instant's taking included.
    Port ``waiting`` emits why it waits, `Waiting`.
    """

    def __init__(
        self,
        params: ProcedurePlayerParams | None = None,
        snake: SnakeParams | None = None,
        pages: list[Page] | None = None,
        first: int = 0,
    ) -> None:
        """Makes the block for a book of plans.

        Args:
            params: Rates; `lead` is the period.
            snake: Geometry.
            pages: The book, which may grow; a robot that stands if None.
            first: Index of the posture at which the robot stands, of the first page.
        """
        super().__init__()
        self._params = check(params or ProcedurePlayerParams())
        self._snake = check(snake or SnakeParams())
        self._pages = pages or [standing(self._snake.tool_radius)]
        if not 0 <= first < len(self._pages[0].x):
            raise ValueError(
                f"first={first}: expected 0 to {len(self._pages[0].x) - 1}"
            )
        lead = self._params.lead
        self._start = math.ceil(self._params.dwell / lead) * lead
        self._profiles: dict[tuple[int, int, int], Profile] = {}
        self._accepted = self.signal_in("accepted", Accepted)
        self.DeclareDiscreteState([0.0, first, first, self._start])
        moving = {self.xd_ticket(), self.time_ticket()}
        heeding = moving | {self._accepted.ticket()}
        self._next = self.cached("next", self._calc_next, heeding)
        self.signal_out("target", ToolTarget, self._calc_target, moving)
        self.signal_out("reference", ToolPose, self._calc_reference, moving)
        self.signal_out("progress", Progress, self._calc_progress, moving)
        self.signal_out("entry", Entry, self._calc_entry, moving)
        self.signal_out("tool", ToolBall, self._calc_tool, moving)
        self.signal_out("taken", Taken, self._calc_taken, {self._next.ticket()})
        self.signal_out("waiting", Waiting, self._calc_waiting, heeding)
        self.update_every(lead, lambda context: flat(self._next.Eval(context)))

    # What is played ----------------------------------------------------------

    def _stretch(self, context: Any) -> Stretch:
        return Stretch(*context.get_discrete_state(0).value().tolist())

    def _profile(self, stretch: Stretch) -> Profile:
        """How a stretch is played, of a clock on which it begins after the dwell."""
        page, first, last = map(int, (stretch.page, stretch.first, stretch.last))
        if (page, first, last) not in self._profiles:
            part, plan = slice(first, last + 1), self._pages[page]
            found = profile(plan.x[part], self._params, plan.waits[part])
            self._profiles = dict(list(self._profiles.items())[-3:])
            self._profiles[page, first, last] = found
        return self._profiles[page, first, last]

    def _clock(self, stretch: Stretch, time: float) -> float:
        return time - (stretch.begin - self._start)

    def _end(self, stretch: Stretch) -> float:
        """When a stretch is at its end, in s."""
        end = float(self._profile(stretch).times[-1])
        return end + (stretch.begin - self._start)

    def _posture(self, context: Any, time: float) -> NDArray[np.float64]:
        stretch = self._stretch(context)
        x = self._pages[int(stretch.page)].x[int(stretch.first) : int(stretch.last) + 1]
        clock = self._clock(stretch, time)
        return played(x, self._profile(stretch), self._params, clock)

    def _reached(self, context: Any) -> int:
        stretch = self._stretch(context)
        clock = self._clock(stretch, context.get_time())
        times = self._profile(stretch).times
        reached = int(np.searchsorted(times, clock + 1e-9, "right"))
        return int(stretch.first) + max(reached - 1, 0)

    # What is taken -----------------------------------------------------------

    def _page(self, context: Any) -> int | None:
        """The page that is accepted, if there is such a page."""
        (page,) = self._accepted.Eval(context).tolist()
        return int(page) if 0.0 <= page < len(self._pages) else None

    def _keeps(self, page: int, stretch: Stretch) -> bool:
        """Whether a page still has what was taken."""
        old, n = int(stretch.page), int(stretch.last) + 1
        x, before = self._pages[page].x, self._pages[old].x
        return page == old or np.array_equal(x[:n], before[:n])

    def _calc_next(self, context: Any) -> Stretch:
        """What is played from this instant on."""
        stretch, time, page = (
            self._stretch(context), context.get_time(), self._page(context),
        )  # fmt: skip
        lead = self._params.lead
        if page is None or time + self._params.ahead < self._end(stretch):
            return stretch
        while time + self._params.ahead >= self._end(stretch):
            last = self._pages[page].after(int(stretch.last))
            if last is None or not self._keeps(page, stretch):
                break
            longer = Stretch(page, stretch.first, last, stretch.begin)
            upto = self._clock(stretch, time + lead)
            if goes_on(self._profile(stretch), self._profile(longer), upto) or (
                stretch.first == stretch.last and time + lead <= stretch.begin
            ):
                stretch = longer
            elif time + lead >= self._end(stretch):  # it stands
                begin = (round(time / lead) + 1) * lead
                stretch = Stretch(page, stretch.last, last, begin)
            else:
                break
        return stretch

    # What is told ------------------------------------------------------------

    def _target(self, context: Any, time: float) -> ToolTarget:
        x = self._posture(context, time)
        return target_of(x, self._snake.half_pitch, self._snake.tool_offset)

    def _calc_target(self, context: Any) -> np.ndarray:
        return flat(self._target(context, context.get_time() + self._params.lead))

    def _calc_reference(self, context: Any) -> np.ndarray:
        target = self._target(context, context.get_time())
        return flat(ToolPose(target.p, target.n))

    def _calc_progress(self, context: Any) -> list[float]:
        return [float(self._reached(context))]

    def _calc_entry(self, context: Any) -> list[float]:
        page = self._pages[int(self._stretch(context).page)]
        return [float(page.entries[self._reached(context)])]

    def _calc_tool(self, context: Any) -> list[float]:
        page = self._pages[int(self._stretch(context).page)]
        return [float(page.radii[self._reached(context)])]

    def _calc_taken(self, context: Any) -> list[float]:
        return [self._next.Eval(context).last]

    def _calc_waiting(self, context: Any) -> list[float]:
        stretch, number = self._stretch(context), self._page(context)
        if context.get_time() < self._end(stretch) - 1e-9:
            return [float(Wait.PLAYING)]
        if number is None:
            return [float(Wait.NOTHING_CHOSEN)]
        page = self._pages[number]
        if not self._keeps(number, stretch):
            return [float(Wait.CHANGED)]
        if page.is_stopped:
            return [float(Wait.TOLD)]
        if page.after(int(stretch.last)) is not None:
            return [float(Wait.PLAYING)]  # it begins
        if not page.is_over:
            return [float(Wait.NOTHING_CHOSEN)]
        dwells = context.get_time() < self._end(stretch) + self._params.dwell - 1e-9
        return [float(Wait.PLAYING if dwells else Wait.OVER)]

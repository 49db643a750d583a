"""A scripted task for the wrist: altitude arcs about the fulcrum (Figure 3).

Figure 3's instrument turns from A to B about the fulcrum that the planner believes
in. The tip's velocity is the arc's about that point,

    v_P = omega(t) x (p_P - p_G),

integrated from the tip's own start: no jump of the estimate moves the tip.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, pi, sqrt
from typing import Any

from systems.common.block import Block


@dataclass
class ArcParams:
    """Parameters of `ArcNavigation`.

    Attributes:
        angle: The altitude swings by plus and minus this, in rad; 0 stands still.
        swing: Time of a whole swing to and fro, in s.
        start: When the motion begins, in s.
        axis: Direction in W that the shaft turns about.
        period: Of the updates, in s.
    """

    angle: float = 0.0
    swing: float = 8.0
    start: float = 0.0
    axis: list[float] = field(default_factory=lambda: [0.0, 1.0, 0.0])
    period: float = 1.0 / 60.0

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        for name in ("swing", "period"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"arcs.{name}={getattr(self, name)}: expected > 0")
        if not 0.0 <= self.angle <= 0.6:
            raise ValueError(f"arcs.angle={self.angle} rad: expected in [0, 0.6]")
        if len(self.axis) != 3 or not any(self.axis):
            raise ValueError(f"arcs.axis={self.axis}: expected a direction, not zero")


class ArcNavigation(Block):
    """Moves the tip on arcs about the fulcrum it is told.

    Port ``fulcrum`` accepts p_WG (3), the fulcrum believed in, in W [m].

    Port ``permission`` accepts the share of its speed that the task may use now and
    a code (2).

    Port ``tool`` emits the commanded p_WP [m], shaft direction u_W, v_WP [m/s],
    du_W/dt [1/s] and the time [s] they hold at (13).
    """

    def __init__(
        self,
        params: ArcParams | None = None,
        p_WP: Sequence[float] = (0.0, 0.0, -0.18),
        p_WG: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Makes the block with the tip at p_WP and its fulcrum at p_WG [m]."""
        super().__init__()
        p = self._p = params or ArcParams()
        p.check()
        size = sqrt(sum(a * a for a in p.axis))
        self._axis = [a / size for a in p.axis]
        self._fulcrum = self.vector_in("fulcrum", p_WG)
        self._permission = self.vector_in("permission", [1.0, 0.0])
        away = [p_WP[k] - p_WG[k] for k in (0, 1, 2)]
        reach = sqrt(sum(a * a for a in away))
        u = [a / reach for a in away]
        # State: the tool, and how far the script has got, in s.
        initial = [*p_WP, *u, *[0.0] * 6, 0.0, 0.0]
        self._state = self.DeclareDiscreteState(initial)
        self.vector_out("tool", 13, self._calc_tool, {self.xd_ticket()})
        self.update_every(p.period, self._update)

    def _calc_tool(self, context: Any) -> Sequence[float]:
        return context.get_discrete_state(self._state).value()[:13]

    def rate(self, done: float) -> float:
        """Angular rate in rad/s of the sine swing, `done` s after its start."""
        p = self._p
        if done <= 0.0:
            return 0.0
        # The rate grows over half a second; before that the arm stands.
        soft = 0.5 - 0.5 * cos(pi * min(done / 0.5, 1.0))
        return soft * p.angle * 2.0 * pi / p.swing * cos(2.0 * pi * done / p.swing)

    def _update(self, context: Any) -> Sequence[float]:
        p = self._p
        old = context.get_discrete_state(self._state).value().tolist()
        p_WG = self._fulcrum.Eval(context).tolist()
        pace = float(self._permission.Eval(context)[0])
        time = context.get_time()
        step = time - old[12]
        p_WP = [old[k] + step * old[6 + k] for k in (0, 1, 2)]
        done = old[13] + (pace * p.period if time >= p.start else 0.0)
        turning = pace * self.rate(done)
        away = [p_WP[k] - p_WG[k] for k in (0, 1, 2)]
        a = self._axis
        v = [
            turning * (a[1] * away[2] - a[2] * away[1]),
            turning * (a[2] * away[0] - a[0] * away[2]),
            turning * (a[0] * away[1] - a[1] * away[0]),
        ]
        reach = sqrt(sum(x * x for x in away))
        u = [x / reach for x in away]
        along = sum(v[k] * u[k] for k in (0, 1, 2))
        du = [(v[k] - along * u[k]) / reach for k in (0, 1, 2)]
        return [*p_WP, *u, *v, *du, time, done]

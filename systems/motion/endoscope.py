"""Endoscope: the camera C that follows the surgeon's tool S through its own fulcrum.

Section 2.1 of the paper: robot and surgeon's tool are kept in a cone-shaped field of
view "by following the surgeon's tool S with the camera and forcing the robot tool R
to be within the view field".
"""

from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    limited,
    norm,
    sub,
    unit,
    xyz,
)


@dataclass
class EndoscopeParams:
    """A straight endoscope and the way it is led. Frame W, SI units."""

    # Time between updates in s.
    period: float = 1.0 / 60.0
    # The fulcrum G_C, in m.
    p_WG: list[float] = field(default_factory=lambda: [0.0, -0.08, 0.0])
    # Where S's tip is expected before it is seen, in m; the camera looks there first.
    p_WS: list[float] = field(default_factory=lambda: [0.0, 0.0, -0.13])
    # How far short of S's tip the camera's tip stays, in m.
    standoff: float = 0.07
    # Its tip is at least and at most so far inside the fulcrum, in m.
    min_insertion: float = 0.03
    max_insertion: float = 0.25
    # Half the opening angle of the field of view, in rad (70 degrees in all).
    half_angle: float = math.radians(35.0)
    # How fast the distance to the wanted place is made good, in 1/s.
    rate: float = 1.5
    # Limits of the camera tip's speed in m/s, and of its change in m/s^2.
    max_speed: float = 0.03
    max_acceleration: float = 0.1

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        for name in ("p_WG", "p_WS"):
            value = getattr(self, name)
            if len(value) != 3 or not all(map(math.isfinite, value)):
                raise ValueError(f"endoscope: {name}={value} must be 3 finite numbers")
        for name in (
            "period",
            "standoff",
            "min_insertion",
            "rate",
            "max_speed",
            "max_acceleration",
        ):
            number = getattr(self, name)
            if not 0.0 < number < math.inf:
                raise ValueError(f"endoscope: {name}={number} must be finite and > 0")
        if not self.min_insertion < self.max_insertion < math.inf:
            raise ValueError(
                f"endoscope: max_insertion={self.max_insertion} m must be over "
                f"min_insertion={self.min_insertion} m"
            )
        if not 0.0 < self.half_angle < 0.5 * math.pi:
            raise ValueError(
                f"endoscope: half_angle={self.half_angle} rad must lie in (0, pi/2); "
                f"is it in degrees?"
            )
        if self.rate * self.period >= 1.0:
            raise ValueError(
                f"endoscope: rate={self.rate} /s is too fast for period={self.period} "
                f"s, expected less than {1.0 / self.period:.4g} /s"
            )
        # A camera that cannot brake as fast as its rate asks would overshoot.
        if self.rate * self.max_speed > self.max_acceleration:
            raise ValueError(
                f"endoscope: max_acceleration={self.max_acceleration} m/s^2 is too low "
                f"for rate={self.rate} /s at max_speed={self.max_speed} m/s, expected "
                f"at least {self.rate * self.max_speed:.4g} m/s^2"
            )
        depth = self.p_WG[2] - self.p_WS[2]
        if not depth > self.min_insertion:
            raise ValueError(
                f"endoscope: p_WS={self.p_WS} must lie below the fulcrum "
                f"p_WG={self.p_WG} by more than min_insertion={self.min_insertion} m"
            )


def constants(params: EndoscopeParams) -> np.ndarray:
    """The parameters as the compiled functions take them.

    Raises:
        ValueError: If `params` make no sense.
    """
    params.check()
    return packed(params)


@compiled
def wanted_tip(params: Any, p: Numbers) -> Vector:
    """Where the camera's tip should be to look at a point p in W: p_WC in m.

    Args:
        params: A record of `constants`.
        p: The point in W, in m.
    """
    g = xyz(params.p_WG, 0)
    d = sub(p, g)
    distance = norm(d)
    insertion = distance - params.standoff
    insertion = max(params.min_insertion, min(params.max_insertion, insertion))
    return along(g, insertion / max(distance, 1e-6), d)


@compiled
def follow(
    params: Any, p: Numbers, v: Numbers, target: Numbers, is_known: bool
) -> tuple[Vector, Vector]:
    """One period of the camera's motion.

    Args:
        params: A record of `constants`.
        p: The camera's tip p_WC in m.
        v: Its velocity v_WC in m/s.
        target: The point to look at in m.
        is_known: Whether there is one; else the camera comes to rest.

    Returns:
        p_WC in m and v_WC in m/s a period later.
    """
    wanted = (0.0, 0.0, 0.0)
    if is_known:
        d = sub(wanted_tip(params, target), p)
        rate = params.rate
        wanted = limited((rate * d[0], rate * d[1], rate * d[2]), params.max_speed)
    change = limited(sub(wanted, v), params.max_acceleration * params.period)
    v = along(v, 1.0, change)
    return along(p, params.period, v), v


@compiled
def _camera(params: Any, p: Vector, v: Vector) -> np.ndarray:
    """The state: shaft p_WC, u_W and half angle (7), and v_WC (3)."""
    u = unit(sub(p, xyz(params.p_WG, 0)))
    return np.array(p + u + (params.half_angle,) + v)


@compiled
def _start(record: np.ndarray) -> np.ndarray:
    params = record[0]
    return _camera(params, wanted_tip(params, xyz(params.p_WS, 0)), (0.0, 0.0, 0.0))


@compiled
def _follow(
    record: np.ndarray, cone: np.ndarray, v: np.ndarray, estimate: np.ndarray
) -> np.ndarray:
    params = record[0]
    target = xyz(estimate, 0)
    is_known = estimate[15] > 0.5 and all_finite(target)
    p, v_WC = follow(params, xyz(cone, 0), xyz(v, 0), target, is_known)
    return _camera(params, p, v_WC)


@compiled
def _estimate(cone: np.ndarray, v: np.ndarray, p_WG: Vector) -> np.ndarray:
    """The endoscope as the estimates (17) of the surgeon's tools."""
    none = (0.0, 0.0, 0.0)
    known = (0.0, 0.0, 0.0, 1.0, 0.0)
    return np.array(xyz(cone, 0) + xyz(v, 0) + none + p_WG + known)


class Endoscope(Block):
    """Follows the surgeon's target tool S and gives the field of view (section 2.1).

    The camera looks along its shaft, which passes its own fulcrum G_C. It turns towards
    S's tip and stays a set distance short of it, smoothly and slowly, as a surgeon
    wants the picture; it comes to rest while S is not known. No roll.

    Port ``target`` accepts S's estimate (17), of which p_WP in m, world frame W, and
    known are used. Port ``view_cone`` emits (7): apex p_WC in m, the unit vector of
    its axis, in W, and half its opening angle in rad. Port ``shaft`` emits the
    endoscope's shaft (6): tip p_WC in m and unit vector u_W, from outside to the tip.
    Port ``estimate`` emits what is known of it as of a surgeon's tool (17): p_WC in m,
    v_WC in m/s, no acceleration, the fulcrum p_WG in m, no deviations, known, age 0.

    Args:
        params: The endoscope and its limits.

    Raises:
        ValueError: If `params` make no sense.
    """

    def __init__(self, params: EndoscopeParams | None = None) -> None:
        super().__init__()
        params = params or EndoscopeParams()
        self._constants = constants(params)
        self._target = self.vector_in(
            "target",
            [0.0, 0.0, -0.13, *[0.0] * 6, 0.05, 0.0, 0.0, 1e-3, 1e-2, 0.1, 1.0, 0.02],
        )
        start = _start(self._constants)
        self._cone = self.state_out("view_cone", start[:7])
        self.state_out("shaft", start[:6])
        self._velocity = self.DeclareDiscreteState(start[7:])
        x, y, z = params.p_WG
        self._p_WG = (float(x), float(y), float(z))
        self.vector_out("estimate", 17, self._calc_estimate, {self.xd_ticket()})
        self.update_every(params.period, self._update)

    def _calc_estimate(self, context: Any) -> np.ndarray:
        return _estimate(
            context.get_discrete_state(self._cone).value(),
            context.get_discrete_state(self._velocity).value(),
            self._p_WG,
        )

    def _update(self, context: Any) -> tuple[np.ndarray, ...]:
        state = _follow(
            self._constants,
            context.get_discrete_state(self._cone).value(),
            context.get_discrete_state(self._velocity).value(),
            self._target.Eval(context),
        )
        return state[:7], state[:6], state[7:]

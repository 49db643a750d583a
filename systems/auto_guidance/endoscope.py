"""Endoscope: the camera C that follows the surgeon's tool S through its own fulcrum.

Section 2.1 of the paper: robot and surgeon's tool are kept in a cone-shaped field of
view "by following the surgeon's tool S with the camera and forcing the robot tool R
to be within the view field".
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from systems.common.block import Block


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


def wanted_tip(
    params: EndoscopeParams, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Where the camera's tip should be to look at a point: p_WC in m.

    Args:
        params: The endoscope.
        x: The point in W, in m.
        y: The same.
        z: The same.
    """
    gx, gy, gz = params.p_WG
    dx, dy, dz = x - gx, y - gy, z - gz
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    insertion = distance - params.standoff
    insertion = max(params.min_insertion, min(params.max_insertion, insertion))
    k = insertion / max(distance, 1e-6)
    return gx + k * dx, gy + k * dy, gz + k * dz


def follow(
    params: EndoscopeParams, state: Sequence[float], target: Sequence[float] | None
) -> tuple[float, ...]:
    """One period of the camera's motion.

    Args:
        params: The endoscope.
        state: p_WC in m and v_WC in m/s (6).
        target: The point to look at in m (3), or None to come to rest.

    Returns:
        The next state (6).
    """
    px, py, pz, vx, vy, vz = state
    dt = params.period
    wx = wy = wz = 0.0
    if target is not None:
        qx, qy, qz = wanted_tip(params, *target)
        rate = params.rate
        wx, wy, wz = rate * (qx - px), rate * (qy - py), rate * (qz - pz)
        speed = math.sqrt(wx * wx + wy * wy + wz * wz)
        if speed > params.max_speed:
            k = params.max_speed / speed
            wx, wy, wz = k * wx, k * wy, k * wz
    ax, ay, az = wx - vx, wy - vy, wz - vz
    change = math.sqrt(ax * ax + ay * ay + az * az)
    most = params.max_acceleration * dt
    if change > most:
        k = most / change
        wx, wy, wz = vx + k * ax, vy + k * ay, vz + k * az
    return px + dt * wx, py + dt * wy, pz + dt * wz, wx, wy, wz


class Endoscope(Block):
    """Follows the surgeon's target tool S and gives the field of view (section 2.1).

    The camera looks along its shaft, which passes its own fulcrum G_C. It turns towards
    S's tip and stays a set distance short of it, smoothly and slowly, as a surgeon
    wants the picture; it comes to rest while S is not known. No roll.

    Port ``target`` accepts S's estimate (17), of which p_WP in m, world frame W, and
    known are used. Port ``view_cone`` emits (7): apex p_WC in m, the unit vector of
    its axis, in W, and half its opening angle in rad. Port ``shaft`` emits the
    endoscope's shaft (6): tip p_WC in m and unit vector u_W, from outside to the tip.

    Args:
        params: The endoscope and its limits.

    Raises:
        ValueError: If `params` make no sense.
    """

    def __init__(self, params: EndoscopeParams | None = None) -> None:
        super().__init__()
        params = params or EndoscopeParams()
        params.check()
        self._params = params
        self._target = self.vector_in(
            "target",
            [0.0, 0.0, -0.13, *[0.0] * 6, 0.05, 0.0, 0.0, 1e-3, 1e-2, 0.1, 1.0, 0.02],
        )
        start = [*wanted_tip(params, *params.p_WS), 0.0, 0.0, 0.0]
        self.DeclareDiscreteState(np.array(start))
        state = {self.xd_ticket()}
        self.vector_out("view_cone", 7, self._calc_cone, state)
        self.vector_out("shaft", 6, self._calc_shaft, state)
        self.update_every(params.period, self._follow)

    def _follow(self, context: Any) -> Sequence[float]:
        estimate = self._target.Eval(context).tolist()
        x, y, z = estimate[:3]
        usable = estimate[15] > 0.5 and math.isfinite(x + y + z)
        state = context.get_discrete_state(0).value().tolist()
        return follow(self._params, state, (x, y, z) if usable else None)

    def _calc_shaft(self, context: Any) -> Sequence[float]:
        x, y, z, _, _, _ = context.get_discrete_state(0).value().tolist()
        gx, gy, gz = self._params.p_WG
        ux, uy, uz = x - gx, y - gy, z - gz
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        return x, y, z, ux / length, uy / length, uz / length

    def _calc_cone(self, context: Any) -> Sequence[float]:
        return (*self._calc_shaft(context), self._params.half_angle)

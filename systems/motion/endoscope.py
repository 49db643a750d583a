"""Endoscope: the camera C that follows the surgeon's tool S through its own fulcrum.

Section 2.1 of the paper: robot and surgeon's tool are kept in a cone-shaped field of
view "by following the surgeon's tool S with the camera and forcing the robot tool R
to be within the view field".
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    along,
    limited,
    norm,
    plus,
    scaled,
    sub,
    unit,
    xyz,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Vector, finiteness
from systems.common.signals import Estimate, Point, Shaft, ViewCone
from systems.common.step_block import StepBlock

finite_point = finiteness(Point)


@dataclass
class EndoscopeParams:
    """A straight endoscope and the way it is led."""

    period: float = parameter(1 / 60, "of the update", "s", above=0, most=1)
    p_WG: list[float] = parameter(
        [0.0, -0.08, 0.0], "its fulcrum G_C in W", "m", least=-1, most=1, shape=(3,)
    )
    # The camera looks there first.
    p_WS: list[float] = parameter(
        [0.0, 0.0, -0.13], "where S is expected", "m", least=-1, most=1, shape=(3,)
    )
    standoff: float = parameter(
        0.07, "how far short of S's tip its own tip stays", "m", above=0, most=0.3
    )
    min_insertion: float = parameter(
        0.03, "of its tip below the fulcrum, at the least", "m", above=0, most=0.3
    )
    max_insertion: float = parameter(
        0.25, "of its tip below the fulcrum, at the most", "m", above=0, most=0.5
    )
    half_angle: float = parameter(
        math.radians(35.0), "half the field of view", "rad", least=0.1, most=1.5
    )
    rate: float = parameter(
        1.5,
        "how fast the way to the wanted place is made good",
        "1/s",
        above=0,
        most=20,
    )
    max_speed: float = parameter(0.03, "of its tip", "m/s", above=0, most=0.5)
    max_acceleration: float = parameter(0.1, "of its tip", "m/s^2", above=0, most=5)

    def rules(self) -> Rules:
        """What must hold across fields."""
        inserted = self.min_insertion < self.max_insertion
        yield inserted, "max_insertion", f"over min_insertion, {self.min_insertion} m"
        fastest = 1.0 / self.period
        slow = self.rate < fastest
        yield slow, "rate", f"less than 1 / period, {fastest:.4g} /s"
        # A camera that cannot brake as fast as its rate asks would overshoot.
        least = self.rate * self.max_speed
        yield (
            self.max_acceleration >= least,
            "max_acceleration",
            f"at least rate max_speed, {least:.4g} m/s^2",
        )
        deep = self.p_WG[2] - self.p_WS[2] > self.min_insertion
        yield deep, "p_WS", "a point below p_WG by more than min_insertion"


def constants(params: EndoscopeParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
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
        wanted = limited(scaled(params.rate, d), params.max_speed)
    change = limited(sub(wanted, v), params.max_acceleration * params.period)
    v = plus(v, change)
    return along(p, params.period, v), v


@compiled
def _camera(params: Any, p: Vector, v: Vector) -> tuple[ViewCone, Shaft, Estimate]:
    """The camera with its tip at p_WC: all that is said of it."""
    none = (0.0, 0.0, 0.0)
    fulcrum = xyz(params.p_WG, 0)
    u = unit(sub(p, fulcrum))
    estimate = Estimate(p, v, none, fulcrum, 0.0, 0.0, 0.0, 1.0, 0.0)
    return ViewCone(p, u, params.half_angle), Shaft(p, u), estimate


@compiled
def _start(record: np.ndarray) -> tuple[ViewCone, Shaft, Estimate]:
    params = record[0]
    return _camera(params, wanted_tip(params, xyz(params.p_WS, 0)), (0.0, 0.0, 0.0))


@compiled
def _follow(
    params: Any, cone: ViewCone, shaft: Shaft, camera: Estimate, target: Estimate
) -> tuple[ViewCone, Shaft, Estimate]:
    is_known = target.known > 0.5 and finite_point(Point(target.p))
    p, v = follow(params, camera.p, camera.v, target.p, is_known)
    return _camera(params, p, v)


class Endoscope(StepBlock):
    """Follows the surgeon's target tool S and gives the field of view (section 2.1).

    The camera looks along its shaft, which passes its own fulcrum G_C. It turns towards
    S's tip and stays a set distance short of it, smoothly and slowly, as a surgeon
    wants the picture; it comes to rest while S is not known. No roll.

    Port ``target`` accepts the `Estimate` of S, of which its tip and known are used.
    Port ``view_cone`` emits the `ViewCone`.
    Port ``shaft`` emits the endoscope's own `Shaft`.
    Port ``estimate`` emits what is known of it as of a surgeon's tool, an `Estimate`
    without acceleration and deviations.
    """

    def __init__(self, params: EndoscopeParams | None = None) -> None:
        """Makes the block.

        Args:
            params: The endoscope and its limits.

        Raises:
            ParameterError: If `params` make no sense.
        """
        super().__init__()
        params = params or EndoscopeParams()
        record = constants(params)
        states = zip(("view_cone", "shaft", "estimate"), _start(record), strict=True)
        self.declare_update(
            _follow,
            [record],
            {"target": Estimate},
            dict(states),
            params.period,
            timed=False,
        )

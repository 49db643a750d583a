"""Geometry, limits and wires of the snake, with their sources."""

from dataclasses import dataclass, field
import math

MODULES = 3
"""Bending modules in series (paper, III.A)."""

WIRES = 3
"""Wires of a module (paper, III.A): nine run through the first one."""

DRUMS = WIRES * MODULES + 1
"""Motors: one a wire, and the one that slides the robot."""


@dataclass
class SnakeParams:
    """The snake of Martin et al., III.A and Figures 3 to 6. Lengths in m.

    The paper gives the width (8 mm), the bend (90 deg a module) and the names of
    the lengths, but no lengths; the defaults are the middle of what these leave
    open (see `check`).

    Attributes:
        ball_radius: R, of the balls and of the circle the wires lie on.
        plate_thickness: e.
        half_pitch: h, half the distance between two ball centres.
        max_bend: Largest beta in rad, at *each* of a module's two balls.
        travel: Least and largest translation s, [s_min, s_max].
        tool_offset: l, from O3 (2 h past the last ball centre) to the tool.
        tool_radius: Radius of the ball that the rotating wire ring sweeps.
        body_radius: Outer radius of plates and sheath (the paper's 8 mm wide).
        first_azimuths: Azimuth of the first wire of each module, in rad; the
            other two follow at 120 and 240 deg. Nine different holes are needed.
    """

    ball_radius: float = 3.0e-3
    plate_thickness: float = 1.0e-3
    half_pitch: float = 3.2e-3
    max_bend: float = math.pi / 4
    travel: list[float] = field(default_factory=lambda: [-0.050, 0.110])
    tool_offset: float = 3.0e-3
    tool_radius: float = 4.0e-3
    body_radius: float = 4.0e-3
    first_azimuths: list[float] = field(
        default_factory=lambda: [0.0, math.radians(40.0), math.radians(80.0)]
    )

    @property
    def face(self) -> float:
        """Distance d = h - e/2 from a ball's centre to a plate's face, in m."""
        return self.half_pitch - self.plate_thickness / 2

    @property
    def straight_module(self) -> float:
        """4 h, a module's length and that of its wires when straight, in m."""
        return 4 * self.half_pitch

    def azimuths(self) -> list[list[float]]:
        """Azimuths of the wires by module, in rad, (3, 3)."""
        turn = 2 * math.pi / WIRES
        return [[f + j * turn for j in range(WIRES)] for f in self.first_azimuths]

    def check(self) -> "SnakeParams":
        """Returns itself if a robot can be built and driven so.

        Raises:
            ValueError: Naming the parameter, the inequality it breaks and the
                nearest valid choice.
        """
        for name in ("ball_radius", "plate_thickness", "half_pitch", "body_radius"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name}={getattr(self, name)} m must be > 0")
        for name in ("tool_offset", "tool_radius"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name}={getattr(self, name)} m must be >= 0")
        if not 0.0 < self.max_bend <= math.pi / 4 + 1e-12:
            raise ValueError(
                f"max_bend={self.max_bend:.4f} rad must lie in (0, pi/4]: a module "
                "bends 2 beta, 90 deg at most (paper, III.A); nearest: "
                f"{min(max(self.max_bend, 0.01), math.pi / 4):.4f}"
            )
        if len(self.travel) != 2 or not self.travel[0] < self.travel[1]:
            raise ValueError(f"travel={self.travel} m must be [s_min, s_max], rising")
        if self.half_pitch < self.ball_radius:
            raise ValueError(
                f"half_pitch h={self.half_pitch:g} m < ball_radius R="
                f"{self.ball_radius:g} m: the balls of a module overlap; "
                f"nearest: h={self.ball_radius:g}"
            )
        self._check_bend()
        self._check_wires()
        return self

    def _check_bend(self) -> None:
        """Wires and rims must not be pinched, and lengths must mean one posture."""
        t = math.tan(self.max_bend / 2)
        d, R = self.face, self.ball_radius
        outer = max(R, self.body_radius)
        if not t < d / outer:
            raise ValueError(
                f"tan(max_bend/2)={t:.4f} >= d/r={d / outer:.4f} with d=h-e/2="
                f"{d:g} m and r={outer:g} m: neighbouring plates touch at the rim "
                f"before max_bend; nearest: max_bend={2 * math.atan(d / outer):.4f}"
            )
        if not t < R / (2 * d):
            raise ValueError(
                f"tan(max_bend/2)={t:.4f} >= R/(2d)={R / (2 * d):.4f} with d=h-e/2="
                f"{d:g} m: two postures share the same wire lengths and the wires "
                "cannot all be taut; nearest: max_bend="
                f"{2 * math.atan(R / (2 * d)):.4f} or half_pitch="
                f"{R / (2 * t) + self.plate_thickness / 2:g}"
            )

    def _check_wires(self) -> None:
        """Nine wires need nine holes."""
        if len(self.first_azimuths) != MODULES:
            raise ValueError(
                f"first_azimuths={self.first_azimuths} must have {MODULES} entries, "
                "one a module"
            )
        turn = 2 * math.pi
        holes = sorted(phi % turn for row in self.azimuths() for phi in row)
        gap = min(
            (b - a) % turn
            for a, b in zip(holes, [*holes[1:], holes[0] + turn], strict=True)
        )
        if gap < math.radians(10.0):
            raise ValueError(
                f"first_azimuths={self.first_azimuths} rad put two wires "
                f"{math.degrees(gap):.1f} deg apart, at least 10 deg are needed; "
                "nearest: 0, 40 and 80 deg"
            )

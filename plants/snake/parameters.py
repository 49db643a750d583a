"""Geometry, limits and wires of the snake, with their sources."""

from dataclasses import dataclass
import math

from systems.common.parameter import Rules, parameter

MODULES = 3
"""Bending modules in series (paper, III.A)."""

WIRES = 3
"""Wires of a module (paper, III.A): nine run through the first one."""

DRUMS = WIRES * MODULES + 1
"""Motors: one a wire, and the one that slides the robot."""


STOP = math.radians(4.0)
"""Each joint's end stop lies this far beyond max_bend."""

LEAST_GAP = math.radians(10.0)
"""Between two wires' holes in a plate."""


@dataclass
class SnakeParams:
    """The snake of Martin et al., III.A and Figures 3 to 6. Lengths in m.

    The paper gives the width (8 mm), the bend (90 deg a module) and the names of
    the lengths, but no lengths; the defaults are the middle of what these leave
    open (see `rules`).
    """

    ball_radius: float = parameter(
        3.0e-3,
        "R, of the balls and of the circle the wires lie on",
        "m",
        least=5e-4,
        most=0.02,
    )
    plate_thickness: float = parameter(
        1.0e-3, "e, of a plate", "m", least=1e-4, most=0.01
    )
    half_pitch: float = parameter(
        3.2e-3,
        "h, half the distance between two ball centres",
        "m",
        least=5e-4,
        most=0.02,
    )
    # A module bends twice that, 90 deg at most (paper, III.A).
    max_bend: float = parameter(
        math.pi / 4,
        "largest beta at each of a module's two balls",
        "rad",
        least=0.01,
        most=math.pi / 4,
    )
    travel: list[float] = parameter(
        [-0.050, 0.110],
        "least and largest translation s",
        "m",
        least=-0.5,
        most=0.5,
        shape=(2,),
    )
    tool_offset: float = parameter(
        3.0e-3,
        "l, from O3 (2 h past the last ball centre) to the tool",
        "m",
        least=0.0,
        most=0.05,
    )
    tool_radius: float = parameter(
        4.0e-3,
        "of the ball that the rotating wire ring sweeps",
        "m",
        least=0.0,
        most=0.02,
    )
    body_radius: float = parameter(
        4.0e-3,
        "of plates and sheath; the paper's are 8 mm wide",
        "m",
        least=5e-4,
        most=0.02,
    )
    # Nine different holes are needed.
    first_azimuths: list[float] = parameter(
        [0.0, math.radians(40.0), math.radians(80.0)],
        "of the first wire of each module; the others follow at 120 and 240 deg",
        "rad",
        least=-2 * math.pi,
        most=2 * math.pi,
        shape=(MODULES,),
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

    def rules(self) -> Rules:
        """What a robot that can be built and driven keeps to.

        Wires and rims must not be pinched, lengths must mean one posture, and nine
        wires need nine holes.
        """
        t = math.tan(self.max_bend / 2)
        h, d, R = self.half_pitch, self.face, self.ball_radius
        low, high = self.travel
        yield low < high, "travel", "[s_min, s_max], rising"
        balls = f">= ball_radius R={R:g} m, or the balls of a module overlap"
        yield h >= R, "half_pitch", balls
        told = f"< 2 half_pitch={2 * h:g} m, or there is no room between plates"
        yield d > 0.0, "plate_thickness", told
        rim = d / max(R, self.body_radius)
        told = (
            f"tan(max_bend/2)={t:.4f} < d/r={rim:.4f} with d=h-e/2={d:g} m, or plates "
            f"touch at the rim; nearest: max_bend={2 * math.atan(rim):.4f}"
        )
        yield t < rim, "max_bend", told
        one = R / (2 * d)
        told = (
            f"tan(max_bend/2)={t:.4f} < R/(2d)={one:.4f} with d=h-e/2={d:g} m, or two "
            "postures share wire lengths and the wires cannot all be taut; nearest: "
            f"max_bend={2 * math.atan(one):.4f} or "
            f"half_pitch={R / (2 * t) + self.plate_thickness / 2:g}"
        )
        yield t < one, "max_bend", told
        turn = 2 * math.pi
        holes = sorted(phi % turn for row in self.azimuths() for phi in row)
        after = [*holes[1:], holes[0] + turn]
        gap = min(b - a for a, b in zip(holes, after, strict=True))
        told = f"wires at least {math.degrees(LEAST_GAP):.0f} deg apart, two are "
        told += f"{math.degrees(gap):.1f}; nearest: 0, 40 and 80 deg"
        yield gap >= LEAST_GAP, "first_azimuths", told

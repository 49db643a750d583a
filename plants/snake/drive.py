"""What holds the snake's joints: gains of the wire drums, or the wires' stiffness."""

from dataclasses import dataclass

from systems.common.parameter import Rules, parameter

LAG = 0.1
"""Of a servo behind its set-point at most, in s."""


@dataclass
class SnakeDriveParams:
    """Masses and stiffness of the snake.

    With drums the wires are as stiff as their drums hold them: a spring on each
    of a module's two angles, implicit in the integrator. The default equals
    steel wires of 2e4 N/m (0.3 mm, some 350 mm long) seen from a module,
    `wire_stiffness` times 3/2 (2 R)^2.
    """

    kp: float = parameter(
        1.0, "stiffness of a and b of each module", "N m/rad", least=0.01, most=100.0
    )
    kd: float = parameter(4.0e-3, "their damping", "N m s/rad", above=0.0, most=1.0)
    travel_kp: float = parameter(
        4.0e4, "stiffness of the translation", "N/m", least=1e3, most=1e7
    )
    travel_kd: float = parameter(80.0, "its damping", "N s/m", above=0.0, most=1e5)
    friction: float = parameter(
        1.0e-5,
        "viscous, of each ball about either axis",
        "N m s/rad",
        above=0.0,
        most=0.01,
    )
    ball_mass: float = parameter(
        4.0e-4, "of one drilled titanium ball", "kg", least=1e-6, most=0.1
    )
    plate_mass: float = parameter(3.0e-4, "of one plate", "kg", least=1e-6, most=0.1)
    tool_mass: float = parameter(
        5.0e-4, "of the wire ring and its shank", "kg", least=1e-6, most=0.1
    )
    carriage_mass: float = parameter(
        0.05, "of what the translation moves besides", "kg", least=1e-3, most=10.0
    )
    wire_stiffness: float = parameter(
        2.0e4, "of one elastic wire", "N/m", least=1e3, most=1e6
    )
    pretension: float = parameter(
        0.0,
        "T_0 to which a load cell's loop winds a looser wire; of statics alone",
        "N",
        least=0.0,
        most=50.0,
    )
    wire_damping: float = parameter(
        2.0, "of one elastic wire", "N s/m", above=0.0, most=1e3
    )

    def rules(self) -> Rules:
        """Servos must not lag by more than a motion's own time."""
        slow = f"at most {LAG:g} s times its stiffness, or the servo lags by more"
        yield self.lead <= LAG, "kd", slow
        yield self.travel_lead <= LAG, "travel_kd", slow

    @property
    def lead(self) -> float:
        """Time in s by which the drums' servo lags a moving set-point: kd / kp.

        Set-points are sent for that much later, instead of their velocity, which
        Drake 1.58's CENIC applies with the wrong sign.
        """
        return self.kd / self.kp

    @property
    def travel_lead(self) -> float:
        """As `lead`, for the translation, in s."""
        return self.travel_kd / self.travel_kp

"""What holds the snake's joints: gains of the wire drums, or the wires' stiffness."""

from dataclasses import dataclass


@dataclass
class SnakeDriveParams:
    """Masses and stiffness of the snake. SI units.

    With drums the wires are as stiff as their drums hold them: a spring on each
    of a module's two angles, implicit in the integrator. The default equals
    steel wires of 2e4 N/m (0.3 mm, some 350 mm long) seen from a module,
    `wire_stiffness` times 3/2 (2 R)^2.

    Attributes:
        kp: Stiffness of a and b of each module in Nm/rad.
        kd: Their damping in Nm s/rad.
        travel_kp: Stiffness of the translation in N/m.
        travel_kd: Its damping in N s/m.
        friction: Viscous friction of each ball, about either axis, in Nm s/rad.
        ball_mass: Of one drilled titanium ball in kg.
        plate_mass: Of one plate in kg.
        tool_mass: Of the wire ring and its shank in kg.
        carriage_mass: Of what the translation moves besides, in kg.
        wire_stiffness: Of one wire in N/m, for elastic wires.
        wire_damping: Of one wire in N s/m, for elastic wires.
    """

    kp: float = 1.0
    kd: float = 4.0e-3
    travel_kp: float = 4.0e4
    travel_kd: float = 80.0
    friction: float = 1.0e-5
    ball_mass: float = 4.0e-4
    plate_mass: float = 3.0e-4
    tool_mass: float = 5.0e-4
    carriage_mass: float = 0.05
    wire_stiffness: float = 2.0e4
    wire_damping: float = 2.0

    def check(self) -> "SnakeDriveParams":
        """Returns itself if all values are positive.

        Raises:
            ValueError: Naming the value that is not, and the default.
        """
        for name, value in vars(self).items():
            if not value > 0.0:
                default = getattr(SnakeDriveParams(), name)
                raise ValueError(
                    f"{name}={value} must be > 0; the default is {default}"
                )
        return self

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

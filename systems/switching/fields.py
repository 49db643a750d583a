"""The potentials of the thesis and their anti-gradients, as pure functions.

Each function takes the robot's place relative to the centre of its potential,
q = p - o, in metres, and returns a potential or an anti-gradient (q_x, q_y
components). The equations are those of "Path planning locale per robot mobili
basato su potenziali artificiali alternati", chapter 2, and of O. Khatib,
"Real-time obstacle avoidance for manipulators and mobile robots", IJRR 5(1),
1986, for the repulsive one, which the thesis prints without its square.
"""

from math import acos, atan2, cos, hypot, inf, sin, sqrt

from systems.common.compiled import compiled

Vector = tuple[float, float]


def attractive_potential(qx: float, qy: float) -> float:
    """Half of the squared distance to the goal [m^2] (equation 1)."""
    return 0.5 * (qx * qx + qy * qy)


def attractive_field(qx: float, qy: float) -> Vector:
    """The vector to the goal [m] (equation 2, printed there as its length)."""
    return -qx, -qy


def printed_attractive_field(qx: float, qy: float) -> Vector:
    """Equation 2 as printed: a length, which has no direction, for both components."""
    d = hypot(qx, qy)
    return d, d


def repulsive_potential(rho: float, rho_0: float, gain: float = 1.0) -> float:
    """Khatib's repulsive potential of the distance to an obstacle's surface.

    Args:
        rho: Distance to the surface [m], > 0.
        rho_0: Distance within which the obstacle repels [m].
        gain: Factor eta of Khatib's equation.
    """
    if rho >= rho_0:
        return 0.0
    return 0.5 * gain * (1.0 / rho - 1.0 / rho_0) ** 2


def repulsive_field(
    qx: float, qy: float, surface: float, rho_0: float, gain: float = 1.0
) -> Vector:
    """Anti-gradient of `repulsive_potential`, away from the obstacle.

    Args:
        qx: Robot relative to the obstacle's centre, x [m].
        qy: The same, y [m].
        surface: Distance from the centre at which rho is zero [m].
        rho_0: Distance rho within which the obstacle repels [m].
        gain: Factor eta of Khatib's equation.
    """
    d = hypot(qx, qy)
    rho = d - surface
    if rho >= rho_0 or d == 0.0:
        return 0.0, 0.0
    rho = max(rho, 1e-3 * rho_0)  # within the surface: as strong as at it
    size = gain * (1.0 / rho - 1.0 / rho_0) / (rho * rho)
    return size * qx / d, size * qy / d


def printed_repulsive_potential(d: float, eta: float) -> float:
    """Equation 3 as printed: no square, and the distance to the *centre*."""
    return 0.5 * (1.0 / d - 1.0 / eta) if d <= eta else 0.0


def printed_repulsive_field(qx: float, qy: float, eta: float) -> Vector:
    """Anti-gradient of equation 3 as printed: it jumps at d = eta."""
    d = hypot(qx, qy)
    if d > eta or d == 0.0:
        return 0.0, 0.0
    size = 0.5 / (d * d)
    return size * qx / d, size * qy / d


def helicoid_point(radius: float, xi: float, c: float) -> tuple[float, float, float]:
    """A point of the helicoid about the origin (equation 5) [m]."""
    return radius * cos(xi), radius * sin(xi), c * xi


def helicoid_potential(qx: float, qy: float, c: float) -> float:
    """The bypassing potential (equation 6), with atan2 for its arc tangent.

    It has many values: one turn changes it by 2 pi c, and the branch cut lies
    on the negative x axis. Only its gradient is smooth.
    """
    return c * atan2(qy, qx)


def helicoid_field(qx: float, qy: float, c: float) -> Vector:
    """Anti-gradient of the bypassing potential (equation 7).

    Its lines are circles about the obstacle and its size is |c| / d; c > 0
    leads clockwise, c < 0 counter-clockwise.
    """
    dd = qx * qx + qy * qy
    return c * qy / dd, -c * qx / dd


def involute_potential(qx: float, qy: float, rho: float, side: float) -> float:
    """The helicoid with a radial part, outside the safety circle.

    sqrt(d^2 - rho^2) - rho acos(rho / d) - side rho atan2(q_y, q_x): on the
    circle it is the helicoid with |c| = rho; its level lines outside are the
    circle's involutes, so that the way down is the straight tangent to it.

    Args:
        qx: Robot relative to the obstacle's centre, x [m].
        qy: The same, y [m].
        rho: Radius of the safety circle [m], at most the distance.
        side: +1 leads counter-clockwise about the obstacle, -1 clockwise.
    """
    d = hypot(qx, qy)
    if d < rho:
        return inf
    return sqrt(d * d - rho * rho) - rho * acos(rho / d) - side * rho * atan2(qy, qx)


@compiled
def involute_field(qx: float, qy: float, rho: float, side: float) -> Vector:
    """Anti-gradient of `involute_potential`, of unit size everywhere.

    Within the safety circle, where the potential does not exist, it leads out
    along a spiral that steepens with depth to 45 degrees.
    """
    d = hypot(qx, qy)
    nx, ny = qx / d, qy / d
    along, out = involute_components(d, rho)
    along *= side
    return out * nx - along * ny, out * ny + along * nx


@compiled
def involute_components(d: float, rho: float) -> tuple[float, float]:
    """Tangential and outward parts of the involute field at distance d."""
    if d >= rho:
        along = rho / d
        return along, -sqrt(1.0 - along * along)
    kappa = min(1.0, 4.0 * (rho - d) / rho)
    along = 1.0 / sqrt(1.0 + kappa * kappa)
    return along, kappa * along

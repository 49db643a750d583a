"""What stands where in the signals that the auto-guidance blocks exchange.

`robot_tool` (6): fulcrum p_WG, tip p_WP of the robot's instrument.
`estimate` (17) of a surgeon's tool: tip p_WP, v_WP, a_WP, fulcrum p_WG,
sigma_p, sigma_v, sigma_a, known (1 or 0), age of the last valid frame.
`guide` (12): p_WMR, p_WMO, rho, s, l/L, p_WMRf.
World frame, SI units.
"""

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, all_finite, xyz

ROBOT_TOOL_EXAMPLE = [0.0, 0.0, 0.0, 0.02, 0.0, -0.12]
"""A robot's instrument, 0.12 m inside."""

TARGET_EXAMPLE = [
    *(-0.05, 0.0, -0.12),
    *(0.005, 0.0, 0.0),
    *(0.0, 0.0, 0.0),
    *(-0.12, 0.0, 0.0),
    *(0.0003, 0.003, 0.05, 1.0, 0.0),
]
"""An estimate of the target tool S, drifting at 5 mm/s."""

OBSTACLE_EXAMPLE = [
    *(-0.02, 0.01, -0.1),
    *(0.0, -0.03, 0.0),
    *(0.0, 0.0, 0.0),
    *(0.0, 0.1, 0.0),
    *(0.0003, 0.003, 0.05, 1.0, 0.0),
]
"""An estimate of the obstacle tool O, crossing at 30 mm/s."""

CAMERA_EXAMPLE = [
    *(-0.01, -0.05, -0.08),
    *(0.0, 0.0, 0.0),
    *(0.0, 0.0, 0.0),
    *(0.02, -0.1, 0.0),
    *(0.0, 0.0, 0.0, 1.0, 0.0),
]
"""What is known of the endoscope, at rest; same shape as an estimate."""

VIEW_CONE_EXAMPLE = [0.02, -0.1, 0.0, -0.41, 0.55, -0.727, 0.6]
"""A view cone: apex, axis, half angle."""

GUIDE_EXAMPLE = [
    *(0.012, 0.0, -0.072),
    *(-0.01, 0.02, -0.08),
    *(0.03, 0.6, 0.7),
    *(-0.03, 0.0, -0.072),
]
"""A guide point 0.03 m from the obstacle tool."""


@compiled
def velocity(estimate: Numbers) -> Vector:
    """v_WP of an estimate, m/s."""
    return xyz(estimate, 3)


@compiled
def acceleration(estimate: Numbers) -> Vector:
    """a_WP of an estimate, m/s^2."""
    return xyz(estimate, 6)


@compiled
def fulcrum(estimate: Numbers) -> Vector:
    """p_WG of an estimate, m."""
    return xyz(estimate, 9)


@compiled
def usable(estimate: Numbers) -> bool:
    """True if the estimator knows the tool and gives numbers only."""
    return estimate[15] > 0.5 and all_finite(estimate)

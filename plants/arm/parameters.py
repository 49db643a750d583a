"""The arm's published limits, and where it stands and waits in the operating room."""

import numpy as np

JOINTS = 7
POSITION_LIMIT = np.radians([177.0, 91.0, 174.0, 137.0, 255.0, 165.0, 255.0])
"""Joint limits in rad, the same on both sides (7)."""
SPEED_LIMIT = np.radians([57.0, 57.0, 114.0, 114.0, 360.0, 360.0, 360.0])
"""Joint speed limits in rad/s (7). Drake does not enforce them: planners must."""
TORQUE_LIMIT = np.array([158.0, 158.0, 68.0, 68.0, 17.0, 17.0, 17.0])
"""Joint torque limits in Nm (7). The PD actuators keep them under CENIC."""
FRICTION = np.array([10.0, 10.0, 5.0, 5.0, 2.0, 2.0, 2.0])
"""Viscous joint friction in Nm s/rad (7)."""

BASE_POSITION = [-0.66, 0.0, 0.0]
"""p_WB in m: the base stands upright beside the patient, level with the wall, its x
axis towards the trocar of the robot, which lies near the world's origin."""
READY_POSTURE = [0.0, 0.707849, 0.0, 1.562042, 0.0, 0.871702, 0.0]
"""Shaft straight down through the world's origin, tip 120 mm inside (7, in rad):
elbow up, and every joint far from its limits."""

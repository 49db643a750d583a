"""The da Vinci's patient-side manipulator: its tip from its six joints.

Modified Denavit-Hartenberg (Craig): each row turns by alpha about x and shifts by a
along it, then turns by theta about z and shifts by d along it. The first three joints
pivot about, and slide through, the remote centre, the origin. Lengths are those of the
dVRK's documentation, of a large needle driver.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

CENTRE, TOOL, PITCH_TO_YAW, YAW_TO_TIP = 0.4318, 0.4162, 0.0091, 0.0102
ROWS = (
    (0.0, pi / 2, 0.0, pi / 2),
    (0.0, -pi / 2, 0.0, -pi / 2),
    (0.0, pi / 2, -CENTRE, 0.0),  # q3 adds to d, all others to theta
    (0.0, 0.0, TOOL, 0.0),
    (0.0, -pi / 2, 0.0, -pi / 2),
    (PITCH_TO_YAW, -pi / 2, 0.0, -pi / 2),
    (0.0, -pi / 2, YAW_TO_TIP, 0.0),
)
"""a [m], alpha [rad], d [m], theta [rad]; the last one is the tip's."""
INSERTION = 2
"""The joint that slides."""


def psm_tip(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the tip is in the frame of the remote centre, in m, shape (n, 3).

    Args:
        q: Joints in rad, the third in m, shape (n, 6).
    """
    pose = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for number, (a, alpha, d, theta) in enumerate(ROWS):
        joint = q[:, number] if number < q.shape[1] else np.zeros(len(q))
        turn = theta + (0.0 if number == INSERTION else 1.0) * joint
        slide = d + (joint if number == INSERTION else 0.0) * np.ones(len(q))
        c, s = np.cos(turn), np.sin(turn)
        ca, sa = np.cos(alpha), np.sin(alpha)
        step = np.zeros((len(q), 4, 4))
        step[:, 0, :2] = np.stack([c, -s], axis=1)
        step[:, 0, 3] = a
        step[:, 1] = np.stack([s * ca, c * ca, np.full(len(q), -sa), -slide * sa], 1)
        step[:, 2] = np.stack([s * sa, c * sa, np.full(len(q), ca), slide * ca], 1)
        step[:, 3, 3] = 1.0
        pose = pose @ step
    return pose[:, :3, 3]

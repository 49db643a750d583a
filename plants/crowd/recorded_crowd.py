"""People that others filmed, `obsmat.txt` of ETH and UCY, as obstacles.

Rows of frame, id, x, z, y, v_x, v_z, v_y, in m, y on the floor; 2.5 rows a second of
each, whatever the frames' numbers. Whoever comes or goes within the time walks on
straight, before and after, as they did when they were seen.
"""

from pathlib import Path

import numpy as np

from plants.crowd.obstacle_motion import ObstacleParams
from plants.crowd.signals import CAPACITY
from systems.common.archive import read_regular

RATE = 2.5
"""Of the rows of a person, in 1/s."""
LARGEST = 64_000_000
"""Of a file, in bytes."""
FASTEST = 5.0
"""No person walks so fast [m/s]."""


def load_obsmat(
    path: Path, start: float, duration: float, radius: float = 0.3
) -> list[ObstacleParams]:
    """Everyone who is seen for a second at least of a time, at most `CAPACITY`.

    Args:
        path: The file.
        start: Of the time, in s since the first frame.
        duration: Of it, in s.
        radius: Of a person, in m.

    Raises:
        ValueError: If the file is none, or nobody is there then.
    """
    text = read_regular(path, LARGEST).decode("utf-8-sig")
    table = np.array(
        [line.split() for line in text.splitlines() if line.strip()], float
    )
    if table.ndim != 2 or table.shape[1] != 8 or not np.isfinite(table).all():
        raise ValueError(f"a table {table.shape}: expected finite numbers, n x 8")
    frames = np.unique(table[:, 0])
    if len(frames) < 2:
        raise ValueError(f"{len(frames)} frames: expected at least two")
    times = (table[:, 0] - frames[0]) / np.diff(frames).min() / RATE - start
    people = []
    for person in np.unique(table[:, 1]):
        there = (table[:, 1] == person) & (times >= 0.0) & (times <= duration)
        t, way = times[there], table[there][:, [2, 4]]
        if len(t) < round(RATE):
            continue
        before, after = (way[1] - way[0]) * RATE, (way[-1] - way[-2]) * RATE
        if t[0] > 0.0:
            way, t = np.vstack([way[0] - before * t[0], way]), np.append(0.0, t)
        if t[-1] < duration:
            end = way[-1] + after * (duration - t[-1])
            way, t = np.vstack([way, end]), np.append(t, duration)
        speeds = np.linalg.norm(np.diff(way, axis=0), axis=1) / np.diff(t)
        if speeds.max() > FASTEST:
            raise ValueError(f"person {person:.0f} walks at {speeds.max():.1f} m/s")
        people.append((len(t), t.round(4).tolist(), way.round(4).tolist()))
    if not people:
        raise ValueError(f"nobody is there from {start} s on for {duration} s")
    people.sort(key=lambda one: -one[0])
    return [
        ObstacleParams("waypoints", radius, times=t, points=points)
        for _, t, points in people[:CAPACITY]
    ]

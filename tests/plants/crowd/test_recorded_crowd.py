"""Filmed crowds in a small file of the form of ETH's and UCY's."""

import numpy as np
import pytest

from plants.crowd.obstacle_motion import obstacle_at
from plants.crowd.recorded_crowd import load_obsmat
from systems.common.parameter import check


def obsmat(path, step=6):
    """Two people who walk straight on, one of whom comes later and goes earlier."""
    rows = []
    for k in range(30):
        rows.append((780 + step * k, 1, 0.4 * k, 0.0, 2.0, 1.0, 0.0, 0.0))
        if 10 <= k < 20:
            rows.append((780 + step * k, 2, 5.0, 0.0, 0.2 * k, 0.0, 0.0, 0.5))
    path.write_text("\n".join("  ".join(f"{v:.7e}" for v in row) for row in rows))


@pytest.mark.parametrize("step", [6, 10])
def test_people_walk_as_they_were_filmed(tmp_path, step):
    obsmat(tmp_path / "obsmat.txt", step)
    one, two = load_obsmat(tmp_path / "obsmat.txt", 0.0, 11.0)
    for person in (one, two):
        check(person, "obstacles")
    for t in (0.0, 3.1, 10.9):
        seen = obstacle_at(one, t)
        assert (seen.x, seen.y) == pytest.approx((t, 2.0), abs=1e-3)
        assert (seen.v_x, seen.v_y) == pytest.approx((1.0, 0.0), abs=1e-3)
        late = obstacle_at(two, t)  # before and after it walks straight on
        assert (late.x, late.y) == pytest.approx((5.0, 0.5 * t), abs=1e-3)


def test_a_part_of_it(tmp_path):
    obsmat(tmp_path / "obsmat.txt")
    (one,) = load_obsmat(tmp_path / "obsmat.txt", 8.0, 3.0)
    assert obstacle_at(one, 0.0).x == pytest.approx(8.0, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1 2 3\n4 5 6", "expected finite numbers, n x 8"),
        ("0 1 0 0 0 0 0 0", "1 frames"),
        ("\n".join(f"{6 * k} 1 {9 * k} 0 0 0 0 0" for k in range(9)), "walks at 22.5"),
    ],
)
def test_what_is_none_is_refused(tmp_path, text, told):
    path = tmp_path / "obsmat.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=told):
        load_obsmat(path, 0.0, 10.0)
    obsmat(path)
    with pytest.raises(ValueError, match="nobody"):
        load_obsmat(path, 100.0, 10.0)
    assert np.isfinite(obstacle_at(load_obsmat(path, 0.0, 5.0)[0], 9.0).x)

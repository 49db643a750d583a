"""Other people's recordings, in small files of the same form."""

import numpy as np
import pytest

from plants.surgeon.foreign import ARMS, READERS, dvrk, jigsaws, placed, plus, summary
from plants.surgeon.psm import PITCH_TO_YAW, TOOL, YAW_TO_TIP, psm_tip


def table(rows, seed=0):
    rng = np.random.default_rng(seed)
    return 0.05 + 1e-3 * np.cumsum(rng.normal(size=(rows, 76)), axis=0)


@pytest.mark.parametrize("number", range(len(ARMS)))
def test_jigsaws_raw_and_csv(tmp_path, number):
    rows = table(40)
    raw, csv = tmp_path / "Knot_Tying_B001.txt", tmp_path / "knot.csv"
    raw.write_text("\n".join("   ".join(f"{v: .6f}" for v in row) for row in rows))
    header = ",".join(f"column {k}" for k in range(76))
    csv.write_text(header + "\n" + "\n".join(",".join(map(str, r)) for r in rows))
    for path in (raw, csv):
        motion = jigsaws(path, ARMS[number])
        first = 19 * number
        np.testing.assert_allclose(motion.points, rows[:, first : first + 3], atol=1e-6)
        np.testing.assert_allclose(np.diff(motion.times), 1 / 30)
    with pytest.raises(ValueError, match="arm='left'"):
        jigsaws(raw, "left")


def test_a_psm_turns_and_slides_through_its_remote_centre():
    rng = np.random.default_rng(1)
    q = rng.uniform(-0.8, 0.8, (50, 6))
    q[:, 2] = rng.uniform(0.05, 0.2, 50)
    q[:, 4:] = 0.0  # the wrist straight: tip, shaft and centre are in a line
    out, far = q.copy(), psm_tip(q)
    out[:, 2] += 0.03
    way = psm_tip(out) - far
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.03)
    assert np.abs(np.cross(way, far)).max() < 1e-12
    straight = q[:, 2] - 0.4318 + TOOL + PITCH_TO_YAW + YAW_TO_TIP
    np.testing.assert_allclose(np.linalg.norm(far, axis=1), straight)
    bent = q.copy()
    bent[:, 4:] = 0.3  # the wrist bends at the end of the shaft
    ends = psm_tip(bent) - far
    assert (np.linalg.norm(ends, axis=1) < 2.0 * (PITCH_TO_YAW + YAW_TO_TIP)).all()


def test_dvrk_joints(tmp_path):
    q = np.linspace([0.1, 0.0, 0.1, 0.0, 0.0, 0.0], [0.2, 0.1, 0.12, 1.0, 0.1, 0.1], 20)
    np.save(tmp_path / "q.npy", q)
    motion = dvrk(tmp_path / "q.npy")
    np.testing.assert_allclose(motion.points, psm_tip(q))
    np.save(tmp_path / "deg.npy", np.degrees(q))
    with pytest.raises(ValueError, match="expected rad"):
        dvrk(tmp_path / "deg.npy")


def sequence(path, frames, nrrd=False):
    """A tracker sequence of PLUS: (time, x in mm, status) of each frame."""
    equals = ":=" if nrrd else " = "
    lines = (
        ["NRRD0004", "dimension: 4"] if nrrd else ["ObjectType = Image", "NDims = 3"]
    )
    for k, (time, x, status) in enumerate(frames):
        pose = f"1 0 0 {x} 0 1 0 20 0 0 1 -30 0 0 0 1"
        for key, value in {
            "ProbeToTrackerTransform": pose,
            "ProbeToTrackerTransformStatus": status,
            "Timestamp": time,
        }.items():
            lines.append(f"Seq_Frame{k:04}_{key}{equals}{value}")
    last = "" if nrrd else "ElementDataFile = LOCAL"
    path.write_bytes("\n".join([*lines, last, ""]).encode() + bytes(range(256)))


@pytest.mark.parametrize("nrrd", [False, True])
def test_plus_respects_status_and_keeps_gaps(tmp_path, nrrd):
    path = tmp_path / ("a.igs.nrrd" if nrrd else "a.igs.mha")
    frames = [(0.1 * k, 10.0 * k, "OK") for k in range(12)]
    for k in (5, 6, 7, 8):
        frames[k] = (0.1 * k, 999.0, "INVALID")
    sequence(path, frames, nrrd)
    motion = plus(path)
    assert len(motion.times) == 8
    np.testing.assert_allclose(motion.points[:, 0].max(), 0.11)
    np.testing.assert_allclose(motion.points[0], [0.0, 0.02, -0.03])
    assert motion.gaps == [(pytest.approx(0.4), pytest.approx(0.9))]
    assert "1 gaps, 0.50 s" in summary(motion)
    with pytest.raises(ValueError, match="it has ProbeToTracker"):
        plus(path, "StylusToTracker")


def test_a_motion_is_placed():
    motion = placed(jigsaws_like(), [0.01, 0.02, -0.1], np.pi / 2)
    np.testing.assert_allclose(motion.points.mean(axis=0), [0.01, 0.02, -0.1])
    np.testing.assert_allclose(
        np.ptp(motion.points, axis=0), [0.0, 0.03, 0.0], atol=1e-9
    )


def jigsaws_like():
    from plants.surgeon.foreign import Motion

    ways = np.linspace([0.0, 0.0, 0.0], [0.03, 0.0, 0.0], 31)
    return Motion(np.arange(31) / 30, ways)


@pytest.mark.parametrize("kind", READERS)
def test_what_is_none_is_refused(tmp_path, kind):
    path = tmp_path / "none.txt"
    for text in ("", "1 2 3\n4 5 6\n", "a\nb\n", "nan " * 76 + "\n" + "0 " * 76):
        path.write_text(text)
        with pytest.raises(ValueError):
            READERS[kind](path)

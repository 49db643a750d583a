"""Recordings: what is read, what is refused, and the one that ships."""

import os
from pathlib import Path

import numpy as np
import pytest

from plants.surgeon.recording import (
    SWEEP_SEED,
    SWEEP_VIA,
    load_recording,
    save_recording,
    synthesize_sweep,
)

SHIPPED = (
    Path(__file__).parents[3] / "diagrams/gauze/recordings/obstacle_sweep.csv"
).resolve()


def test_round_trip(tmp_path):
    times = np.array([0.0, 0.5, 1.25])
    points = np.array([[0.01, -0.02, -0.1], [0.011, 0.0, -0.11], [0.0, 0.0, -0.12]])
    save_recording(tmp_path / "r.csv", times, points)
    read_times, read_points = load_recording(tmp_path / "r.csv")
    np.testing.assert_allclose(read_times, times, atol=1e-4)
    np.testing.assert_allclose(read_points, points, atol=1e-6)


def test_columns_may_stand_in_any_order_beside_others(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("frame, z, y, x, t\n7,-0.1,0.2,0.3,0\n8,-0.11,0.2,0.3,0.1\n\n")
    times, points = load_recording(path)
    assert times.tolist() == [0.0, 0.1]
    assert points[0].tolist() == [0.3, 0.2, -0.1]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_is_no_part_of_the_header(tmp_path, encoding):
    path = tmp_path / "r.csv"
    path.write_text("t,x,y,z\n0,0.3,0.2,-0.1\n0.5,0.3,0.2,-0.2\n", encoding=encoding)
    times, points = load_recording(path)
    assert times.tolist() == [0.0, 0.5]
    assert points[1].tolist() == [0.3, 0.2, -0.2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "column t, x, y, z missing"),
        ("t,x,y\n0,0,0\n", "column z missing.*expected 't,x,y,z'"),
        ("t,t_ms,x,y,z\n0,0,0,0,0\n1,1,0,0,0\n", "column t .*more than once"),
        ("t,x,y,z\n0,0,0,-0.1\n1,0,zero,-0.1\n", "line 3.*expected a number"),
        ("t,x,y,z\n0,0,0,-0.1\n1,0,0\n", "line 3.*expected a number"),
        ("t,x,y,z\n0,0,0,-0.1\n33,0,0,-0.1\n", "33 s apart.*t_ms"),
        ("t,x,y,z\n0,0,0,nan\n1,0,0,-0.1\n", "line 2.*not finite"),
        ("t,x,y,z\n0,0,0,-0.1\n0.2,0,0,-0.1\n0.1,0,0,-0.1\n", "line 4.*increase"),
        ("t,x,y,z\n0,0,0,-0.1\n0,0,0,-0.1\n", "line 3.*increase"),
        ("t,x,y,z\n0,0,0,-0.1\n", "too few"),
        ("t,x,y,z\n0,10,20,-120\n1,10,20,-120\n", "in mm"),
    ],
)
def test_bad_recording_is_refused(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"(?s)bad\.csv.*{message}"):
        load_recording(path)


@pytest.mark.parametrize(
    ("header", "epoch", "second", "metre"),
    [("t,x,y,z", 1.7e9, 1, 1), ("t_ms,x_mm,y,z_m", 0, 1000, 1000)]
    + [("t_ns,x,y,z", 1.7e18, 10**9, 1), ("t_s,x_m,y,z", 2.5, 1, 1)],
)
def test_time_begins_at_the_first_sample_in_the_header_s_units(
    header, epoch, second, metre, tmp_path
):
    path = tmp_path / "r.csv"
    rows = [f"{epoch + k * 0.5 * second:.3f},{0.3 * metre},0.2,-0.1" for k in range(3)]
    path.write_text("\n".join([header, *rows]) + "\n")
    times, points = load_recording(path)
    np.testing.assert_allclose(times, [0.0, 0.5, 1.0], atol=1e-6)
    np.testing.assert_allclose(points, np.tile([0.3, 0.2, -0.1], (3, 1)), atol=1e-12)


def test_only_regular_files_are_read_and_none_is_quoted(tmp_path):
    pipe, secret, huge = (tmp_path / name for name in ("pipe", "secret", "huge"))
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(ValueError, match="no regular file"):
            load_recording(path)
    with huge.open("wb") as stream:
        stream.truncate(10**10)
    with pytest.raises(ValueError, match="10000000000 bytes, expected at most"):
        load_recording(huge)
    for text in ("admin:x:0\nadmin:hunter2", "t,x,y,z\nhunter2,hunter2"):
        secret.write_text(text)
        with pytest.raises(ValueError, match="expected") as refusal:
            load_recording(secret)
        assert "hunter2" not in str(refusal.value)
        assert "admin" not in str(refusal.value)


def test_unreadable_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        load_recording(tmp_path / "missing.csv")
    with pytest.raises(ValueError, match="cannot be read"):
        load_recording(tmp_path)
    binary = tmp_path / "image.csv"
    binary.write_bytes(bytes([0xFF, 0xD8, 0xFF, 0xE0]) * 9)
    with pytest.raises(ValueError, match="cannot be read"):
        load_recording(binary)


def test_shipped_recording_is_the_generator_s(tmp_path):
    save_recording(tmp_path / "again.csv", *synthesize_sweep(SWEEP_SEED, SWEEP_VIA))
    _, again = load_recording(tmp_path / "again.csv")
    times, shipped = load_recording(SHIPPED)
    np.testing.assert_allclose(again, shipped, atol=2e-6)
    assert times[-1] == pytest.approx(20.0)
    assert SHIPPED.stat().st_size < 40_000


def test_shipped_motion_has_a_surgeon_s_speeds():
    times, path = synthesize_sweep(SWEEP_SEED, SWEEP_VIA, rate=240.0, tremor_rms=0.0)
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=1) / np.diff(times)
    # Mean about 10 mm/s, 95th percentile 36, 99th 57 (reference page, section 5).
    assert speeds.mean() == pytest.approx(0.010, rel=0.1)
    assert np.percentile(speeds, 95) == pytest.approx(0.036, rel=0.1)
    assert np.percentile(speeds, 99) == pytest.approx(0.057, rel=0.1)
    # 98.9 % of voluntary power lies below 2 Hz.
    velocity = np.diff(path, axis=0) * 240.0
    power = (np.abs(np.fft.rfft(velocity, axis=0)) ** 2).sum(axis=1)
    hertz = np.fft.rfftfreq(len(velocity), 1 / 240.0)
    assert power[hertz < 2.0].sum() > 0.98 * power.sum()


def test_seed_decides():
    one = synthesize_sweep(1, SWEEP_VIA)[1]
    np.testing.assert_array_equal(one, synthesize_sweep(1, SWEEP_VIA)[1])
    assert np.abs(one - synthesize_sweep(2, SWEEP_VIA)[1]).max() > 0.005

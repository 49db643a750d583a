"""DICOM's SEG and RTSTRUCT: place, shape and names are those that were written."""

import numpy as np
import pytest
import yaml

from diagrams.common.results import results, save_scenario
from diagrams.resection.scenario import ResectionScenario
from plants.tissue import mask, mask_reader
from plants.tissue.image import MaskError
from plants.tissue.labels import CRITICAL, TUMOUR
from plants.tissue.mask import load_mask
from plants.tissue.mask_labels import MaskLabels
from tests.plants.tissue.dicom_files import (
    outlines,
    slices,
    write,
    write_seg,
    write_structures,
)
from tests.plants.tissue.mask_files import TURN, ellipsoid

SIZES, SPACING, ORIGIN = (24, 22, 10), (0.5, 0.7, 3.0), (-12.5, 40.0, 7.25)
RIGHT = TURN * [1.0, 1.0, np.linalg.det(TURN)]
"""A turned frame, right-handed as DICOM's normal makes it."""


def read(path, **wanted):
    """What is in a file, in this process."""
    wanted = MaskLabels(**wanted)
    return mask.tissue_of(mask_reader.read(path, wanted), wanted.component, path.name)


def where(labels, spacing=SPACING, direction=RIGHT, origin=ORIGIN):
    """Where the voxels of a mask lie, in m and sorted."""
    p = np.argwhere(labels) * np.array(spacing) @ np.array(direction).T + origin
    return ordered(1e-3 * p)


def ordered(points):
    return points[np.lexsort(np.round(points, 6).T)]


@pytest.fixture(scope="module")
def ct():
    return slices(SIZES, SPACING, RIGHT, ORIGIN)


@pytest.fixture(scope="module")
def shapes():
    tumour = ellipsoid(SIZES).astype(bool)
    tumour[11:13, 10:12, 4:6] = False  # a hole
    vessel = np.zeros(SIZES, bool)
    vessel[11:14, :, 4] = True
    return {"GTV 1": tumour, "Vessel": vessel, "Body": np.ones(SIZES, bool)}


@pytest.fixture(scope="module")
def drawn(ct, shapes, tmp_path_factory):
    """RTSTRUCT in a folder beside its CT's."""
    folder = tmp_path_factory.mktemp("patient")
    write(folder / "ct", ct)
    (folder / "rt").mkdir()
    lines = [outlines(shape, ct) for shape in shapes.values()]
    return write_structures(folder / "rt" / "RS.dcm", ct, list(shapes), lines)


@pytest.fixture(scope="module")
def segmented(ct, shapes, tmp_path_factory):
    return write_seg(tmp_path_factory.mktemp("seg") / "seg", ct, shapes)


@pytest.mark.parametrize("kind", ["drawn", "segmented"])
def test_segments_lie_where_they_were_written(kind, shapes, request):
    """By name or number, holes kept; through a process of its own."""
    path = request.getfixturevalue(kind)
    tissue = load_mask(path, MaskLabels(tumour=["gtv 1"], critical=[2]))
    own = shapes["GTV 1"] & ~shapes["Vessel"]
    np.testing.assert_allclose(ordered(tissue.points(TUMOUR)), where(own), atol=1e-8)
    vessel = ordered(tissue.points(CRITICAL))
    np.testing.assert_allclose(vessel, where(shapes["Vessel"]), atol=1e-8)
    both = 1.05 * np.count_nonzero(shapes["GTV 1"] & shapes["Vessel"])
    assert f"{both:.3g} mm3 are tumour and critical" in tissue.notes[0]
    assert tissue.grid.sizes == SIZES


@pytest.mark.parametrize("kind", ["drawn", "segmented"])
@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({}, r"it has 1 'GTV 1', 2 'Vessel', 3 'Body': name the tumour's with labels"),
        ({"tumour": ["GVT1"]}, r"tumour='GVT1': it has no such.*did you mean 'GTV 1'"),
        ({"tumour": [9]}, r"labels\.tumour=9: it has no such segment.*nearest is 3"),
        ({"tumour": [1], "critical": ["gtv 1"]}, r"segments \[1\] are named as tumour"),
        ({"threshold": 0.5}, "it has segments, and no values"),
        ({"tumour": [1], "critical": [3]}, "empty, no voxel is tumour: 1 'GTV 1'"),
    ],
)
def test_wishes_that_a_file_does_not_have(kind, wanted, message, request):
    with pytest.raises(MaskError, match=message):
        read(request.getfixturevalue(kind), **wanted)


@pytest.mark.parametrize("kind", ["FRACTIONAL", "LABELMAP"])
def test_other_kinds_of_seg(kind, ct, shapes, tmp_path):
    shape = {"GTV": shapes["GTV 1"]}
    if kind == "FRACTIONAL":
        shape = {"GTV": 0.8 * shape["GTV"] + 0.2}
    path = write_seg(tmp_path / "s.dcm", ct, shape, kind)
    tissue = read(path)  # the only one there is
    found = ordered(tissue.points(TUMOUR))
    np.testing.assert_allclose(found, where(shapes["GTV 1"]), atol=1e-8)
    assert any("fractions" in note for note in tissue.notes) == (kind == "FRACTIONAL")


def test_empty_frames_that_are_left_out_are_no_border(ct, tmp_path):
    shape = np.zeros(SIZES, bool)
    shape[8:16, 8:16, 3:6] = True
    assert read(write_seg(tmp_path / "s", ct, {"T": shape})).notes == []
    shape[..., :] = shape[..., 4:5]
    assert "border" in read(write_seg(tmp_path / "s", ct, {"T": shape})).notes[0]


def test_two_of_one_name(ct, shapes, tmp_path):
    path = write_structures(
        tmp_path / "r", ct, ["T", "t "], [outlines(s, ct) for s in [shapes["Body"]] * 2]
    )
    write(tmp_path, ct)
    with pytest.raises(MaskError, match=r"2 are called so: expected one of \[1, 2\]"):
        read(path, tumour=["T"])


def test_a_run_keeps_the_images_too(drawn, tmp_path):
    scenario = ResectionScenario(mask=str(drawn), labels=MaskLabels(tumour=["GTV 1"]))
    with results(tmp_path / "out") as into:
        saved = save_scenario(scenario, into)
    again = yaml.safe_load(saved.read_text())
    kept = saved.parent / again["mask"]
    assert kept == tmp_path / "out" / "inputs" / "RS.dcm"
    found = read(kept, tumour=again["labels"]["tumour"])
    own = read(drawn, tumour=["GTV 1"])
    np.testing.assert_array_equal(found.points(TUMOUR), own.points(TUMOUR))


# The CT of contours ------------------------------------------------------------


def drawn_on(folder, ct, shape, only=None, **wanted):
    """A shape drawn on a CT, read with what is in the folder."""
    path = write_structures(folder / "r.dcm", ct, ["T"], [outlines(shape, ct, only)])
    return read(path, **wanted)


def test_missing_slices(ct, shapes, tmp_path):
    """In the middle the shape goes on; where the tumour ends nothing is made up."""
    shape = ellipsoid(SIZES).astype(bool)
    gone = (3, 6)
    kept = [k for k in range(SIZES[2]) if k not in gone]
    write(tmp_path, [ct[k] for k in kept])
    tissue = drawn_on(tmp_path, ct, shape)
    np.testing.assert_allclose(ordered(tissue.points(TUMOUR)), where(shape), atol=1e-8)
    said = "; ".join(tissue.notes)
    assert "2 of 10 slices are missing, 9, 18 mm from the first" in said
    assert "2 images that it was drawn on are not there" in said
    tissue = drawn_on(tmp_path, ct, shape, only=kept)
    assert "interpolated in 2 gaps" in "; ".join(tissue.notes)
    whole = 1.05e-9 * np.count_nonzero(shape)
    assert tissue.tumour_volume == pytest.approx(whole, rel=0.05)
    (tmp_path / "cut").mkdir()
    write(tmp_path / "cut", ct[:7])
    with pytest.raises(MaskError, match=r"'T' reaches 1\.0 voxels beyond the images"):
        drawn_on(tmp_path / "cut", ct, shape)


def test_every_second_slice_is_drawn_on(ct, tmp_path):
    shape = ellipsoid(SIZES).astype(bool)
    write(tmp_path, ct)
    tissue = drawn_on(tmp_path, ct, shape, only=range(1, 10, 2))
    whole = 1.05e-9 * np.count_nonzero(shape)
    assert tissue.tumour_volume == pytest.approx(whole, rel=0.12)


def test_two_lumps_stay_two(ct, tmp_path):
    write(tmp_path, ct)
    shape = np.zeros(SIZES, bool)
    shape[6:18, 6:18, :3] = shape[6:18, 6:18, 7:] = True
    with pytest.raises(MaskError, match=r"2 tumours that do not touch"):
        drawn_on(tmp_path, ct, shape)
    assert drawn_on(tmp_path, ct, shape, component=1).tumour_volume == pytest.approx(
        1.05e-9 * 3 * 12**2
    )


def test_slices_that_lie_unevenly(tmp_path):
    """A ball on slices of 1 and 2.5 mm: resampled, and said."""
    places = np.cumsum([0.0, *[1.0] * 12, *[2.5] * 6])
    ct = slices((30, 30, 19), (1.0, 1.0, 1.0), RIGHT, ORIGIN, places)
    x, y = np.meshgrid(*[np.arange(30) - 14.5] * 2, indexing="ij")
    shape = (x**2 + y**2)[..., None] + (places - 13.0) ** 2 <= 10.0**2
    write(tmp_path, ct)
    tissue = drawn_on(tmp_path, ct, shape)
    assert "its slices lie 1 to 2.5 mm apart: shapes are interp" in tissue.notes[0]
    ball = 4 / 3 * np.pi * 10.0**3
    assert 1e9 * tissue.tumour_volume == pytest.approx(ball, rel=0.03)
    middle = ORIGIN + RIGHT @ [14.5, 14.5, 13.0]
    found = 1e3 * tissue.points(TUMOUR).mean(axis=0)
    np.testing.assert_allclose(found, middle, atol=0.3)


def test_positions_that_are_rounded(tmp_path):
    """0.625 mm as 0.6 and 0.7: even, and its step is right."""
    places = np.round(0.625 * np.arange(40), 1)
    ct = slices((20, 20, 40), (1.0, 1.0, 0.625), np.eye(3), ORIGIN, places)
    write(tmp_path, ct)
    tissue = drawn_on(tmp_path, ct, np.pad(np.ones((10, 10, 30), bool), 5))
    assert tissue.notes == []
    assert tissue.spacing[2] == pytest.approx(0.625e-3, rel=2e-3)
    assert tissue.tumour_volume == pytest.approx(0.625e-9 * 3000, rel=2e-3)


def test_no_ct(ct, shapes, tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(MaskError, match=r"images that it was drawn on are not there"):
        drawn_on(tmp_path / "a", ct, shapes["Body"])
    write(tmp_path / "a", ct[:1])
    with pytest.raises(MaskError, match="its images are one slice"):
        drawn_on(tmp_path / "a", ct, shapes["Body"])
    with pytest.raises(MaskError, match="modality 'CT': expected SEG or RTSTRUCT"):
        read(tmp_path / "a" / "000")


def test_contours_that_lie_across_slices(ct, tmp_path):
    write(tmp_path, ct)
    points = np.array(ORIGIN) + np.array([[2, 2, 2], [8, 2, 2], [8, 2, 15]]) @ RIGHT.T
    path = write_structures(
        tmp_path / "r", ct, ["T"], [[(points, ct[0], "CLOSED_PLANAR")]]
    )
    with pytest.raises(MaskError, match=r"a contour that spans 4\.3 slices"):
        read(path)
    path = write_structures(tmp_path / "r", ct, ["T"], [[(points, ct[0], "POINT")]])
    with pytest.raises(MaskError, match="no voxel is tumour"):
        read(path)


def test_damaged_dicom(segmented, drawn, tmp_path):
    """One clear error for each cut and flip, or what was there."""
    rng = np.random.default_rng(1)
    refused = 0
    for path in (segmented, drawn):
        data = path.read_bytes()
        folder = tmp_path / path.stem
        folder.mkdir()
        (folder / "ct").symlink_to(drawn.parents[1] / "ct")
        for n in range(16):
            changed = bytearray(data)
            if n % 2:
                del changed[rng.integers(132, len(data)) :]
            else:
                for at in rng.integers(132, min(len(data), 6000), 3):
                    changed[at] ^= int(rng.integers(1, 256))
            (folder / "x.dcm").write_bytes(changed)
            try:
                read(folder / "x.dcm", tumour=[1], component=1)
            except MaskError as error:
                assert str(error)
                refused += 1
    assert refused >= 16


def test_a_tilted_gantry_is_refused(tmp_path):
    ct = slices((20, 20, 6), (1.0, 1.0, 2.0), np.eye(3), ORIGIN)
    for n, image in enumerate(ct):
        image.ImagePositionPatient[1] += 0.5 * n
    write(tmp_path, ct)
    with pytest.raises(MaskError, match=r"its axes lean by 14\.0 degrees"):
        drawn_on(tmp_path, ct, np.ones((20, 20, 6), bool))

"""A patient's mask from file to tissue: what is read, what is refused, what is said."""

import gzip
import os
import subprocess
import sys

import numpy as np
import pytest
import SimpleITK as sitk

from plants.tissue import mask, mask_reader
from plants.tissue.image import MaskError
from plants.tissue.labels import CRITICAL, TUMOUR
from plants.tissue.mask import load_image, load_mask
from plants.tissue.mask_labels import MaskLabels
from systems.common.parameter import ParameterError
from tests.plants.tissue.mask_files import (
    TURN,
    ellipsoid,
    flat,
    nifti_header,
    write_mask,
)


def cube(size=20, low=5, high=15, label=1, dtype=np.uint8):
    labels = np.zeros((size,) * 3, dtype)
    labels[low:high, low:high, low:high] = label
    return labels


def read(path, **wanted):
    """What is in a file, in this process."""
    wanted = MaskLabels(**wanted)
    return mask.tissue_of(mask_reader.read(path, wanted), wanted.component, path.name)


# What is read ------------------------------------------------------------------


def test_tissue_of_a_mask(tmp_path):
    """Labels, place and name are the file's, through a process of its own."""
    labels = ellipsoid(label=3)
    labels[2, 3, 4] = 7
    spacing, origin = (0.5, 0.7, 3.0), (-12.5, 40.0, 7.25)
    path = write_mask(tmp_path / "P.nrrd", labels, spacing, TURN, origin)
    tissue = load_mask(path, MaskLabels(critical=[7]))
    assert (tissue.name, tissue.is_mask, tissue.notes) == ("P.nrrd", True, [])
    image = sitk.ReadImage(str(path))
    for label, there in ((TUMOUR, labels == 3), (CRITICAL, labels == 7)):
        where = [
            image.TransformIndexToPhysicalPoint(index)
            for index in np.argwhere(there).tolist()
        ]
        np.testing.assert_allclose(tissue.points(label), 1e-3 * np.array(where))
    assert tissue.tumour_volume == pytest.approx(1.05e-9 * (labels == 3).sum())


def test_the_file_that_is_named_is_read(tmp_path):
    """P.nii beside P.nii.gz, which ITK takes for each other."""
    for name, size in (("P.nii.gz", 10), ("P.nii", 8)):
        write_mask(tmp_path / name, cube(high=5 + size))
        assert load_mask(tmp_path / name).tumour_volume == pytest.approx(1e-9 * size**3)


def test_a_threshold(tmp_path):
    path = write_mask(tmp_path / "p.nii.gz", 0.75 * cube(dtype=np.float32))
    assert read(path, threshold=0.5).tumour_volume == pytest.approx(1e-6)
    with pytest.raises(MaskError, match=r"threshold=0: its values go from 0 to 0\.75;"):
        read(path, threshold=0.0)
    with pytest.raises(MaskError, match=r"expected > 0 and <= 0\.75"):
        read(path, threshold=1.0)
    with pytest.raises(ParameterError, match=r"labels\.threshold=0\.5: expected none"):
        load_mask(path, MaskLabels(tumour=[1], threshold=0.5))


def test_whole_numbers_as_floats(tmp_path):
    path = write_mask(tmp_path / "p.mha", cube(label=2, dtype=np.float64) + 1e-6)
    assert read(path, tumour=[2]).tumour_volume == pytest.approx(1e-6)


# What is refused ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "wanted", "message"),
    [
        (
            0.3 * cube(dtype=np.float32),
            {},
            r"has 0\.3 among its values.*threshold=0\.15",
        ),
        (cube(dtype=np.int16) - 1, {}, r"values from -1 to 0: expected a label map"),
        (
            np.arange(8000, dtype=np.uint16).reshape(20, 20, 20),
            {},
            r"8000 values from 0 to 7999.*labels\.threshold=3999",
        ),
        (cube(label=70_000, dtype=np.int32), {}, r"values from 0 to 70000"),
        (np.full((9, 9, 9), np.inf, np.float32), {}, "not all finite"),
        (cube(dtype=np.float32) * np.nan, {"threshold": 1.0}, "not all finite"),
        (cube(label=3), {"tumour": [0]}, r"tumour=\[0\]: 0 is the background.*\[3\]"),
        (
            cube(label=3),
            {"tumour": [5]},
            r"no label 5; there are \[0, 3\].*nearest is 3",
        ),
        (
            cube(label=3),
            {"critical": [1]},
            r"labels\.critical=\[1\]: it has no label 1",
        ),
        (cube(label=3), {"critical": [3]}, "the mask is empty, no voxel is tumour"),
        (cube(label=0), {}, r"the mask is empty, no voxel is tumour: it has \[0\]"),
        (cube(label=1) + np.uint8(1), {}, r"no voxel is background \(0\).*\[1, 2\]"),
        (
            np.arange(8000, dtype=np.uint8).reshape(20, 20, 20) % np.uint8(18),
            {},
            r"it has 17 labels.*name the tumour's with labels\.tumour, e\.g\. \[1\]",
        ),
    ],
)
def test_no_label_map(tmp_path, values, wanted, message):
    with pytest.raises(MaskError, match=message):
        read(write_mask(tmp_path / "p.nrrd", values), **wanted)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"component": -1}, r"labels\.component=-1: expected >= 0"),
        ({"tumour": [-1]}, r"labels\.tumour=\[-1\]: expected"),
        ({"tumour": [1, 2], "critical": [2]}, r"none of the critical ones, \[2\]"),
        ({"transform": "Q"}, r"labels\.transform='Q': expected one of auto, qform"),
        ({"threshold": float("nan")}, r"labels\.threshold=nan: expected >= -1e\+06"),
    ],
)
def test_wishes_that_make_no_sense(tmp_path, wanted, message):
    with pytest.raises(ParameterError, match=message):
        load_mask(write_mask(tmp_path / "p.nrrd", cube()), MaskLabels(**wanted))


@pytest.mark.parametrize("name", ["p.png", "p.dcm", "p.hdr", "p.tif", "nrrd", "p.vtk"])
def test_other_kinds_of_files(tmp_path, name):
    (tmp_path / name).write_bytes(b"whatever")
    with pytest.raises(
        MaskError, match=r"name ends in \.nrrd.*but DICOM \(SEG, RTSTRUCT"
    ):
        load_mask(tmp_path / name)


def test_what_is_no_file(tmp_path):
    with pytest.raises(MaskError, match="no such file"):
        load_mask(tmp_path / "none.nrrd")
    os.mkfifo(tmp_path / "p.nrrd")
    with pytest.raises(MaskError, match="it is no file"):
        load_mask(tmp_path / "p.nrrd")
    with pytest.raises(MaskError, match="cannot be read: File name too long"):
        load_mask(tmp_path / ("n" * 999 + ".nrrd"))
    link = tmp_path / "zero.nrrd"
    link.symlink_to("/dev/zero")
    with pytest.raises(MaskError, match="it is no file"):
        load_mask(link)


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("ending", ["nrrd", "nhdr", "mha", "mhd", "nii", "nii.gz"])
def test_cut_and_padded_files_are_damaged(tmp_path, ending, compressed):
    write_mask(tmp_path / f"p.{ending}", cube(), compressed=compressed)
    files = [
        path for path in tmp_path.iterdir() if path.suffix not in (".nhdr", ".mhd")
    ]
    (data,) = files
    whole = data.read_bytes()
    for broken in (whole[: len(whole) // 2], whole[:-1], whole + b"x"):
        data.write_bytes(broken)
        with pytest.raises(MaskError, match="the file is damaged"):
            read(tmp_path / f"p.{ending}")


def test_a_flipped_byte_fails_its_checksum(tmp_path):
    for name in ("p.nii.gz", "p.nrrd", "p.mha"):
        path = write_mask(tmp_path / name, ellipsoid())
        data = bytearray(path.read_bytes())
        data[-20] ^= 1
        path.write_bytes(data)
        with pytest.raises(MaskError, match="the file is damaged"):
            read(path)


def test_absurd_sizes_are_refused_by_the_header(tmp_path):
    head = nifti_header((30_000,) * 3)
    (tmp_path / "p.nii").write_bytes(head)
    (tmp_path / "p.nii.gz").write_bytes(gzip.compress(head))
    for name, old, new in (
        ("p.nrrd", b"sizes: 20 20 20", b"sizes: 90000 90000 90000"),
        ("p.mha", b"DimSize = 20 20 20", b"DimSize = 90000 90000 90000"),
    ):
        path = write_mask(tmp_path / name, cube())
        path.write_bytes(path.read_bytes().replace(old, new))
    for name in ("p.nii", "p.nii.gz", "p.nrrd", "p.mha"):
        with pytest.raises(MaskError, match=r"000 voxels: expected at most 268435456"):
            read(tmp_path / name)


def test_a_file_that_unpacks_to_more_than_it_says(tmp_path):
    path = tmp_path / "p.nii.gz"
    path.write_bytes(gzip.compress(nifti_header((20,) * 3) + bytes(50_000_000)))
    with pytest.raises(MaskError, match="more than the 8352 bytes"):
        read(path)


@pytest.mark.parametrize(
    "name", ["../p.raw", "/etc/hostname", "sub/p.raw", "out.raw", "\0"]
)
def test_detached_data_lie_beside_their_header(tmp_path, name):
    (tmp_path / "in").mkdir()
    path = write_mask(tmp_path / "in" / "p.mhd", cube(), compressed=False)
    (tmp_path / "p.raw").write_bytes((tmp_path / "in" / "p.raw").read_bytes())
    (tmp_path / "in" / "out.raw").symlink_to(tmp_path / "p.raw")
    path.write_text(path.read_text().replace("p.raw", name))
    with pytest.raises(MaskError, match="expected a file in the header's own folder"):
        read(path)
    path.write_text(path.read_text().replace(name, "LIST"))
    with pytest.raises(MaskError, match="'LIST' is not there"):
        read(path)


def test_errors_show_no_other_file(tmp_path):
    (tmp_path / "secret.txt").write_text("password 1234")
    (tmp_path / "p.mhd").write_text(
        "NDims = 3\nDimSize = 1 1 2\nElementType = MET_UCHAR\n"
        "ElementSpacing = 1 1 1\nElementDataFile = secret.txt\n"
    )
    (tmp_path / "p.nrrd").symlink_to(tmp_path / "secret.txt")
    for name in ("p.mhd", "p.nrrd"):
        with pytest.raises(MaskError, match="the file is damaged") as told:
            read(tmp_path / name)
        assert "password" not in str(told.value)


@pytest.mark.parametrize(
    ("spacing", "units", "message"),
    [
        (1.0, 1, r"the tumour would be 10 m wide.*in mm and says m: divide.* by 1000"),
        (1e-3, 2, r"would be 10 µm wide.*in m and is read as mm: multiply"),
        (100.0, 2, r"the tumour would be 1 m wide: expected 2 to 200 mm"),
    ],
)
def test_units_that_cannot_be(tmp_path, spacing, units, message):
    path = tmp_path / "p.nii"
    head = nifti_header((20,) * 3, spacing=[spacing] * 3, units=units, qform=[0.0] * 6)
    path.write_bytes(head + flat(cube()))
    with pytest.raises(MaskError, match=message):
        read(path)


# What is left out, and said ----------------------------------------------------


def test_parts_that_do_not_touch_by_a_face(tmp_path):
    """Two halves that touch by an edge are two; what is left out is said."""
    labels = cube(high=10)
    labels[10:14, 10:15, 5:10] = 1
    path = write_mask(tmp_path / "p.nrrd", labels)
    with pytest.raises(
        MaskError, match=r"2 tumours that do not touch by a face \(56 %, 44 %"
    ):
        read(path)
    tissue = read(path, component=1)
    assert tissue.tumour_volume == pytest.approx(125e-9)
    assert tissue.notes == [
        "of what is tumour 100 mm3 in 1 parts that the chosen one (125 mm3) does not "
        "touch by a face are left out"
    ]
    assert read(path, component=2).tumour_volume == pytest.approx(100e-9)
    with pytest.raises(MaskError, match=r"component=3: it has 2.*the nearest is 2"):
        read(path, component=3)


def test_specks_do_not_count_but_are_said(tmp_path):
    labels = cube()
    labels[1, 1, 1] = 1
    tissue = read(write_mask(tmp_path / "p.nrrd", labels))
    assert tissue.tumour_volume == pytest.approx(1e-6)
    assert "1 mm3 in 1 parts" in tissue.notes[0]


def test_notes_on_labels_and_border(tmp_path):
    labels = cube(low=0, high=10)
    labels[:, :, 9] *= 4
    first, second = read(write_mask(tmp_path / "p.nrrd", labels)).notes
    assert first == "labels [1, 4] are all taken for tumour"
    assert "touches the image's border" in second


# In a process of its own -------------------------------------------------------


def test_the_reader_starts_anywhere(tmp_path, monkeypatch):
    """Nothing that lies beside a mask is imported."""
    path = write_mask(tmp_path / "p.nrrd", cube())
    (tmp_path / "numpy.py").write_text("raise SystemExit('imported')")
    (tmp_path / "plants").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    assert load_mask(path.name).tumour_volume == pytest.approx(1e-6)


def test_the_reader_has_limits(tmp_path, monkeypatch):
    path = write_mask(tmp_path / "p.nrrd", np.zeros((512, 512, 512), np.uint8))
    code = "from plants.tissue import mask_reader as m; m.MOST_MEMORY = {}; m.main()"
    done = subprocess.run(
        [sys.executable, "-c", code.format(2**28), str(path)],
        input=b"{}",
        capture_output=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        check=True,
    )
    assert done.stdout == b'{"error": "it takes more than 0 GiB to read"}\n'
    monkeypatch.setattr(mask, "MOST_TIME", 0.01)
    with pytest.raises(MaskError, match=r"takes more than 0\.01 s to read"):
        load_mask(path)


def test_a_reader_that_crashes(tmp_path, monkeypatch):
    path = write_mask(tmp_path / "p.nrrd", cube())
    monkeypatch.setattr(mask.mask_reader, "__name__", "plants.tissue.nothing")
    with pytest.raises(MaskError, match=r"p\.nrrd': it cannot be read: .*No module"):
        load_mask(path)


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    path = write_mask(tmp_path / "p.nrrd", cube())

    def denied(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(mask, "_read_apart", denied)
    with pytest.raises(MaskError, match="cannot be read: Permission denied"):
        load_mask(path)


@pytest.mark.parametrize("name", ["I.nii.gz", "I.nrrd"])
def test_an_image_lies_where_the_mask_of_its_grid_does(tmp_path, name):
    """Greys from black to white, whatever the scale; what is no number is black."""
    labels = ellipsoid()
    values = (1000.0 * labels + np.arange(labels.shape[0])[:, None, None]).astype("f4")
    values[:3, :3, :3] = np.nan
    grid = {"spacing": (1.0, 1.0, 2.0), "direction": TURN, "origin": (3.0, -5.0, 90.0)}
    image = load_image(write_mask(tmp_path / name, values, **grid))
    tissue = load_mask(write_mask(tmp_path / f"M{name}", labels, **grid))
    np.testing.assert_allclose(image.X_PV, tissue.grid.X_PI, atol=1e-7)
    assert image.values.shape == labels.shape and image.values.dtype == np.uint8
    assert image.values[:3, :3, :3].max() == 0 and image.values[-1, 0, 0] < 20
    middle = tuple(n // 2 for n in labels.shape)
    assert image.values[middle] > 240


def test_what_is_no_image_is_refused(tmp_path):
    path = write_mask(tmp_path / "I.nrrd", np.zeros((4, 4, 4), np.uint8))
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(ValueError, match=r"image .*I.nrrd.*damaged"):
        load_image(path)
    with pytest.raises(ValueError, match=r"image .*none.*no such file"):
        load_image(tmp_path / "none.nrrd")

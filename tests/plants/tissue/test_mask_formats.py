"""Mask files: each form as ITK reads it, and what only a header tells."""

import bz2
import gzip

import numpy as np
import pytest
import SimpleITK as sitk

from plants.tissue.image import MaskError
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.mask_reader import READERS, read
from plants.tissue.nifti import read_nifti
from plants.tissue.nrrd import read_nrrd
from tests.plants.tissue.mask_files import (
    TURN,
    ellipsoid,
    flat,
    nifti_header,
    write_mask,
)

SPACING, ORIGIN = (0.5, 0.7, 3.0), (-12.5, 40.0, 7.25)


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("dtype", ["u1", "i2", "u4", "f4", "f8"])
@pytest.mark.parametrize("ending", ["nrrd", "nhdr", "mha", "mhd", "nii", "nii.gz"])
def test_values_and_affine_are_those_of_itk(tmp_path, ending, dtype, compressed):
    labels = ellipsoid(label=3).astype(dtype)
    path = tmp_path / f"m.{ending}"
    write_mask(path, labels, SPACING, TURN, ORIGIN, compressed)
    image = READERS[f".{ending}"](path)
    np.testing.assert_array_equal(image.values, labels)
    itk = sitk.ReadImage(str(path))
    X = np.eye(4)
    X[:3, :3] = 1e-3 * np.array(itk.GetDirection()).reshape(3, 3) * itk.GetSpacing()
    X[:3, 3] = 1e-3 * np.array(itk.GetOrigin())
    np.testing.assert_allclose(image.X_PV, X, atol=1e-9)
    assert image.notes == []


HEAD = (
    "NRRD0004\n# by hand\ndimension: 3\nsizes: 24 22 10\ntype: short\nendian: big\n"
    "space: right-anterior-superior\nspace directions: (2,0,0) (0,2,0) (0,0,-3)\n"
    'space origin: (1,2,3)\nspace units: "mm" "mm" "mm"\nkey:=value\n'
)


@pytest.mark.parametrize(
    ("encoding", "packed"),
    [
        ("raw", bytes),
        ("gz", gzip.compress),
        ("gzip", lambda data: gzip.compress(data[:99]) + gzip.compress(data[99:])),
        ("bz2", bz2.compress),
        ("hex", lambda data: data.hex(" ", 40).encode()),
    ],
)
def test_encodings_of_nrrd(tmp_path, encoding, packed):
    """Big-endian, in RAS, in members, with a comment and a key."""
    labels = ellipsoid(label=3)
    data = packed(flat(labels, ">i2"))
    path = tmp_path / "m.nrrd"
    path.write_bytes(f"{HEAD}encoding: {encoding}\n\n".encode() + data)
    image = read_nrrd(path)
    np.testing.assert_array_equal(image.values, labels)
    np.testing.assert_allclose(
        image.X_PV[:3], 1e-3 * np.array([[-2, 0, 0, -1], [0, -2, 0, -2], [0, 0, -3, 3]])
    )


def test_text_and_detached_data_of_nrrd(tmp_path):
    labels = ellipsoid(label=3)
    words = " ".join(map(str, labels.ravel(order="F"))).encode()
    head = f"{HEAD}encoding: ascii\r\ndata file: m.txt\r\n".replace("\n", "\r\n")
    (tmp_path / "m.nhdr").write_text(head.replace("\r\r", "\r"), newline="")
    (tmp_path / "m.txt").write_bytes(words)
    np.testing.assert_array_equal(read_nrrd(tmp_path / "m.nhdr").values, labels)


@pytest.mark.parametrize("unit", ["m", "cm", "um"])
def test_units_of_text_headers(tmp_path, unit):
    metres = {"m": 1.0, "cm": 1e-2, "um": 1e-6}[unit]
    data = flat(ellipsoid(label=3), ">i2")
    head = HEAD.replace('"mm"', f'"{unit}"') + "encoding: raw\n\n"
    (tmp_path / "m.nrrd").write_bytes(head.encode() + data)
    assert read_nrrd(tmp_path / "m.nrrd").X_PV[2, 2] == pytest.approx(-3 * metres)
    path = write_mask(tmp_path / "m.mha", ellipsoid(), SPACING, compressed=False)
    head, _, rest = path.read_bytes().partition(b"DimSize")
    path.write_bytes(head + f"DistanceUnits = {unit}\nDimSize".encode() + rest)
    assert READERS[".mha"](path).X_PV[2, 2] == pytest.approx(3.0 * metres)


@pytest.mark.parametrize(
    ("code", "metres"), [(0, 1e-3), (1, 1.0), (2, 1e-3), (3, 1e-6)]
)
@pytest.mark.parametrize("order", ["<", ">"])
def test_units_and_byte_order_of_nifti(tmp_path, code, metres, order):
    labels = ellipsoid()
    head = nifti_header(
        labels.shape,
        order,
        (4, 16),
        SPACING,
        code,
        qform=[0.0, 0.0, 0.0, 5.0, 6.0, 7.0],
    )
    (tmp_path / "m.nii").write_bytes(head + flat(labels, f"{order}i2"))
    image = read_nifti(tmp_path / "m.nii")
    np.testing.assert_array_equal(image.values, labels)
    np.testing.assert_allclose(np.diag(image.X_PV)[:3] / metres, [-0.5, -0.7, 3.0])
    np.testing.assert_allclose(image.X_PV[:3, 3] / metres, [-5.0, -6.0, 7.0])


def test_nifti_2(tmp_path):
    labels = ellipsoid()
    head = np.zeros(544, np.uint8)

    def put(place, kind, *values):
        data = np.array(values, kind).tobytes()
        head[place : place + len(data)] = np.frombuffer(data, np.uint8)

    put(0, "<i4", 540)
    put(4, "S4", b"n+2")
    put(12, "<i2", 2, 8)
    put(16, "<i8", 3, *labels.shape, 1, 1, 1, 1)
    put(104, "<f8", 1.0, *SPACING)
    put(168, "<i8", 544)
    put(348, "<i4", 1)
    put(400, "<f8", -0.5, 0, 0, 12.5, 0, -0.7, 0, -40.0, 0, 0, 3.0, 7.25)
    put(500, "<i4", 2)
    (tmp_path / "m.nii.gz").write_bytes(gzip.compress(head.tobytes() + flat(labels)))
    image = read_nifti(tmp_path / "m.nii.gz")
    np.testing.assert_array_equal(image.values, labels)
    np.testing.assert_allclose(np.diag(image.X_PV)[:3], 1e-3 * np.array(SPACING))
    np.testing.assert_allclose(image.X_PV[:3, 3], 1e-3 * np.array(ORIGIN))


def test_scaled_values_of_nifti(tmp_path):
    labels = ellipsoid()
    head = nifti_header(labels.shape, scale=(0.5, 0.0), qform=[0.0] * 6)
    (tmp_path / "m.nii").write_bytes(head + flat(2 * labels))
    np.testing.assert_array_equal(read_nifti(tmp_path / "m.nii").values, labels)


def both_forms(tmp_path):
    """A file whose sform puts it 143 mm from its qform."""
    labels = ellipsoid()
    sform = np.eye(3, 4)
    sform[2, 3] = 143.0
    head = nifti_header(labels.shape, qform=[0.0] * 6, sform=sform)
    path = tmp_path / "m.nii"
    path.write_bytes(head + flat(labels))
    return path


def test_qform_and_sform_that_disagree(tmp_path):
    path = both_forms(tmp_path)
    part = read(path, MaskLabels())
    assert part.X_PV[2, 3] == 0.0
    assert "qform and sform lie up to 143 mm apart" in part.notes[0]
    part = read(path, MaskLabels(transform="sform"))
    assert part.X_PV[2, 3] == pytest.approx(0.143)
    assert part.notes == []
    part = read(path, MaskLabels(transform="qform"))
    assert (part.X_PV[2, 3], part.notes) == (0.0, [])


def test_a_transform_that_is_not_there(tmp_path):
    labels = ellipsoid()
    path = tmp_path / "m.nii"
    path.write_bytes(nifti_header(labels.shape, qform=[0.0] * 6) + flat(labels))
    with pytest.raises(
        MaskError, match=r"transform=sform: it has qform; expected auto"
    ):
        read(path, MaskLabels(transform="sform"))
    path = write_mask(tmp_path / "m.mha", labels)
    with pytest.raises(MaskError, match=r"transform=sform: only NIfTI"):
        read(path, MaskLabels(transform="sform"))


def test_what_a_header_does_not_say_is_noted(tmp_path):
    labels = ellipsoid()
    path = tmp_path / "m.nii"
    path.write_bytes(nifti_header(labels.shape, spacing=SPACING) + flat(labels))
    assert "taken for RAS" in read(path, MaskLabels()).notes[0]
    path = write_mask(tmp_path / "m.mha", labels, compressed=False)
    lines = path.read_bytes().split(b"\n")
    kept = [line for line in lines if not line.startswith((b"Offset", b"Transform"))]
    path.write_bytes(b"\n".join(kept))
    first, second = read(path, MaskLabels()).notes
    assert "directions: they are taken for LPS" in first
    assert "first voxel is taken for the origin" in second


def test_a_tilted_gantry(tmp_path):
    labels = ellipsoid()
    sform = np.eye(3, 4)
    sform[1, 2] = np.tan(np.radians(20.0))
    path = tmp_path / "m.nii"
    path.write_bytes(nifti_header(labels.shape, sform=sform) + flat(labels))
    with pytest.raises(
        MaskError, match=r"lean by 20\.0 degrees: expected right angles"
    ):
        read(path, MaskLabels())

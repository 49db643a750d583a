"""Damaged masks: one clear error each, and nothing damaged is taken for whole.

Lengths and checksums tell of cuts and of flips in packed data. A flip in a raw voxel,
or of a digit of the spacing, nothing can tell.
"""

from dataclasses import dataclass
from pathlib import Path
import warnings

import numpy as np
import pytest

from plants.tissue import mask, mask_reader
from plants.tissue.image import MaskError
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.tissue import Tissue
from tests.plants.tissue.mask_files import TURN, ellipsoid, write_mask

NAMES = ("p.nrrd", "p.nhdr", "p.mha", "p.mhd", "p.nii", "p.nii.gz")
WORDS = (
    *("0", "-1", "1e300", "nan", "99999999999999999999", "", "1.5", "short", "raw"),
    *("../p.raw", "LIST", "\0", "255", "(1,0)", "True", "=", ":"),
)
STANDS_ALONE = (".nii.gz", ".gz", ".zraw")
"""Files that one checksum covers as a whole."""


@dataclass
class Whole:
    """A mask before it is damaged: its files by name, and what it holds."""

    name: str
    files: dict[str, bytes]
    tissue: Tissue


@pytest.fixture(scope="module")
def masks(tmp_path_factory) -> list[Whole]:
    found = []
    for packed in (True, False):
        for name in NAMES:
            folder = tmp_path_factory.mktemp("mask")
            labels = ellipsoid(label=2).astype("i2" if packed else "u1")
            where = ((0.5, 0.7, 3.0), TURN, (-12.5, 40.0, 7.25))
            path = write_mask(folder / name, labels, *where, packed)
            files = {file.name: file.read_bytes() for file in folder.iterdir()}
            found.append(Whole(name, files, read(path)))
    return found


def read(path: Path) -> Tissue:
    """As `load_mask`, in this process."""
    return mask.tissue_of(mask_reader.read(path, MaskLabels()), 0, path.name)


def damaged(rng: np.random.Generator, whole: Whole) -> tuple[dict[str, bytes], bool]:
    """A damaged copy, and whether a length or a checksum must tell."""
    name = str(rng.choice(sorted(whole.files)))
    data = bytearray(whole.files[name])
    packed = name.endswith(STANDS_ALONE)
    match rng.integers(4):
        case 0:
            del data[rng.integers(len(data)) :]
            told = True
        case 1:
            for place in rng.integers(len(data), size=rng.integers(1, 4)):
                data[place] ^= int(rng.integers(1, 256))
            told = packed
        case 2:  # a word of the header, which is all of it in .nii
            words = bytes(data[:400]).split(b" ")
            words[rng.integers(len(words))] = str(rng.choice(WORDS)).encode()
            data[:400] = b" ".join(words)
            told = False
        case _:
            place = rng.integers(len(data))
            data[place:place] = rng.bytes(rng.integers(1, 9))
            told = packed
    return whole.files | {name: bytes(data)}, told


def run(masks: list[Whole], folder: Path, seeds: range, apart: int) -> int:
    """Reads damaged masks; every so many in a process of their own."""
    refused = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        whole = masks[seed % len(masks)]
        files, told = damaged(rng, whole)
        for name, data in files.items():
            (folder / name).write_bytes(data)
        path = folder / whole.name
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                tissue = mask.load_mask(path) if seed % apart == 0 else read(path)
        except MaskError as error:
            assert "\n" not in str(error), seed
            assert 10 < len(str(error)) < 600, seed
            refused += 1
            continue
        if told:  # a flip in a packed file's own name or date
            np.testing.assert_array_equal(tissue.labels, whole.tissue.labels, str(seed))
            np.testing.assert_array_equal(tissue.X_PV, whole.tissue.X_PV, str(seed))
    return refused


def test_damaged_masks(masks, tmp_path):
    assert run(masks, tmp_path, range(100), 25) > 60


@pytest.mark.study
def test_many_damaged_masks(masks, tmp_path):
    assert run(masks, tmp_path, range(1000, 3000), 20) > 1200


@pytest.mark.parametrize("name", sorted({*NAMES} - {"p.nii"}))
def test_flips_in_packed_data_are_told(masks, tmp_path, name):
    """Or unpack to the same: a flipped date, or a match in a row of equal voxels."""
    whole = next(whole for whole in masks if whole.name == name)
    data_name = next(n for n in whole.files if not n.endswith((".nhdr", ".mhd")))
    data = whole.files[data_name]
    for file, content in whole.files.items():
        (tmp_path / file).write_bytes(content)
    start = max(data.rfind(b"\n\n"), data.rfind(b"LOCAL\n"), 0) + 6
    places = range(start, len(data), 3)
    told = 0
    for place in places:
        broken = bytearray(data)
        broken[place] ^= 0x10
        (tmp_path / data_name).write_bytes(broken)
        try:
            tissue = read(tmp_path / name)
        except MaskError:
            told += 1
            continue
        np.testing.assert_array_equal(tissue.labels, whole.tissue.labels)
        np.testing.assert_array_equal(tissue.X_PV, whole.tissue.X_PV)
    assert told > 0.9 * len(places)

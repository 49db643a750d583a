"""What is exported for a viewer, read again."""

import json

import numpy as np
import pytest
import SimpleITK as sitk

from diagrams.common.cli import main
from diagrams.resection.export import HEALTHY, LABELS, REMAINING, RESECTED
from diagrams.resection.operation import new_session
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.volume import Access
from systems.resection.planning.procedure import Procedure
from tests.plants.tissue.mask_files import TURN, ellipsoid, write_mask

EDGES = (0.8, 0.9, 3.0)
"""Of the mask's voxels in mm."""


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A session on a turned mask, exported from its file."""
    folder = tmp_path_factory.mktemp("export")
    mask = write_mask(
        folder / "P.nii.gz", ellipsoid((40, 36, 12)), EDGES, TURN, (5.0, -7.0, 11.0)
    )
    access = Access(direction=(TURN @ [0.0, 0.0, 1.0]).tolist())
    session, _ = new_session(
        ResectionScenario(mask=str(mask), access=access, spacing=1e-3)
    )
    session.file = folder / "P.session"
    entry = Procedure("entry", length=0.012, radius=0.012, clipped=True)
    assert session.commit(entry).feasible
    session.go_home()
    out = folder / "viewer"
    assert main(["export", str(session.file), "--to", str(out)]) == 0
    return session, mask, out


def count(path, label):
    """Volume of a label in m3."""
    image = sitk.ReadImage(str(path))
    voxel = 1e-9 * np.prod(image.GetSpacing())
    return voxel * np.count_nonzero(sitk.GetArrayFromImage(image) == label)


def test_label_maps_give_the_figures(exported):
    session, mask, out = exported
    volume = session.volume
    resected, whole = volume.resected_volume, volume.tumour_volume
    fine = out / "labels_fine.nrrd"
    assert count(fine, RESECTED) == pytest.approx(resected, rel=1e-9)
    assert count(fine, REMAINING) == pytest.approx(whole - resected, rel=1e-9)
    assert count(fine, HEALTHY) == 0.0
    given = sitk.ReadImage(str(mask))
    for name in ("labels.nrrd", "labels.nii.gz"):
        image = sitk.ReadImage(str(out / name))
        assert image.GetSize() == given.GetSize()
        for get in ("GetSpacing", "GetOrigin", "GetDirection"):
            mine, theirs = getattr(image, get)(), getattr(given, get)()
            np.testing.assert_allclose(mine, theirs, atol=1e-5)
        for label, true in ((RESECTED, resected), (REMAINING, whole - resected)):
            assert count(out / name, label) == pytest.approx(true, rel=0.005)
        # What remains or is gone lies where the mask had tumour.
        labels, tumour = map(sitk.GetArrayFromImage, (image, given))
        inside = np.isin(labels, (RESECTED, REMAINING))
        assert (tumour[inside] > 0).mean() > 0.95


def test_path_channels_and_plan_are_the_sessions(exported):
    session, _, out = exported
    X = session.volume.X_PW
    lines = (out / "path.vtk").read_text().splitlines()
    assert "SPACE=LPS" in lines[1]
    number = int(lines[4].split()[1])
    points = np.array([line.split() for line in lines[5 : 5 + number]], float)
    tips = 1e3 * (session.tips @ X[:3, :3].T + X[:3, 3])
    np.testing.assert_allclose(points, tips, atol=1e-4)
    rows = (out / "channels.obj").read_text().splitlines()
    vertices = np.array([r.split()[1:] for r in rows if r.startswith("v ")], float)
    away = np.cross(vertices - 1e3 * X[:3, 3], X[:3, 2])
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 5.0, atol=1e-3)
    plan = json.loads((out / "plan.json").read_text())
    np.testing.assert_array_equal(plan["postures"], session.postures)
    assert plan["volumes"]["resected"] == pytest.approx(session.volume.resected_volume)
    assert list(plan["labels"].values()) == list(LABELS)


def test_bad_sources(tmp_path, capsys):
    assert main(["export", str(tmp_path / "none"), "--to", str(tmp_path)]) == 2
    assert "no session" in capsys.readouterr().err
    (tmp_path / "scenario.yaml").write_text("system: resection\nduration: 60.0\n")
    assert main(["export", str(tmp_path), "--to", str(tmp_path / "o")]) == 2
    assert "was run without a session" in capsys.readouterr().err

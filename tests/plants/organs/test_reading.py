"""Organs from other people's files."""

import numpy as np
import pytest
import pyvista

from plants.organs.distance_grid import build
from plants.organs.organs import Organ, organ_set, surface_of
from plants.organs.shapes import shape
from plants.organs.surface import Surface, SurfaceError


def saved(surface: Surface, path, unit: float = 1e3) -> str:
    """Saves a surface, in mm, in the format of the file's ending."""
    faces = np.insert(surface.triangles, 0, 3, axis=1)
    pyvista.PolyData(unit * surface.points, faces.ravel()).save(path)
    return str(path)


@pytest.fixture(scope="module")
def gall() -> Surface:
    return shape("gallbladder", 3, 20)


def with_a_hole(surface: Surface) -> Surface:
    p = surface.points[surface.triangles].mean(axis=1)
    keep = np.linalg.norm(p - p[300], axis=1) > 0.004
    return Surface(surface.points, surface.triangles[keep])


@pytest.mark.parametrize("kind", ["stl", "obj", "vtk", "vtp"])
def test_every_format_gives_the_same_organ(gall, tmp_path, kind):
    organ = Organ(name="gall", file=saved(gall, tmp_path / f"g.{kind}"))
    read = surface_of(organ)
    assert len(read.triangles) == len(gall.triangles)
    want = gall.points + organ.p_WO
    assert np.allclose(read.points.min(axis=0), want.min(axis=0), atol=1e-5)
    assert np.allclose(read.points.max(axis=0), want.max(axis=0), atol=1e-5)


def test_its_unit_and_place_are_declared(gall, tmp_path):
    file = saved(gall, tmp_path / "g.stl", 1.0)
    with pytest.raises(SurfaceError, match="is its unit right"):
        surface_of(Organ(name="gall", file=file, unit="mm"))
    organ = Organ(name="gall", file=file, unit="m", rpy=[0.0, 0.0, np.pi / 2])
    size, own = np.ptp(surface_of(organ).points, axis=0), np.ptp(gall.points, axis=0)
    assert size == pytest.approx(own[[1, 0, 2]], abs=1e-5)


def test_an_open_one_is_refused_with_its_place_and_mended_on_request(gall, tmp_path):
    file = saved(with_a_hole(gall), tmp_path / "open.stl")
    with pytest.raises(SurfaceError, match=r"\d+ edges are open .* mm.*mend: true"):
        surface_of(Organ(name="gall", file=file))
    mended = surface_of(Organ(name="gall", file=file, mend=True))
    whole = build(
        surface_of(Organ(name="gall", file=saved(gall, tmp_path / "g.stl"))), ""
    )
    grid = build(mended, "gall")
    count = [(g.values < 0.0).sum() for g in (grid, whole)]
    assert count[0] == pytest.approx(count[1], rel=0.05)


def test_what_is_no_surface_is_refused(tmp_path):
    file = tmp_path / "text.stl"
    file.write_text("no triangles here")
    with pytest.raises(SurfaceError, match=r"gall\.file=.*"):
        surface_of(Organ(name="gall", file=str(file)))
    with pytest.raises(SurfaceError, match="expected a file"):
        surface_of(Organ(name="gall", file=str(tmp_path / "gone.stl")))


def test_several_organs_lie_one_after_the_other(gall, tmp_path):
    file = saved(gall, tmp_path / "g.stl")
    organs = [Organ(name="a", file=file), Organ(name="b", file=file, scale=0.5)]
    known = organ_set(organs)
    assert known.names == ("a", "b")
    first = known.table[0, 1, 7]
    assert first == np.prod(known.table[0, 0, 4:7])
    assert known.values.shape == (1, first + np.prod(known.table[0, 1, 4:7]))

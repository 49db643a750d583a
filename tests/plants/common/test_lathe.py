"""Meshes turned about z, read back from their text."""

import numpy as np

from plants.abdomen.skin import HEIGHT, belly_profile
from plants.common.lathe import lathe


def read(mesh):
    """Vertices, normals and faces of a mesh in memory."""
    rows = {"v": [], "vn": [], "f": []}
    text = mesh.source().in_memory().mesh_file.contents().decode()
    for line in text.splitlines():
        key, *values = line.split()
        if key == "f":
            rows[key].append([int(v.split("//")[0]) - 1 for v in values])
        elif key in rows:
            rows[key].append([float(v) for v in values])
    return [np.array(rows[key]) for key in ("v", "vn", "f")]


def test_cylinder_has_its_area_and_outward_normals():
    vertices, normals, faces = read(lathe([(0.5, 1.0), (0.5, 0.0)], "tube"))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(across, axis=1).sum()
    np.testing.assert_allclose(area, 2.0 * np.pi * 0.5 * 1.0, rtol=2e-3)
    radial = vertices * [1.0, 1.0, 0.0] / 0.5
    np.testing.assert_allclose(normals, radial, atol=1e-3)
    # The faces turn as their normals say.
    assert (np.einsum("ij,ij->i", across, normals[faces[:, 0]]) > 0.0).all()


def test_stretch_makes_ellipses():
    vertices, _, _ = read(lathe([(1.0, 0.0), (0.0, -1.0)], "bowl", (0.2, 0.3)))
    np.testing.assert_allclose(np.abs(vertices).max(axis=0), [0.2, 0.3, 1.0])


def test_belly_is_flat_where_the_trocars_stand_and_reaches_the_table():
    profile = np.array(belly_profile())
    top = profile[profile[:, 0] < 0.4]
    assert len(top) > 2
    assert top[:, 1].min() > -0.004
    np.testing.assert_allclose(profile[-1], [1.0, -HEIGHT])

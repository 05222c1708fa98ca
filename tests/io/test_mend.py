"""Mending: what is closed stays, what can be closed safely is, the rest is named."""

import numpy as np
import pytest
from manifold3d import Manifold

from sashimono.geometry.mesh import measures, topology
from sashimono.io.mending.mend import Surface, close_surface
from sashimono.io.raw import ReadConfig


def arrays(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    out = solid.to_mesh64()
    return np.array(out.vert_properties[:, :3]), np.array(out.tri_verts).astype(np.int64)


def close(vertices: np.ndarray, faces: np.ndarray, repair: bool = True) -> Surface | str:
    return close_surface(vertices, faces, repair=repair, config=ReadConfig())


def closed(vertices: np.ndarray, faces: np.ndarray, volume: float, mended: str | None) -> Surface:
    """Check that the mesh is closed to this volume with this remark, and without repair only if there is none."""
    surface = close(vertices, faces)
    assert isinstance(surface, Surface), surface
    assert topology.is_closed(surface.faces)
    assert measures.volume(surface.vertices, surface.faces) == pytest.approx(volume, rel=1e-6)
    assert mended is None or mended in ", ".join(surface.mended)
    assert bool(surface.mended) == (mended is not None)
    return surface


def test_triangle_soup_is_welded_without_remark():
    vertices, faces = arrays(Manifold.sphere(1.0, 32))
    soup = vertices[faces].reshape(-1, 3)
    surface = closed(soup, np.arange(len(soup)).reshape(-1, 3), measures.volume(vertices, faces), None)
    assert len(surface.vertices) == len(vertices)
    noisy = soup + np.random.default_rng(0).uniform(-2e-6, 2e-6, soup.shape)
    closed(noisy, np.arange(len(soup)).reshape(-1, 3), measures.volume(vertices, faces), None)


def test_degenerate_triangles_and_unused_vertices_go():
    vertices, faces = arrays(Manifold.cube([1.0, 1.0, 1.0]))
    surface = closed(np.vstack([vertices, [[9.0, 9.0, 9.0]]]), np.vstack([faces, [[0, 0, 1], [2, 2, 2]]]), 1.0, None)
    assert surface.faces.shape == (12, 3)
    assert surface.vertices.max() == 1.0


def test_inward_surface_is_turned_and_cavities_stay():
    vertices, faces = arrays(Manifold.cube([4.0] * 3, True) - Manifold.cube([2.0] * 3, True))
    closed(vertices, faces, 56.0, None)
    closed(vertices, faces[:, ::-1], 56.0, "inward surface turned outward")
    assert close(vertices, faces[:, ::-1], repair=False) == "its surface points inward"


def test_mixed_winding_is_unified_with_cavities_inward():
    vertices, faces = arrays(Manifold.cube([4.0] * 3, True) - Manifold.cube([2.0] * 3, True))
    mixed = faces.copy()
    mixed[::3] = mixed[::3][:, ::-1]
    closed(vertices, mixed, 56.0, "the winding of")
    assert "wound inconsistently" in str(close(vertices, mixed, repair=False))


def test_small_flat_hole_is_filled_and_a_large_one_is_not():
    vertices, faces = arrays(Manifold.cylinder(10.0, 1.0, circular_segments=40))
    assert close(vertices, faces[:-1], repair=False) == "mesh has 3 open edges"
    closed(vertices, faces[:-1], measures.volume(vertices, faces), "1 flat hole of up to 3 edges filled")
    top = (vertices[faces][:, :, 2] > 9.9).all(axis=1)
    assert close(vertices, faces[~top]) == "mesh has 40 open edges"


def test_a_bore_without_its_wall_is_not_plugged():
    bore = Manifold.cylinder(9.0, 0.5, circular_segments=16).translate([5.0, 5.0, -1.0])
    vertices, faces = arrays(Manifold.cube([10.0, 10.0, 5.0]) - bore)
    radii = np.linalg.norm(vertices[faces][:, :, :2] - 5.0, axis=2)
    wall = (radii < 0.6).all(axis=1)
    assert wall.sum() == 32
    assert close(vertices, faces[~wall]) == "mesh has 32 open edges"


def test_doubled_triangles_and_flat_walls_are_removed():
    vertices, faces = arrays(Manifold.cube([1.0, 1.0, 1.0]))
    closed(vertices, np.vstack([faces, faces[:3]]), 1.0, "3 doubled triangles removed")
    inner = np.array([[0, 7, 3], [3, 7, 0]])
    closed(vertices, np.vstack([faces, inner]), 1.0, "1 flat shell without volume removed")


def test_cubes_that_share_an_edge_are_separated():
    one, faces = arrays(Manifold.cube([1.0, 1.0, 1.0]))
    vertices = np.vstack([one, one + np.array([1.0, 1.0, 0.0])])
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    shared = inverse.reshape(-1)[np.vstack([faces, faces + 8])]
    assert not topology.is_closed(shared)
    surface = close(unique, shared)
    assert isinstance(surface, Surface)
    assert topology.is_closed(surface.faces)
    assert measures.volume(surface.vertices, surface.faces) == pytest.approx(2.0)


def test_bodies_that_overlap_are_united_and_others_kept():
    vertices, faces = arrays(Manifold.cube([2.0, 2.0, 2.0]))
    n = len(vertices)
    for shift, volume, bodies, mended in [
        ([1.0, 0.0, 0.0], 12.0, 1, "2 bodies that touch or overlap united"),
        ([5.0, 0.0, 0.0], 16.0, 2, None),
    ]:
        surface = closed(np.vstack([vertices, vertices + shift]), np.vstack([faces, faces + n]), volume, mended)
        assert surface.bodies == bodies


def test_what_encloses_nothing_is_refused():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    assert close(vertices, np.array([[0, 1, 2]])) == "mesh has 3 open edges"
    assert close(vertices, np.array([[0, 1, 2], [2, 1, 0]])) == "it encloses no volume"
    assert close(np.zeros((3, 3)), np.array([[0, 1, 2]])) == "all its points coincide"

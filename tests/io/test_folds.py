"""Surfaces folded onto themselves are told from sharp ones."""

from __future__ import annotations

import numpy as np
import pytest
from solids import box, part, rod

from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.mesh import measures
from sashimono.geometry.mesh.topology import is_closed
from sashimono.io.checks import close_parts
from sashimono.io.mending.folds import count_folded, without_flat_folds
from sashimono.io.raw import RawPart, ReadConfig


def folded_box(lifted: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A box one of whose triangles is a fan about a point beyond its edge, in its plane or so far off it."""
    mesh = part("box", box((0.03, 0.03, 0.03)))
    vertices, faces = mesh.vertices_part, mesh.faces.astype(np.int64)
    a, b, c = faces[0]
    beyond = 0.7 * vertices[a] + 0.7 * vertices[b] - 0.4 * vertices[c]
    beyond = beyond + lifted * np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])
    fan = np.array([[a, b, len(vertices)], [b, c, len(vertices)], [c, a, len(vertices)]])
    return np.vstack([vertices, beyond]), np.vstack([faces[1:], fan])


def test_a_fold_is_counted_and_a_sharp_edge_is_not() -> None:
    vertices, faces = folded_box()
    assert count_folded(vertices, faces, config=ReadConfig()) > 0
    blade = box((0.05, 0.02, 0.0001)).rotate((0.0, 0.2, 0.0)) ^ box((0.05, 0.02, 0.0001))
    for solid in (box((0.03, 0.03, 0.03)), rod(0.01, 0.05), blade):
        mesh = part("sharp", solid)
        assert count_folded(mesh.vertices_part, mesh.faces, config=ReadConfig()) == 0


def test_the_note_names_the_part() -> None:
    vertices, faces = folded_box(lifted=0.02)
    raw = RawPart(name="tab", vertices=vertices, faces=faces, T_world_part=np.eye(4), where="tab")
    notes = close_parts([raw], repair=True, config=ReadConfig()).notes
    assert any(note.startswith("tab: folded onto itself") for note in notes)


def ring_whose_fan_crosses_its_hole() -> tuple[np.ndarray, np.ndarray]:
    """A ring. The triangles of its lower face are a fan about one corner of its rim: over the hole, two lie there."""
    mesh = part("ring", rod(0.02, 0.01) - rod(0.012, 0.01))
    vertices, faces = mesh.vertices_part, mesh.faces.astype(np.int64)
    lower = (vertices[faces][:, :, 2] < -0.0049).all(axis=1)
    starts, stops = faces[lower].reshape(-1), np.roll(faces[lower], -1, axis=1).reshape(-1)
    edges = set(zip(starts.tolist(), stops.tolist(), strict=True))
    rims = sorted(edge for edge in edges if edge[::-1] not in edges)
    corner = int(np.argmax(vertices[:, 0] - vertices[:, 2]))
    fan = [(corner, a, b) for a, b in rims if corner not in (a, b)]
    return vertices, np.concatenate([faces[~lower], np.array(fan)])


def test_a_fan_over_the_hole_of_a_ring_is_drawn_anew() -> None:
    """Points in the hole were inside for the nearest face; a pin there could not leave."""
    vertices, faces = ring_whose_fan_crosses_its_hole()
    assert is_closed(faces)
    assert count_folded(vertices, faces, config=ReadConfig()) > 0
    drawn = without_flat_folds(vertices, faces, config=ReadConfig())
    assert is_closed(drawn)
    assert count_folded(vertices, drawn, config=ReadConfig()) == 0
    assert measures.volume(vertices, drawn) == pytest.approx(measures.volume(vertices, faces))
    above = np.array([[0.0, 0.0, -0.0049], [0.003, 0.002, -0.0051]])
    assert (SignedDistance(vertices, drawn).query(above) > 0.0).all()
    raw = RawPart(name="ring", vertices=vertices, faces=faces, T_world_part=np.eye(4), where="ring")
    closed = close_parts([raw], repair=True, config=ReadConfig())
    assert closed.folded == {}
    assert "drawn anew" in closed.mended["ring"][0]
    assert close_parts([raw], repair=False, config=ReadConfig()).folded.keys() == {"ring"}


def test_a_wall_of_no_thickness_in_two_planes_stays_and_is_counted() -> None:
    vertices, faces = folded_box(lifted=0.02)
    assert without_flat_folds(vertices, faces, config=ReadConfig()) is faces

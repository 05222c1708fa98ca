"""Surfaces folded onto themselves are told from sharp ones."""

from __future__ import annotations

import numpy as np
from solids import box, part, rod

from sashimono.io.checks import close_parts
from sashimono.io.mending.folds import count_folded
from sashimono.io.raw import RawPart, ReadConfig


def folded_box() -> tuple[np.ndarray, np.ndarray]:
    """A box one of whose triangles is a fan about a point beyond its edge, in its plane."""
    mesh = part("box", box((0.03, 0.03, 0.03)))
    vertices, faces = mesh.vertices_part, mesh.faces.astype(np.int64)
    a, b, c = faces[0]
    beyond = 0.7 * vertices[a] + 0.7 * vertices[b] - 0.4 * vertices[c]
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
    vertices, faces = folded_box()
    raw = RawPart(name="tab", vertices=vertices, faces=faces, T_world_part=np.eye(4), where="tab")
    notes = close_parts([raw], repair=True, config=ReadConfig()).notes
    assert any(note.startswith("tab: folded onto itself") for note in notes)

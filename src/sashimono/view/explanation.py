"""The page that shows why a part cannot leave: what is in its way coloured, arrows for how far it gets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sashimono.assembly import Assembly
from sashimono.disassembly.explanation.explain import BlockedDirection, Blocker, Explanation
from sashimono.disassembly.explanation.report import change_words, explanation_lines
from sashimono.files import atomic_write
from sashimono.geometry.features.directions import direction_name
from sashimono.view.config import ViewConfig
from sashimono.view.html import render_page
from sashimono.view.scene import Packer, ViewerScene, still_product

SCRIPTS = ("se3.js", "data.js", "bodies.js", "contacts.js", "stage.js", "panel.js", "explain.js")
"""The page's own scripts, in the order in which they are joined."""


def pack_triangles(corners: np.ndarray, packer: Packer) -> dict[str, int]:
    """Pack triangles, three points each, in the world frame."""
    points = corners.reshape(-1, 3).astype("<f4")
    return {"at": packer.add(points), "count": len(points)}


def _blocker(found: Explanation, blocker: Blocker, assembly: Assembly, packer: Packer) -> dict[str, Any]:
    seen = blocker.obstruction
    entry = {
        "part": assembly.index(blocker.part),
        "travel": blocker.travel if math.isfinite(blocker.travel) else None,
    }
    if seen is None:
        return {**entry, "marks": {}}
    part, other = assembly.part(found.part), assembly.part(blocker.part)
    return {
        **entry,
        "marks": {
            "part": pack_triangles(part.vertices_world[part.faces[seen.faces_part]], packer),
            "blocker": pack_triangles(other.vertices_world[other.faces[seen.faces_obstacle]], packer),
            "patch": pack_triangles(seen.patch[:, [0, 1, 2, 0, 2, 3]], packer),
        },
    }


def _direction(found: Explanation, entry: BlockedDirection, assembly: Assembly, packer: Packer) -> dict[str, Any]:
    low, high = assembly.part(found.part).bounds_world
    front = float((assembly.part(found.part).vertices_world @ entry.direction).max())
    center = (low + high) / 2
    return {
        "name": direction_name(entry.direction),
        "vector": entry.direction.tolist(),
        "start": (center + (front - float(center @ entry.direction)) * entry.direction).tolist(),
        "travel": entry.travel if math.isfinite(entry.travel) else None,
        "blockers": [_blocker(found, blocker, assembly, packer) for blocker in entry.blockers],
    }


def make_explanation_scene(found: Sequence[Explanation], assembly: Assembly, config: ViewConfig) -> ViewerScene:
    """Return the explanations and the geometry, ready to be put into the page."""
    packer = Packer()
    json = still_product(assembly.source, assembly.parts, config, packer) | {
        "explanations": [
            {
                "part": assembly.index(entry.part),
                "fixed": [assembly.index(name) for name in entry.fixed],
                "answer": str(entry.answer),
                "verdict": explanation_lines(entry)[0],
                "removeFirst": [[assembly.index(name) for name in names] for names in entry.removal_sets],
                "change": None if entry.exit_direction is not None else change_words(entry),
                "directions": [_direction(entry, direction, assembly, packer) for direction in entry.directions],
            }
            for entry in found
        ],
    }
    return ViewerScene(json=json, geometry=packer.content())


def write_explanation(
    found: Sequence[Explanation], assembly: Assembly, path: str | Path, *, config: ViewConfig | None = None
) -> Path:
    """Write one self-contained page that shows why parts cannot leave, and return its path.

    The explained part is orange, what blocks it blue, the faces that would meet yellow and pale red, bright red
    where they would; an arrow a direction, as long as the free travel. Raises OSError if ``path`` cannot be written.
    """
    scene = make_explanation_scene(found, assembly, config or ViewConfig())
    page = render_page(scene, title=f"{scene.json['title']} · why a part is stuck", scripts=SCRIPTS)
    with atomic_write(path) as scratch:
        scratch.write_bytes(page.encode("utf-8"))
    return Path(path)

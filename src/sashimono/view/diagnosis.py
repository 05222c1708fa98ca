"""The page of ``sashimono doctor``: what was found, and where; a click shows the parts that a line is about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from manifold3d import Error

from sashimono.assembly import Part
from sashimono.examination import Diagnosis
from sashimono.examination.report import verdict
from sashimono.files import atomic_write
from sashimono.geometry.mesh.solid import to_manifold
from sashimono.view.config import ViewConfig
from sashimono.view.explanation import pack_triangles
from sashimono.view.html import render_page
from sashimono.view.scene import Packer, ViewerScene, still_product

SCRIPTS = ("se3.js", "data.js", "bodies.js", "contacts.js", "stage.js", "panel.js", "doctor.js")
"""The page's own scripts, in the order in which they are joined."""

MOST_MARKS = 60
"""Overlaps of which the shared body is drawn, the worst first."""


def make_diagnosis_scene(found: Diagnosis, config: ViewConfig) -> ViewerScene:
    """Return what was found and the geometry, ready to be put into the page."""
    parts = (*found.assembly.parts, *(part for part, _ in found.broken))
    index = {part.name: k for k, part in enumerate(parts)}
    packer = Packer()
    marks = [
        None if k >= MOST_MARKS else _shared(parts[index[pair.first]], parts[index[pair.second]], packer)
        for k, pair in enumerate(found.overlaps)
    ]
    json = still_product(found.assembly.source, parts, config, packer) | {
        "ok": found.ok,
        "verdict": verdict(found),
        "facts": _facts(found),
        "findings": [
            {
                "kind": each.kind,
                "severity": each.severity,
                "parts": [index[name] for name in each.parts if name in index],
                "message": each.message,
                "wayOut": each.way_out,
            }
            for each in found.findings
        ],
        "overlaps": [
            {
                "parts": [index[pair.first], index[pair.second]],
                "guess": pair.guess,
                "depth": pair.depth,
                "fraction": pair.fraction,
                "mark": mark,
            }
            for pair, mark in zip(found.overlaps, marks, strict=True)
        ],
        "clearances": [
            {"parts": [index[each.first], index[each.second]], "gap": each.gap} for each in found.clearances
        ],
        "treatments": [
            {"part": index[each.part], "planned": each.planned, "how": each.how} for each in found.treatments
        ],
    }
    return ViewerScene(json=json, geometry=packer.content())


def _facts(found: Diagnosis) -> list[list[str]]:
    """Label and value of what is said at the top."""
    size, _, unit = found.size_words.partition(": ")
    loose = sum(not others for others in found.touching.values())
    return [
        ["size", size],
        ["unit", unit],
        ["parts", str(len(found.assembly) + len(found.broken))],
        ["fasteners", str(len(found.fasteners))],
        ["open or broken", str(len(found.broken))],
        ["overlapping pairs", str(len(found.overlaps))],
        ["touched by nothing", str(loose)],
    ]


def _shared(first: Part, second: Part, packer: Packer) -> dict[str, int] | None:
    """Pack the surface of the body that two parts share."""
    solids = [to_manifold(part.vertices_world, part.faces) for part in (first, second)]
    if any(solid.status() != Error.NoError for solid in solids):
        return None
    mesh = (solids[0] ^ solids[1]).to_mesh64()
    faces = np.array(mesh.tri_verts).astype(np.int64)
    return pack_triangles(np.array(mesh.vert_properties)[:, :3][faces], packer) if len(faces) else None


def write_diagnosis(found: Diagnosis, path: str | Path, *, config: ViewConfig | None = None) -> Path:
    """Write one self-contained page that shows what an input is like, and return its path.

    A line of the list shows its parts in orange (red if they stand in the way), shared bodies bright red, the rest
    faint. Raises OSError if ``path`` cannot be written.
    """
    scene = make_diagnosis_scene(found, config or ViewConfig())
    page = render_page(scene, title=f"{scene.json['title']} · what stands in the way", scripts=SCRIPTS)
    with atomic_write(path) as scratch:
        scratch.write_bytes(page.encode("utf-8"))
    return Path(path)

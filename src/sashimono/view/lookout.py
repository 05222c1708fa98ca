"""From where each step of the viewer is best seen, and which parts then stand in the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan
from sashimono.view.display_mesh import cluster_vertices
from sashimono.view.manual.camera import Stand, Subject, choose_glass, choose_stand
from sashimono.view.manual.drawing import Solid, look_from
from sashimono.view.playback import UP, PlayedStep

_COARSE = 800
"""Surfaces of more triangles are simplified."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lookout:
    """Where a viewer stands to see one step."""

    toward: Float[np.ndarray, "3"]
    """Unit direction towards the viewer, world frame of the page."""
    hiding: tuple[str, ...]
    """Placed parts that hide the coming part, or where it ends, from there."""


def step_lookouts(plan: AssemblyPlan, played: Sequence[PlayedStep], assembly: Assembly) -> tuple[Lookout | None, ...]:
    """Return from where each played step is best seen; None for those that bring nothing.

    Neighbouring steps are seen from near places, if nothing speaks against it.
    """
    up = np.array(UP) if plan.table is None else plan.table.normal / np.linalg.norm(plan.table.normal)
    solids = {part.name: _coarse(part.vertices_part, part.faces) for part in assembly.parts}
    last: Stand | None = None
    found: list[Lookout | None] = []
    for entry in played:
        if not entry.step.moves:
            found.append(None)
            continue
        subject = _subject(plan, entry, solids)
        last = choose_stand(subject, up, last)
        R = look_from(up, last.azimuth, last.elevation)
        hiding = choose_glass(subject, R) if subject.fixed else frozenset()
        found.append(Lookout(toward=R[2], hiding=tuple(entry.step.fixed[k] for k in sorted(hiding))))
    return tuple(found)


def _coarse(vertices: np.ndarray, faces: np.ndarray) -> Solid:
    """Return the simplified surface of a part, in the part's frame."""
    if len(faces) > _COARSE:
        vertices, faces = cluster_vertices(vertices, np.asarray(faces, dtype=np.int64), 5)
    try:
        corners = ConvexHull(vertices).vertices
    except (QhullError, ValueError):  # few vertices, or all in a plane
        corners = None
    return Solid(points=vertices, faces=faces, color=np.ones(3), corners=corners)


def _subject(plan: AssemblyPlan, entry: PlayedStep, parts: Mapping[str, Solid]) -> Subject:
    step = entry.step
    # a subassembly is put together on a bench: where its world frame is shown
    T_page = entry.poses[-1] @ se3.inverse(plan.parts[step.part])
    start = next((segment.start for segment in entry.segments if segment.kind == "insertion"), 0)
    begin = entry.poses[start] @ se3.inverse(entry.poses[-1])

    def solids(names: Sequence[str], T: Float[np.ndarray, "4 4"]) -> tuple[Solid, ...]:
        return tuple(replace(parts[name], points=se3.apply(T @ plan.parts[name], parts[name].points)) for name in names)

    target = solids(step.members, T_page)
    points = np.concatenate([solid.outermost for solid in target])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    ends = se3.apply(begin, middle[None])[0], middle
    direction = None if step.direction is None else T_page[:3, :3] @ step.direction
    return Subject(
        fixed=solids(step.fixed, T_page),
        moving=solids(step.members, begin @ T_page),
        target=target,
        way=np.linspace(*ends, 12),
        direction=direction,
    )

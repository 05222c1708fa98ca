"""Parts that nobody sees: shut in a cavity of another part, or behind others from wherever one looks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sashimono.assembly import Assembly, Part
from sashimono.examination.config import DoctorConfig
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.features.directions import sphere_directions
from sashimono.geometry.features.spread import spread
from sashimono.geometry.mesh import measures, topology


def shut_in(assembly: Assembly) -> list[tuple[str, str]]:
    """Return pairs (part, other): the part lies in a cavity that the other, one rigid part, closes on all sides."""
    boxes = {part.name: part.bounds_world for part in assembly.parts}
    found = []
    for other in assembly.parts:
        for shell in _cavities(other):
            points = other.vertices_world[np.unique(shell)]
            low, high = points.min(axis=0), points.max(axis=0)
            for part in assembly.parts:
                inner = boxes[part.name]
                if part is other or (inner[0] < low).any() or (inner[1] > high).any():
                    continue
                turns = measures.winding_numbers(
                    part.vertices_world[part.faces[:1]].mean(axis=1), other.vertices_world, shell
                )
                if abs(turns[0]) > 0.5:
                    found.append((part.name, other.name))
    return found


def _cavities(part: Part) -> list[np.ndarray]:
    """Faces of each shell that bounds an empty room inside a part."""
    of_shell = topology.shells(part.faces)
    count = int(of_shell.max()) + 1
    if count == 1:
        return []
    volumes = np.bincount(
        of_shell, weights=measures.tetrahedron_volumes(part.vertices_part, part.faces), minlength=count
    )
    return [part.faces[of_shell == k] for k in np.flatnonzero(volumes < 0.0)]


def unseen(
    assembly: Assembly, bodies: Mapping[str, Body], others: Sequence[Part], config: DoctorConfig
) -> tuple[str, ...]:
    """Return the parts of which no ray from any point looked at gets out of the assembly.

    Args:
        assembly: Sound parts in their assembled poses.
        bodies: Their bodies, by name.
        others: More parts that may hide them.
        config: How closely it is looked.
    """
    parts = [*assembly.parts, *others]
    starts = np.cumsum([0, *(len(part.vertices_world) for part in parts)])
    vertices = np.concatenate([part.vertices_world for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
    scene = SignedDistance(vertices, faces)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    directions = sphere_directions(config.rays)
    return tuple(
        part.name
        for part in assembly.parts
        if not any(_sees_out(bodies[part.name], part, scene, directions, size, count) for count in config.seen_from)
    )


def _sees_out(body: Body, part: Part, scene: SignedDistance, directions: np.ndarray, size: float, count: int) -> bool:
    """Whether a ray from one of so many points of the part's surface meets nothing."""
    kept = spread(body.samples / body.radius, min(count, len(body.samples)))
    points = se3.apply(part.T_world_part, body.samples[kept])
    normals = body.sample_normals[kept] @ part.T_world_part[:3, :3].T
    ahead = normals @ directions.T > 0.1
    k, d = np.nonzero(ahead)
    origins = points[k] + 1e-6 * size * normals[k]
    blocked = np.zeros(len(origins), dtype=bool)
    for side in ("entering", "leaving"):  # one that overlaps is left first
        left = np.flatnonzero(~blocked)
        distances, _ = cast_rays(scene, origins[left], directions[d[left]], side=side)
        blocked[left] = np.isfinite(distances)
    return bool((~blocked).any())

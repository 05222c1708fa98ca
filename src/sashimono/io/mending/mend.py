"""Closing the surface of a part: welding, turning, filling small holes, uniting bodies that overlap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold, OpType
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from sashimono.geometry.mesh import measures, topology
from sashimono.geometry.mesh.solid import to_manifold
from sashimono.io.mending.holes import fill_holes
from sashimono.io.raw import ReadConfig


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A triangle mesh on its way to being closed."""

    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    mended: tuple[str, ...] = ()
    """What was changed, apart from welding equal vertices."""
    unsure: Int[np.ndarray, "corner"] | None = None
    """Vertices of shells whose winding was made consistent. Whether they point inward or outward is not known yet."""
    bodies: int = 1
    """Number of separate bodies, once that is known."""


def close_surface(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, repair: bool, config: ReadConfig
) -> Surface | str:
    """Return the part as closed, outward surfaces of non-overlapping bodies, or what is wrong with it.

    What comes back is an oriented 2-manifold: every edge has two faces, running opposite ways.
    Welding equal vertices and dropping triangles that vanish with it is always done; anything else
    only with ``repair``, and named in ``mended``.
    """
    diagonal = float(np.linalg.norm(np.ptp(vertices[np.unique(faces)], axis=0)))
    if diagonal == 0.0:
        return "all its points coincide"
    tried: list[Surface] = []
    for surface in _welded(vertices, faces, config.weld * diagonal):
        if topology.is_closed(surface.faces):
            return _oriented(surface, repair=repair, diagonal=diagonal)
        if len(surface.faces):
            tried.append(surface)
    if not tried:
        return "all its triangles are degenerate"
    tried.sort(key=lambda surface: topology.edges(surface.faces).open_count)
    for surface in tried if repair else ():
        mended = _mended(surface, config)
        if mended is not None:
            return _oriented(mended, repair=repair, diagonal=diagonal)
    return _problem(tried[0])


def closes(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], config: ReadConfig) -> bool:
    """Return whether welding alone closes the surface."""
    tolerance = config.weld * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return any(topology.is_closed(surface.faces) for surface in _welded(vertices, faces, tolerance))


def _compact(surface: Surface) -> Surface:
    """Drop triangles with a repeated vertex, and vertices that no triangle uses."""
    f = surface.faces
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    used, inverse = np.unique(f.reshape(-1), return_inverse=True)
    return replace(surface, vertices=surface.vertices[used], faces=inverse.reshape(-1, 3))


def _merged_exactly(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"],
    group: Int[np.ndarray, "vertex"] | None = None,
) -> Surface:  # fmt: skip
    """Weld vertices with equal coordinates (and, if groups are given, equal group), in order of appearance."""
    rows = vertices + 0.0  # -0.0 becomes 0.0
    keys = rows if group is None else np.column_stack([rows, group])
    order = np.lexsort(keys.T)
    fresh = np.r_[True, (keys[order][1:] != keys[order][:-1]).any(axis=1)]
    first = order[np.maximum.accumulate(np.where(fresh, np.arange(len(order)), 0))]
    target = np.empty(len(order), dtype=np.int64)
    target[order] = first
    return _compact(Surface(vertices=rows, faces=target[faces]))


def _welded(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], tolerance: float
) -> Iterator[Surface]:
    """Yield the mesh as it is, then with more and more welded: equal vertices, equal within a solid, near ones."""
    yield _compact(Surface(vertices=vertices, faces=faces))
    exact = _merged_exactly(vertices, faces)
    yield exact
    chunks = topology.stream_chunks(exact.faces)
    if chunks.max(initial=0) > 0:
        corners = exact.faces.reshape(-1)
        apart = Surface(vertices=exact.vertices[corners], faces=np.arange(len(corners)).reshape(-1, 3))
        yield _merged_exactly(apart.vertices, apart.faces, group=np.repeat(chunks, 3))
    pairs = KDTree(exact.vertices).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        count = len(exact.vertices)
        graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
        labels = connected_components(graph, directed=False)[1]
        first = np.unique(labels, return_index=True)[1]
        near = _compact(replace(exact, faces=first[labels][exact.faces]))
        if len(near.faces):
            yield near


def _mended(surface: Surface, config: ReadConfig) -> Surface | None:
    """Return the surface closed by the mildest remedy that does it, or None."""
    turned_faces, turned = topology.unify_winding(surface.faces)
    turned_notes = (f"the winding of {int(turned.sum())} triangles reversed",) if turned.any() else ()
    unsure = np.unique(surface.faces[turned])
    rewound = replace(surface, faces=turned_faces, mended=turned_notes, unsure=unsure)
    if topology.is_closed(rewound.faces):
        return rewound
    single = _without_doubles(rewound)
    for candidate in (rewound, single):
        if topology.is_closed(candidate.faces):
            return candidate
        separated = _separated(candidate)
        if separated is not None:
            return separated
    filled = fill_holes(single.vertices, single.faces, config)
    if filled is not None:
        faces, note = filled
        candidate = replace(single, faces=faces, mended=(*single.mended, note))
        return candidate if topology.is_closed(faces) else _separated(candidate)
    return None


def _without_doubles(surface: Surface) -> Surface:
    """Cancel triangles that lie back to back, and keep one of those that lie twice."""
    faces = surface.faces
    lowest = np.argmin(faces, axis=1)
    rolled = faces[np.arange(len(faces))[:, None], (lowest[:, None] + np.arange(3)) % 3]
    even = rolled[:, 1] < rolled[:, 2]
    _, first, inverse = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    net = np.bincount(inverse.reshape(-1), weights=np.where(even, 1.0, -1.0))
    count = np.bincount(inverse.reshape(-1))
    if (count == 1).all():
        return surface
    kept = []
    for k in np.flatnonzero(net != 0.0):
        if count[k] == 1:
            kept.append(first[k])
        else:
            members = np.flatnonzero(inverse.reshape(-1) == k)
            kept.append(members[even[members] == (net[k] > 0)][0])
    note = f"{len(faces) - len(kept)} doubled triangles removed"
    return replace(surface, faces=faces[np.sort(np.array(kept, dtype=np.int64))], mended=(*surface.mended, note))


def _separated(surface: Surface) -> Surface | None:
    """Return the surface with bodies that meet at an edge taken apart there, if that closes it."""
    if not len(surface.faces) or not topology.edges(surface.faces).balanced:
        return None
    solid = to_manifold(surface.vertices, surface.faces)
    if solid.status() != Error.NoError or solid.is_empty():
        return None
    note = (*surface.mended, "edges shared by more than two triangles separated")
    return _from_manifold(solid, note)


def _from_manifold(solid: Manifold, mended: tuple[str, ...]) -> Surface | None:
    out = solid.to_mesh64()
    surface = _compact(Surface(
        vertices=np.array(out.vert_properties[:, :3]), faces=np.array(out.tri_verts).astype(np.int64), mended=mended
    ))  # fmt: skip
    return surface if topology.is_closed(surface.faces) else None


def _oriented(surface: Surface, *, repair: bool, diagonal: float) -> Surface | str:
    """Return the closed surface pointing outward, its bodies united where they overlap."""
    nest = topology.nesting(surface.vertices, surface.faces)
    flat = np.abs(nest.volumes) <= 1e-12 * diagonal**3
    if flat.all():
        return "it encloses no volume"
    if flat.any() and repair:
        count = int(flat.sum())
        note = f"{count} flat shell{'s' * (count > 1)} without volume removed"
        kept = replace(surface, faces=surface.faces[~flat[nest.of_face]], mended=(*surface.mended, note))
        result = _oriented(kept, repair=repair, diagonal=diagonal)
        return _compact(result) if isinstance(result, Surface) else result
    doubtful = [] if surface.unsure is None else surface.unsure
    unsure = np.isin(surface.faces.reshape(-1), doubtful).reshape(-1, 3).max(axis=1)
    faces, turned = topology.orient_outward(nest, surface.faces, unsure)
    if turned and not repair:
        return "its surface points inward"
    note = () if not turned or surface.unsure is not None else ("inward surface turned outward",)
    out = replace(surface, faces=faces, mended=(*surface.mended, *note), unsure=None)
    if turned:
        nest = topology.nesting(out.vertices, out.faces)
    out = _united(out, nest, unite=repair)
    if not measures.volume(out.vertices, out.faces) > 1e-12 * diagonal**3:
        return "it encloses no volume"
    return out


def _united(surface: Surface, nest: topology.Nesting, *, unite: bool) -> Surface:
    """Unite bodies that overlap or touch; count those that stand apart."""
    body_of_face = topology.bodies(nest)[nest.of_face]
    count = int(body_of_face.max()) + 1
    if count == 1 or not unite:
        return replace(surface, bodies=count)
    members = [surface.faces[body_of_face == k] for k in range(count)]
    low = np.array([surface.vertices[m].min(axis=(0, 1)) for m in members])
    high = np.array([surface.vertices[m].max(axis=(0, 1)) for m in members])
    near = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)
    solids = [_body(surface.vertices, m) for m in members] if near.sum() > count else []
    if not solids or any(s.status() != Error.NoError for s in solids):
        return replace(surface, bodies=count)
    union = Manifold.batch_boolean(solids, OpType.Add)
    apart = len(union.decompose()) == len(nest.volumes)
    total = sum(s.volume() for s in solids)
    if union.status() != Error.NoError or (apart and abs(union.volume() - total) <= 1e-9 * total):
        return replace(surface, bodies=count)
    united = _from_manifold(union, (*surface.mended, f"{count} bodies that touch or overlap united"))
    if united is None:
        return replace(surface, bodies=count)
    nest = topology.nesting(united.vertices, united.faces)
    return replace(united, bodies=int(topology.bodies(nest).max()) + 1)


def _body(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> Manifold:
    used, inverse = np.unique(faces.reshape(-1), return_inverse=True)
    return to_manifold(vertices[used], inverse.reshape(-1, 3))


def _problem(surface: Surface) -> str:
    """Return what keeps a surface from being closed, in words."""
    e = topology.edges(surface.faces)
    if e.open_count:
        return f"mesh has {e.open_count} open edge{'s' * (e.open_count > 1)}"
    if e.non_manifold_count:
        return f"mesh has {e.non_manifold_count} edge{'s' * (e.non_manifold_count > 1)} with more than two faces"
    return f"mesh is wound inconsistently at {e.inconsistent_count} edge{'s' * (e.inconsistent_count > 1)}"

"""How the triangles of a mesh hang together: edges, closedness, winding, shells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sashimono.geometry.mesh.measures import tetrahedron_volumes, winding_numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """The undirected edges of a mesh and how its faces use them."""

    of_face: Int[np.ndarray, "face 3"]
    """Edge of each face's sides ab, bc, ca."""
    forward: Bool[np.ndarray, "face 3"]
    """Whether the face runs along the edge from its lower to its higher vertex."""
    uses: Int[np.ndarray, "edge"]
    """Number of faces at each edge."""
    net: Int[np.ndarray, "edge"]
    """Forward uses minus backward uses."""

    @property
    def open_count(self) -> int:
        """Number of edges with an odd number of faces."""
        return int((self.uses % 2 == 1).sum())

    @property
    def non_manifold_count(self) -> int:
        """Number of edges with more than two faces."""
        return int((self.uses > 2).sum())

    @property
    def inconsistent_count(self) -> int:
        """Number of edges whose two faces run the same way."""
        return int(((self.uses == 2) & (self.net != 0)).sum())

    @property
    def closed(self) -> bool:
        """Whether every edge has exactly two faces, running opposite ways."""
        return bool(len(self.uses) > 0 and (self.uses == 2).all() and (self.net == 0).all())

    @property
    def balanced(self) -> bool:
        """Whether as many faces run one way along every edge as the other: the volume is well defined."""
        return bool(len(self.uses) > 0 and (self.net == 0).all())


def edge_keys(faces: Int[np.ndarray, "face 3"]) -> Int[np.ndarray, "half_edge"]:
    """Return one number for each side (ab, bc, ca) of each face: the same number, the same two vertices."""
    start = faces.astype(np.int64)
    stop = np.roll(start, -1, axis=1)
    keys = np.minimum(start, stop) * (int(faces.max(initial=0)) + 1) + np.maximum(start, stop)
    return keys.reshape(-1)


def edges(faces: Int[np.ndarray, "face 3"]) -> Edges:
    """Return the edges of a mesh."""
    forward = faces < np.roll(faces, -1, axis=1)
    _, inverse = np.unique(edge_keys(faces), return_inverse=True)
    of_face = inverse.reshape(-1, 3)
    count = int(of_face.max(initial=-1)) + 1
    signs = np.where(forward, 1, -1).reshape(-1)
    return Edges(
        of_face=of_face,
        forward=forward,
        uses=np.bincount(inverse.reshape(-1), minlength=count),
        net=np.rint(np.bincount(inverse.reshape(-1), weights=signs, minlength=count)).astype(np.int64),
    )


def is_closed(faces: Int[np.ndarray, "face 3"]) -> bool:
    """Return whether the mesh is a closed, consistently wound 2-manifold: each edge has two opposite faces."""
    return edges(faces).closed


def _face_pairs(e: Edges) -> tuple[Int[np.ndarray, "pair 2"], Bool[np.ndarray, "pair"]]:
    """Return the faces at each edge with exactly two, and whether those run opposite ways."""
    flat = e.of_face.reshape(-1)
    order = np.argsort(flat, kind="stable")
    order = order[e.uses[flat[order]] == 2]
    return (order // 3).reshape(-1, 2), e.net[flat[order[::2]]] == 0


def neighbouring_faces(faces: Int[np.ndarray, "face 3"]) -> Int[np.ndarray, "pair 2"]:
    """Return the two faces at each edge that has exactly two."""
    return _face_pairs(edges(faces))[0]


def shells(faces: Int[np.ndarray, "face 3"]) -> Int[np.ndarray, "face"]:
    """Return the shell of each face: faces joined across two-faced edges, numbered by first appearance."""
    pairs, _ = _face_pairs(edges(faces))
    return _number_by_appearance(_components(pairs, len(faces)))


def _components(pairs: Int[np.ndarray, "pair 2"], count: int) -> Int[np.ndarray, "count"]:
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _number_by_appearance(labels: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n"]:
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.reshape(-1)]


def unify_winding(faces: Int[np.ndarray, "face 3"]) -> tuple[Int[np.ndarray, "face 3"], Bool[np.ndarray, "face"]]:
    """Return the faces with neighbours wound alike, the majority of each shell kept, and which were reversed.

    Each face stands twice in a graph, as it is and reversed; neighbours that agree are joined like
    with like, others crosswise. A shell that cannot be oriented (a Möbius strip) is left as it is.
    """
    n = len(faces)
    pairs, agree = _face_pairs(edges(faces))
    swap = np.where(agree, 0, n)
    links = np.concatenate(
        [
            np.column_stack([pairs[:, 0], pairs[:, 1] + swap]),
            np.column_stack([pairs[:, 0] + n, pairs[:, 1] + n - swap]),
        ]
    )
    labels = _components(links, 2 * n)
    kept, turned = labels[:n], labels[n:]
    votes = np.bincount(kept, minlength=2 * n)
    reverse = (votes[turned] > votes[kept]) | ((votes[turned] == votes[kept]) & (turned < kept))
    out = faces.copy()
    out[reverse] = out[reverse][:, ::-1]
    return out, reverse


def stream_chunks(faces: Int[np.ndarray, "face 3"]) -> Int[np.ndarray, "face"]:
    """Return a chunk number for each face: the face list cut wherever all surface so far is closed.

    Solids written one after another come apart this way even where they share edges.
    """
    flat = edges(faces).of_face.reshape(-1)
    order = np.argsort(flat, kind="stable")
    keys, owner = flat[order], order // 3
    starts = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]])
    position = np.arange(len(keys)) - np.repeat(starts, np.diff(np.r_[starts, len(keys)]))
    opening = position % 2 == 0
    pending = np.bincount(owner[opening], minlength=len(faces)) - np.bincount(owner[~opening], minlength=len(faces))
    closed_after = np.cumsum(pending) == 0
    return np.cumsum(np.r_[0, closed_after[:-1]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Nesting:
    """The shells of a closed mesh and which lie inside which."""

    of_face: Int[np.ndarray, "face"]
    volumes: Float[np.ndarray, "shell"]
    """Signed volume of each shell [m³]; a cavity's is negative."""
    inside: Bool[np.ndarray, "shell shell"]
    """``inside[i, j]``: shell i lies inside shell j."""


def nesting(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> Nesting:
    """Return the shells of a closed mesh, their volumes, and which lie inside which."""
    of_face = shells(faces)
    count = int(of_face.max()) + 1
    volumes = np.bincount(of_face, weights=tetrahedron_volumes(vertices, faces), minlength=count)
    inside = np.zeros((count, count), dtype=bool)
    if count > 1:
        members = [faces[of_face == k] for k in range(count)]
        low = np.array([vertices[m].min(axis=(0, 1)) for m in members])
        high = np.array([vertices[m].max(axis=(0, 1)) for m in members])
        for i in range(count):
            for j in np.flatnonzero((low <= low[i]).all(axis=1) & (high >= high[i]).all(axis=1)):
                if i != j:
                    inside[i, j] = _lies_inside(vertices, members[i], members[j])
    return Nesting(of_face=of_face, volumes=volumes, inside=inside)


def _lies_inside(
    vertices: Float[np.ndarray, "vertex 3"], inner: Int[np.ndarray, "inner 3"], outer: Int[np.ndarray, "outer 3"]
) -> bool:
    """Return whether a shell lies inside another, by one of its points, by three where that one is on the border."""
    picks = np.unique(np.linspace(0, len(inner) - 1, 3).astype(int))
    points = vertices[inner[picks]].mean(axis=1)
    turns = np.abs(winding_numbers(points[:1], vertices, outer))
    if 0.1 < turns[0] % 1.0 < 0.9:
        turns = np.abs(winding_numbers(points, vertices, outer))
    return bool(np.median(turns) > 0.5)


def bodies(nest: Nesting) -> Int[np.ndarray, "shell"]:
    """Return the body of each shell: an outward shell with the cavities directly inside it."""
    count = len(nest.volumes)
    owner = np.arange(count)
    outward = nest.volumes > 0.0
    for k in np.flatnonzero(~outward):
        holders = np.flatnonzero(nest.inside[k] & outward)
        if len(holders):
            owner[k] = holders[np.argmin(nest.volumes[holders])]
    return _number_by_appearance(owner)


def orient_outward(
    nest: Nesting, faces: Int[np.ndarray, "face 3"], unsure: Bool[np.ndarray, "face"]
) -> tuple[Int[np.ndarray, "face 3"], int]:
    """Return the faces with outermost shells pointing outward and cavities inward, and how many shells were turned.

    An outermost shell that points inward is turned together with all inside it. A shell with
    ``unsure`` faces, whose own direction means nothing, follows its depth: odd ones are cavities.
    """
    depth = nest.inside.sum(axis=1)
    top = np.array([_outermost(nest, depth, k) for k in range(len(depth))])
    turn = nest.volumes[top] < 0.0
    for k in np.unique(nest.of_face[unsure]):
        turn[k] = (nest.volumes[k] < 0.0) != (depth[k] % 2 == 1)
    out = faces.copy()
    reverse = turn[nest.of_face]
    out[reverse] = out[reverse][:, ::-1]
    return out, int(turn.sum())


def _outermost(nest: Nesting, depth: Int[np.ndarray, "shell"], shell: int) -> int:
    holders = np.flatnonzero(nest.inside[shell])
    return int(holders[np.argmin(depth[holders])]) if len(holders) else shell


def split_apart(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> list[Int[np.ndarray, "_ 3"]]:
    """Return the faces of each group of shells whose boxes are apart from those of all others, in file order.

    No rigid body holds such groups together; shells whose boxes meet may touch, enclose or hold one another.
    """
    of_face = shells(faces)
    members = [faces[of_face == k] for k in range(int(of_face.max()) + 1)]
    boxes = [(vertices[own].min(axis=(0, 1)), vertices[own].max(axis=(0, 1))) for own in members]
    groups = [([k], low, high) for k, (low, high) in enumerate(boxes)]
    count = len(groups) + 1
    while len(groups) < count:  # a box that grew may meet more
        count, kept = len(groups), []
        for indices, low, high in groups:
            near = next((k for k, (_, a, b) in enumerate(kept) if (low <= b).all() and (a <= high).all()), None)
            if near is None:
                kept.append((indices, low, high))
            else:
                others, a, b = kept[near]
                kept[near] = ([*others, *indices], np.minimum(low, a), np.maximum(high, b))
        groups = kept
    return [np.concatenate([members[k] for k in sorted(indices)]) for indices, _, _ in groups]


def split_solids(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> list[Int[np.ndarray, "_ 3"]]:
    """Return the faces of each separate solid, cavities with the solid around them, in file order.

    Vertices with equal coordinates count as one, but solids that are written one after the other
    come apart even where they touch.
    """
    merged = np.unique(vertices + 0.0, axis=0, return_inverse=True)[1].reshape(-1)[faces]
    whole = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    faces, merged = faces[whole], merged[whole]
    if len(faces) == 0:
        return []
    separate = merged + stream_chunks(merged)[:, None] * (int(merged.max()) + 1)
    _, separate = np.unique(separate.reshape(-1), return_inverse=True)
    apart = np.empty((int(separate.max()) + 1, 3))
    apart[separate.reshape(-1)] = vertices[faces.reshape(-1)]
    nest = nesting(apart, separate.reshape(-1, 3))
    body = bodies(nest)[nest.of_face]
    return [faces[body == k] for k in range(int(body.max()) + 1)]

"""First-order reading of a part's contacts: where they let it go, and which parts may hold it when they do not.

A touching surface with unit normal g, pointing the way that relieves the contact, lets the part move
along d only if ``g · d >= 0`` to first order. If every direction has some contact with ``g · d`` well
below zero, the part is likely held. That is no proof: a ridge lower than the tolerance has such normals too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.geometry import se3
from sashimono.geometry.features.directions import sphere_directions


class ContactNormals:
    """Relieving contact normals of part pairs in the assembled pose, in the world frame."""

    def __init__(self, parts: PlacedParts, *, gap: float) -> None:
        self._parts = parts
        self._gap = gap
        self._pairs: dict[tuple[int, int], np.ndarray] = {}
        self._margins: dict[tuple[int, int, int], np.ndarray | None] = {}

    def of(self, part: int, others: int, *, samples: int) -> dict[int, Float[np.ndarray, "sample"]]:
        """Return the margins of evenly spread directions against each part that touches."""
        found = {other: self.margins(part, other, samples) for other in bits(others)}
        return {other: margins for other, margins in found.items() if margins is not None}

    def margins(self, part: int, other: int, samples: int) -> Float[np.ndarray, "sample"] | None:
        """Return the smallest ``g · d`` over a pair's normals for evenly spread directions; None without contact."""
        key = (part, other, samples)
        if key not in self._margins:
            normals = self._pair(part, other)
            directions = sphere_directions(samples)
            margins = np.full(samples, np.inf)
            for start in range(0, len(normals), 512):
                margins = np.minimum(margins, (directions @ normals[start : start + 512].T).min(axis=1))
            self._margins[key] = margins if len(normals) else None
        return self._margins[key]

    def touch(self, part: int, other: int) -> bool:
        """Return whether two parts touch."""
        return len(self._pair(part, other)) > 0

    def normals(
        self, part: int, other: int, *, offset: Float[np.ndarray, "3"] | None = None
    ) -> Float[np.ndarray, "contact 3"]:
        """Return the unit normals that relieve a part of another one, none twice.

        ``offset``: how far the part is shifted from where it is assembled [m]; not at all if None.
        """
        return self._pair(part, other) if offset is None else self._measure(part, other, offset)

    def _pair(self, part: int, other: int) -> Float[np.ndarray, "contact 3"]:
        key = (min(part, other), max(part, other))
        if key not in self._pairs:
            self._pairs[key] = self._measure(*key)
        return self._pairs[key] if part == key[0] else -self._pairs[key]

    def _measure(self, a: int, b: int, offset: Float[np.ndarray, "3"] | None = None) -> Float[np.ndarray, "contact 3"]:
        """Normals that relieve a: samples of a near b give -normal of a, samples of b near a give +normal of b."""
        parts = self._parts
        near = self._gap * parts.smaller_size(a, b)
        if offset is None and not parts.boxes_meet(a, b, near):
            return np.zeros((0, 3))
        T_shifted = parts.poses[a] if offset is None else se3.make(None, offset) @ parts.poses[a]
        found = [np.zeros((0, 3))]
        for first, second, sign in ((a, b, -1.0), (b, a, 1.0)):
            body, tree = parts.bodies[first], parts.bodies[second]
            T_first, T_second = (T_shifted if k == a else parts.poses[k] for k in (first, second))
            T = se3.inverse(T_second) @ T_first
            points = se3.apply(T, body.samples)
            inside = ((points > tree.bounds[0] - near) & (points < tree.bounds[1] + near)).all(axis=1)
            if not inside.any():
                continue
            distance = tree.signed_distance.query(points[inside])
            touching = np.flatnonzero(inside)[np.abs(distance) < near]
            # a sample that touches only across an edge looks the wrong way: ask a little further along its normal
            normals = body.sample_normals[touching]
            ahead = se3.apply(T, body.samples[touching] + 2.0 * near * normals)
            facing = tree.signed_distance.query(ahead) < 0.0 if len(ahead) else np.zeros(0, bool)
            found.append(sign * normals[facing] @ T_first[:3, :3].T)
        every = np.concatenate(found)
        _, first_of_each = np.unique(np.round(every, 4), axis=0, return_index=True)
        return every[first_of_each]


def escape_directions(
    margins: Mapping[int, Float[np.ndarray, "sample"]], *, samples: int, most: int = 6, least: float = -0.02
) -> tuple[Float[np.ndarray, "direction 3"], float]:
    """Return the directions that move away from the contacts most clearly, and the best one's margin.

    The margin of a direction is its smallest ``g · d``: positive moves away from every contact, zero
    slides along one, negative runs into one. They are given by the part behind the contacts. None is returned with
    less than the ``least`` margin.
    """
    directions = sphere_directions(samples)
    if not margins:
        return directions[:0], 1.0
    worst = np.min(list(margins.values()), axis=0)
    best = float(worst.max())
    chosen: list[np.ndarray] = []
    left = np.argsort(-worst, kind="stable")
    left = left[worst[left] >= least]
    while len(left) and len(chosen) < most:
        chosen.append(directions[left[0]])
        left = left[directions[left] @ chosen[-1] < np.cos(np.radians(15.0))]
    return np.array(chosen).reshape(-1, 3), best


def immobile_margin(margins: Mapping[int, Float[np.ndarray, "sample"]], *, margin: float) -> Sequence[int]:
    """Return a set of parts whose contacts alone hold the part, to first order: none can be left out."""
    needed = sorted(margins)
    for part in sorted(margins):
        rest = [k for k in needed if k != part]
        if rest and np.min([margins[k] for k in rest], axis=0).max() < -margin:
            needed = rest
    return needed

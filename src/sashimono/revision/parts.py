"""Which part of one revision is which of the other, and what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Part
from sashimono.geometry import se3
from sashimono.geometry.mesh import measures
from sashimono.geometry.mesh.shapes import rigid_motion
from sashimono.revision.sources import Side

MOVED = 1e-4
"""A part has moved if a point of it has by more than this, over the part's radius."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PartChange:
    """What became of one part."""

    old: str | None
    """Name before; None for a part that was added."""
    new: str | None
    """Name after; None for a part that was removed."""
    reshaped: bool = False
    """Whether its shape changed."""
    shift: float = 0.0
    """How far the point of it that moved farthest has moved [m]; 0 if it has not."""
    displacement: Float[np.ndarray, "4 4"] | None = None
    """World motion that carries it from where it was to where it is; None where that is not known."""
    volumes: tuple[float, float] | None = None
    """Before and after [m³], if its shape changed."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """What happened to it: added, removed, or any of renamed, moved, changed; empty if nothing did."""
        if self.old is None or self.new is None:
            return ("added",) if self.old is None else ("removed",)
        said = (("renamed", self.old != self.new), ("moved", self.shift > 0.0), ("changed", self.reshaped))
        return tuple(kind for kind, holds in said if holds)


def match_parts(old: Side, new: Side) -> tuple[PartChange, ...]:
    """Return what became of every part: those of the old side in their order, then those that were added.

    Parts belong together by name; of the rest, by shape, the nearest first. Where a side has no geometry, names and
    poses are all that is compared.
    """
    pairs = {name: name for name in old.names if name in set(new.names)}
    pairs |= _renamed(old, new, pairs)
    changes = [_change(old, new, name, pairs.get(name)) for name in old.names]
    taken = set(pairs.values())
    return (*changes, *(PartChange(old=None, new=name) for name in new.names if name not in taken))


def _renamed(old: Side, new: Side, known: dict[str, str]) -> dict[str, str]:
    """Pairs of parts that have other names but one shape."""
    if old.assembly is None or new.assembly is None:
        return {}
    left = [part for part in new.assembly.parts if part.name not in set(known.values())]
    found = {}
    for part in old.assembly.parts:
        if part.name in known:
            continue
        alike = [(other, T) for other in left if (T := rigid_motion(_mesh(part), _mesh(other))) is not None]
        if alike:
            other = min(alike, key=lambda each: (_shift(part, each[1]), each[0].name))[0]
            found[part.name] = other.name
            left.remove(other)
    return found


def _mesh(part: Part) -> tuple[np.ndarray, np.ndarray]:
    return part.vertices_world, part.faces


def _shift(part: Part, T: Float[np.ndarray, "4 4"]) -> float:
    return float(np.linalg.norm(se3.apply(T, part.vertices_world) - part.vertices_world, axis=1).max())


def _change(old: Side, new: Side, name: str, other: str | None) -> PartChange:
    if other is None:
        return PartChange(old=name, new=None)
    if old.assembly is None or new.assembly is None:
        before, after = _pose(old, name), _pose(new, other)
        T = after @ se3.inverse(before)
        return PartChange(old=name, new=other, shift=0.0 if np.allclose(T, np.eye(4), atol=1e-9) else _far(T, before))
    first, second = old.assembly.part(name), new.assembly.part(other)
    radius = measures.radius(first.vertices_world, first.vertices_world.mean(axis=0))
    T = rigid_motion(_mesh(first), _mesh(second))
    if T is not None:
        shift = _shift(first, T)
        return PartChange(old=name, new=other, shift=shift if shift > MOVED * radius else 0.0, displacement=T)
    volumes = tuple(measures.volume(part.vertices_world, part.faces) for part in (first, second))
    T = second.T_world_part @ se3.inverse(first.T_world_part)
    shift = _shift(first, T)
    return PartChange(
        old=name, new=other, reshaped=True, shift=shift if shift > MOVED * radius else 0.0, displacement=T,
        volumes=(volumes[0], volumes[1]),
    )  # fmt: skip


def _pose(side: Side, name: str) -> Float[np.ndarray, "4 4"]:
    if side.assembly is not None:
        return side.assembly.part(name).T_world_part
    assert side.plan is not None
    return side.plan.parts[name]


def _far(T: Float[np.ndarray, "4 4"], pose: Float[np.ndarray, "4 4"]) -> float:
    """How far the origin of the part's frame moves."""
    return float(np.linalg.norm((T @ pose)[:3, 3] - pose[:3, 3]))


def common_displacement(changes: Sequence[PartChange]) -> Float[np.ndarray, "4 4"]:
    """Return the motion that most parts share, as the whole product may have been drawn elsewhere; else none."""
    known = [change.displacement for change in changes if change.displacement is not None and not change.reshaped]
    if not known:
        return np.eye(4)
    votes = [sum(np.allclose(T, other, atol=1e-6) for other in known) for T in known]
    best = int(np.argmax(votes))
    still = sum(np.allclose(T, np.eye(4), atol=1e-6) for T in known)
    return known[best] if votes[best] > max(still, len(known) // 2) else np.eye(4)

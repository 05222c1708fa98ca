"""Checks after reading: closed parts, plausible size, overlap in the assembled pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold

from sashimono.assembly import Overlap, Part, StandIn, size_words
from sashimono.errors import InputError
from sashimono.geometry.mesh.solid import to_manifold
from sashimono.io.mending.folds import count_folded, without_flat_folds
from sashimono.io.mending.mend import Surface, close_surface
from sashimono.io.mending.stand_in import ClosedBody, stand_in
from sashimono.io.raw import METRES, RawPart, ReadConfig


@dataclass(frozen=True, kw_only=True, eq=False)
class BrokenPart:
    """A part whose surface cannot be closed."""

    raw: RawPart
    problem: str


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedParts:
    """What came of closing the surfaces of all parts."""

    parts: tuple[Part, ...]
    """Those that are closed, outward surfaces."""
    mended: Mapping[str, tuple[str, ...]]
    """What was changed, by name of the part."""
    folded: Mapping[str, int]
    """How many triangles at least lie back to back with a neighbour, by name of the part."""
    broken: tuple[BrokenPart, ...]
    """Those that cannot be closed."""
    stand_ins: tuple[StandIn, ...] = ()
    """What is in the place of those that cannot be closed, where that is wanted and there is such a body."""

    @property
    def notes(self) -> list[str]:
        """One line for each part that was mended, and one for each that is folded."""
        lines = [entry.words for entry in self.stand_ins]
        for part in self.parts:
            if part.name in self.mended:
                lines.append(f"{part.name}: {', '.join(self.mended[part.name])}")
            if (count := self.folded.get(part.name, 0)) > 0:
                lines.append(
                    f"{part.name}: folded onto itself at {count} triangles or more; depths near them are unsure"
                )
        return lines

    def refuse_broken(self, source: str, *, repair: bool) -> None:
        """Raise one InputError that names every part that cannot be closed, if there is any."""
        if self.broken:
            raise InputError(_refusal([(each.raw, each.problem) for each in self.broken], source, repair))


def folded_words(count: int) -> str:
    """Return what it means that so many triangles of a part lie back to back."""
    return f"folded onto itself at {count} triangles or more; depths near them are unsure"


def close_parts(raw: Sequence[RawPart], *, repair: bool, config: ReadConfig) -> ClosedParts:
    """Return the parts with closed, outward surfaces, what was mended, and those that cannot be closed."""
    done: dict[int, Surface | str] = {}
    parts: list[Part] = []
    mended: dict[str, tuple[str, ...]] = {}
    folds: dict[str, int] = {}
    broken: list[BrokenPart] = []
    bodies: dict[tuple[int | None, int], ClosedBody | None] = {}
    stand_ins: list[StandIn] = []
    for part in raw:
        result = done.get(part.shape) if part.shape is not None else None
        if result is None:
            result = close_surface(part.vertices, part.faces, repair=repair, config=config)
            if repair and isinstance(result, Surface):
                result = _unfolded(result, config)
            if part.shape is not None:
                done[part.shape] = result
        if isinstance(result, str) and config.stand_ins:
            if (key := (part.shape, id(part) if part.shape is None else 0)) not in bodies:
                bodies[key] = stand_in(part.vertices, part.faces, config=config)
            if (body := bodies[key]) is not None:
                stand_ins.append(StandIn(part=part.name, problem=result, how=body.how, off=body.off))
                result = body.surface
        if isinstance(result, str):
            broken.append(BrokenPart(raw=part, problem=result))
            continue
        parts.append(Part(
            name=part.name, vertices_part=result.vertices, faces=result.faces, T_world_part=part.T_world_part,
            color=part.color,
        ))  # fmt: skip
        if result.mended:
            mended[part.name] = result.mended
        if (folded := count_folded(result.vertices, result.faces, config=config)) > 0:
            folds[part.name] = folded
    return ClosedParts(
        parts=tuple(parts), mended=mended, folded=folds, broken=tuple(broken), stand_ins=tuple(stand_ins)
    )


def _unfolded(surface: Surface, config: ReadConfig) -> Surface:
    """The surface with what is folded in flat faces drawn anew."""
    faces = without_flat_folds(surface.vertices, surface.faces, config=config)
    if faces is surface.faces:
        return surface
    note = "flat faces whose triangles lay on one another drawn anew"
    used, inverse = np.unique(faces.reshape(-1), return_inverse=True)
    vertices = surface.vertices[used]
    return replace(surface, vertices=vertices, faces=inverse.reshape(-1, 3), mended=(*surface.mended, note))


def _refusal(broken: list[tuple[RawPart, str]], source: str, repair: bool) -> str:
    way_out = "separation needs a closed surface. Close it in the CAD program or a mesh tool"
    way_out += "" if repair else ", or allow mending"
    if len(broken) == 1:
        part, problem = broken[0]
        where = part.where if part.where != source else f"{source}: {part.name}"
        return f"{where}: {problem}; {way_out}"
    listed = ", ".join(f"{part.name} ({problem})" for part, problem in broken)
    return f"{source}: {len(broken)} parts are not closed: {listed}; {way_out}"


def size_note(parts: list[Part], unit: str, config: ReadConfig, *, stated: bool) -> list[str]:
    """Return a note if the assembly's diagonal is implausible, naming units that would be plausible.

    ``stated`` says whether the file names its unit.
    """
    low = np.min([p.bounds_world[0] for p in parts], axis=0)
    high = np.max([p.bounds_world[1] for p in parts], axis=0)
    if is_likely(float(np.linalg.norm(high - low)), config, stated=stated):
        return []
    others = [
        f"{size_words(np.array([low, high]) * METRES[other] / METRES[unit])} in {other}"
        for other in likely_units((high - low) / METRES[unit], config)
    ]
    way_out = "" if stated else "; give --unit"
    hint = f" (it would be {' or '.join(others)}{way_out})" if others else ""
    return [f"the whole assembly measures {size_words(np.array([low, high]))}: check the unit, {unit!r} was used{hint}"]


def is_likely(diagonal: float, config: ReadConfig, *, stated: bool) -> bool:
    """Return whether a product may have this diagonal [m]."""
    smallest, largest = config.plausible if stated else config.likely
    return bool(smallest <= diagonal <= largest)


def likely_units(edges: Float[np.ndarray, "3"], config: ReadConfig) -> tuple[str, ...]:
    """Return the common units in which edges of this length, as the file has them, make a likely product."""
    return tuple(
        unit
        for unit in ("mm", "m", "in", "cm")
        if is_likely(float(np.linalg.norm(edges)) * METRES[unit], config, stated=False)
    )


def find_overlaps(parts: list[Part], config: ReadConfig) -> tuple[Overlap, ...]:
    """Return the pairs of parts that share volume in the assembled pose, worst first."""
    boxes = np.array([part.bounds_world for part in parts]).reshape(-1, 2, 3)
    low, high = boxes[:, 0], boxes[:, 1]
    meet = ((low[:, None] < high[None]) & (high[:, None] > low[None])).all(axis=2)
    solids: dict[int, Manifold] = {}
    found: list[Overlap] = []
    for i, j in np.argwhere(np.triu(meet, 1)).tolist():
        for k in (i, j):
            if k not in solids:
                solids[k] = to_manifold(parts[k].vertices_world, parts[k].faces)
        volume = max((solids[i] ^ solids[j]).volume(), 0.0)
        fraction = volume / min(solids[i].volume(), solids[j].volume())
        if fraction > config.overlap:
            found.append(Overlap(first=parts[i].name, second=parts[j].name, volume=volume, fraction=fraction))
    return tuple(sorted(found, key=lambda o: (-o.fraction, o.first, o.second)))

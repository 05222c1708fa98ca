"""By which signed inertia axes each part goes in, whatever is placed: level 1's blocking relation, as a small table.

The axis of an action is the direction of a push, as in Algorithm 1 of the paper: contacts lead the part on from there.
So an axis stands for each free straight way that is nearer to it than to the part's other five. With friction 0.2 a
push moves the part along any way within 78 degrees of it; the nearest of six axes is never farther than 55.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.d4pas.journal import Journal
from sashimono.d4pas.states import Masks, right_next
from sashimono.disassembly.blocking.relation import Blocking, BlockingConfig
from sashimono.disassembly.conditions.clauses import minimal
from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.learning.cloud_cache import CloudCache, Dataset

VERSION = 1
"""Raised whenever the same assembly would give another table."""

AXES = 6
"""Signed axes of a part: +first, -first, +second, -second, +third, -third, by ascending moment of inertia."""

TIE = 1e-3
"""Axes whose cosines with a way differ by less are equally near."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ways:
    """The straight ways in of one blueprint's parts, by axis."""

    axes: Float[np.ndarray, "part 6 3"]
    """Unit vectors along which the part moves as it goes in, in the blueprint's frame."""
    blockers: tuple[tuple[tuple[int, ...], ...], ...]
    """By part and axis, the sets of parts (masks) that stop the ways nearest to the axis: the minimal ones."""

    def open(self, part: int, placed: int) -> tuple[int, ...]:
        """Return the axes along which a part goes in past the placed ones (a mask) in a straight line."""
        return tuple(axis for axis, masks in enumerate(self.blockers[part]) if any(not mask & placed for mask in masks))

    def allows(self, part: int, axis: int, placed: int) -> bool:
        """Return whether an axis is right for a part that can go in.

        Where the part goes in, but not in a straight line (it is turned in, or takes several legs), the axis is not
        asked for: any is right.
        """
        here = self.open(part, placed)
        return not here or axis in here


def is_right_step(masks: Masks, ways: Ways, placed: int, part: int, axis: int) -> bool:
    """Return whether a part put in along an axis is a right step: some complete sequence goes on with the part, and
    the axis is open (`Ways.allows`)."""
    is_next = not placed >> part & 1 and bool(right_next(masks, placed) >> part & 1)
    return is_next and ways.allows(part, axis, placed)


def find_ways(assembly: Assembly) -> Ways:
    """Return the ways in of an assembly's parts, past the directions of level 1's blocking relation."""
    bodies = make_bodies(assembly)
    blocking = Blocking(PlacedParts(assembly, bodies, config=PlacedPartsConfig()), config=BlockingConfig())
    axes = np.stack([_signed_axes(part.T_world_part, bodies[part.name]) for part in assembly.parts])
    blockers = []
    for part in range(len(blocking)):
        found: list[list[int]] = [[] for _ in range(AXES)]
        for direction_index in _easiest_first(blocking, part):
            cosines = axes[part] @ -blocking.direction(direction_index)  # it goes in against the way it leaves
            near = [axis for axis in range(AXES) if cosines[axis] > cosines.max() - TIE]
            mask = _blockers(blocking, part, direction_index, [found[axis] for axis in near])
            for axis in near:
                if mask is not None:
                    found[axis] = minimal([*found[axis], mask])
        blockers.append(tuple(tuple(masks) for masks in found))
    return Ways(axes=axes, blockers=tuple(blockers))


def add_ways(
    cache: CloudCache, data: Dataset, rows: Sequence[int] | np.ndarray, *, workers: int = 1
) -> dict[int, Ways]:
    """Return the ways of these blueprints of the cache; those not found before are found now, and kept beside it.

    A run that is killed goes on. The dataset is the one that the cache was made from.
    """
    wanted = list(dict.fromkeys(int(row) for row in rows))
    journal = Journal(_file(cache.folder), {"ways": VERSION})
    try:
        todo = [row for row in wanted if cache.ids[row] not in journal.done]
        with _mapped(_entry, [data.blueprints[row] for row in todo], workers) as entries:
            for done, (row, entry) in enumerate(zip(todo, entries, strict=True), start=1):
                journal.add(cache.ids[row], entry)
                if done % 500 == 0:
                    log.info("ways of %d of %d blueprints", done, len(todo))
    finally:
        journal.close()
    return {row: _read(journal.done[cache.ids[row]]) for row in wanted}


def share_without_axis(masks: Masks, ways: Ways, placed: Sequence[int] | np.ndarray) -> tuple[int, int]:
    """Return of how many right steps in these states no axis is open, and how many right steps there are."""
    steps = [(part, int(state)) for state in placed for part in bits(right_next(masks, int(state)))]
    return sum(not ways.open(part, state) for part, state in steps), len(steps)


def _easiest_first(blocking: Blocking, part: int) -> list[int]:
    """Direction indices, those first that the coarse maps say fewest parts stop."""
    masks = [blocking.masks(part, direction_index) for direction_index in range(blocking.count_directions)]
    return sorted(range(len(masks)), key=lambda s: ((masks[s][0] | masks[s][1]).bit_count(), s))


def _blockers(blocking: Blocking, part: int, direction_index: int, known: Sequence[Sequence[int]]) -> int | None:
    """What stops a part along a direction; None as soon as each of the known lists has something better."""
    blocked, unclear = blocking.masks(part, direction_index)

    def is_vain() -> bool:
        return all(any(mask & blocked == mask for mask in masks) for masks in known)

    for other in bits(blocking.parts.all_parts & ~(1 << part) & ~blocked):
        if is_vain():
            return None
        stopped = bool(unclear >> other & 1) and blocking.is_blocked_by(part, direction_index, other)
        if stopped or not blocking.passes(part, direction_index, other):
            blocked |= 1 << other
    return None if is_vain() else blocked


def _signed_axes(T_world_part: Float[np.ndarray, "4 4"], body: Any) -> Float[np.ndarray, "6 3"]:
    lines = (T_world_part[:3, :3] @ body.mass_properties.axes).T
    return np.stack([sign * line for line in lines for sign in (1.0, -1.0)])


def _file(folder: Path) -> Path:
    return folder / f"ways-{VERSION}.jsonl"


def _entry(blueprint: Any) -> dict[str, Any]:
    found = find_ways(blueprint.assembly())
    return {"axes": found.axes[:, ::2].round(6).tolist(), "blockers": found.blockers}


def _read(entry: dict[str, Any]) -> Ways:
    lines = np.array(entry["axes"])
    axes = np.stack([lines, -lines], axis=2).reshape(len(lines), AXES, 3)
    blockers = tuple(tuple(tuple(masks) for masks in part) for part in entry["blockers"])
    return Ways(axes=axes, blockers=blockers)


@contextmanager
def _mapped(
    function: Callable[[Any], dict[str, Any]], items: Sequence[Any], workers: int
) -> Iterator[Iterator[dict[str, Any]]]:
    if workers <= 1 or len(items) < 2:
        yield map(function, items)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield pool.map(function, items, chunksize=4)

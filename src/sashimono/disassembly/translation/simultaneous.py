"""Several groups that leave at once, each by a straight translation of its own, where none of them leaves alone.

Two halves that slide apart sideways while a third part holds both are of this kind; of m groups, the one that stays
counted, one speaks of m-handed assembly (Natarajan 1988, *On planning assemblies*; Wilson and Latombe 1994).

The velocities come from linear programs over the contact directions: two parts that touch with normal g may not
approach, ``g · (v_i - v_j) >= 0``; one part stays, one coordinate of another one is 1, and the velocities are as small
as possible, so that few parts move. What is found to first order is traced as far as it goes, pair by pair along the
straight relative motion. A pair that runs into each other adds the contact in which it stops, and the program is solved
again. An answer is exact, as that of every other stage; no answer is no proof.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.masks import bits, pieces
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.translation.contact_normals import ContactNormals


@dataclass(frozen=True, kw_only=True)
class SimultaneousConfig:
    """Budgets of the search; they count work, never time."""

    max_parts: int = 40
    """Of more remaining parts nothing is asked."""
    max_programs: int = 300
    """Linear programs solved."""
    max_groups: int = 5
    """Most groups that move at once."""
    rest: float = 1e-6
    """A part slower than this, beside the fastest one, stays; velocities that differ by less are the same."""
    clearance: float = 0.05
    """How far past each other two groups end, over the smallest extent of their smallest part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimultaneousGroup:
    """One of the groups that leave at once."""

    members: int
    """Mask of its parts, which move as one."""
    removal: Removal
    """Its own translation. All groups start together, move at constant speed and arrive together."""


def find_simultaneous(
    parts: PlacedParts,
    touching: ContactNormals,
    remaining: int,
    *,
    stays: int,
    config: SimultaneousConfig,
    allowed: Callable[[Collection[int]], bool] = lambda groups: True,
) -> tuple[SimultaneousGroup, ...]:
    """Return groups that leave the other remaining parts at once, in order of their first parts; none if none is found.

    Those with the fewest groups, then the fewest parts, come first. A single group may be among the answers: it moves
    along a direction that was not looked at before.

    Args:
        parts: The placed parts.
        touching: The contact normals of pairs.
        remaining: Mask of the parts that are there.
        stays: A part that does not move.
        config: Budgets.
        allowed: Of the masks of some groups, whether they may leave like that.
    """
    if remaining.bit_count() > config.max_parts or remaining.bit_count() < 3:
        return ()
    program = _Program(parts, touching, bits(remaining), stays, config)
    # the scale is fixed in each of these ways; those whose motion is stopped are asked again with what stopped it
    scales = list(product(program.movers, range(3), (1.0, -1.0)))
    tried: set[bytes] = set()
    while scales:
        asked = scales[: config.max_programs - program.solved]
        solved = [(scale, velocities) for scale in asked if (velocities := program.solve(*scale)) is not None]
        scales = [scale for scale, _ in solved]
        found = []
        for _, velocities in solved:
            groups = _groups(velocities, remaining, touching, config)
            key = np.round(velocities / np.abs(velocities).max(), 6).tobytes()
            if len(groups) <= config.max_groups and key not in tried:
                tried.add(key)
                moved = sum(mask.bit_count() for mask in groups)
                found.append(((len(groups), moved, len(found)), groups, velocities))
        is_cut = False
        for _, groups, velocities in sorted(found, key=lambda entry: entry[0]):
            if not allowed(groups):
                continue
            stopped = program.stopped(velocities)
            if not stopped:
                return _leave(parts, velocities, groups, remaining, config)
            is_cut = True
            for first, second, normals in stopped:
                program.forbid(first, second, normals)
        if not is_cut:
            break
    return ()


def _groups(
    velocities: Float[np.ndarray, "part 3"], remaining: int, touching: ContactNormals, config: SimultaneousConfig
) -> list[int]:
    """The masks of the parts that move as one: of the same velocity, and touching one another."""
    least = config.rest * np.abs(velocities).max()
    moving = [k for k in bits(remaining) if np.abs(velocities[k]).max() > least]

    def alike(part: int) -> int:
        same = (k for k in moving if k != part and np.abs(velocities[k] - velocities[part]).max() <= least)
        return sum(1 << k for k in same if touching.touch(part, k))

    return pieces(sum(1 << k for k in moving), alike)


def _relative_motions(
    velocities: Float[np.ndarray, "part 3"], pairs: Iterable[tuple[int, int]], config: SimultaneousConfig
) -> Iterator[tuple[int, int, Float[np.ndarray, "3"], float]]:
    """Yield the pairs that move relative to each other, each with the direction of the first one and the speed."""
    least = config.rest * np.abs(velocities).max()
    for a, b in pairs:
        relative = velocities[a] - velocities[b]
        speed = float(np.linalg.norm(relative))
        if speed > least:
            yield a, b, relative / speed, speed


def _leave(
    parts: PlacedParts,
    velocities: Float[np.ndarray, "part 3"],
    groups: Collection[int],
    remaining: int,
    config: SimultaneousConfig,
) -> tuple[SimultaneousGroup, ...]:
    """The groups with translations that last until all are past one another, seen along each pair's relative motion."""
    time = 0.0
    for a, b, direction, speed in _relative_motions(velocities, combinations(bits(remaining), 2), config):
        past = parts.way_past(a, b, direction) + config.clearance * parts.smaller_size(a, b)
        time = max(time, past / speed)
    out = []
    for members in groups:
        velocity = velocities[bits(members)[0]]
        speed = float(np.linalg.norm(velocity))
        out.append(SimultaneousGroup(members=members, removal=Removal.straight(velocity, time * speed)))
    return tuple(out)


class _Program:
    """The linear programs of one set of remaining parts, and what tracing added to them."""

    def __init__(
        self, parts: PlacedParts, touching: ContactNormals, remaining: list[int], stays: int, config: SimultaneousConfig
    ) -> None:
        self._parts, self._touching, self._config = parts, touching, config
        self.movers = [part for part in remaining if part != stays]
        self._place = {part: k for k, part in enumerate(self.movers)}
        self._remaining = remaining
        self._rows: list[np.ndarray] = []
        self.solved = 0
        """Programs solved so far."""
        for a, b in combinations(remaining, 2):
            self.forbid(a, b, touching.normals(a, b))

    def forbid(self, first: int, second: int, normals: Float[np.ndarray, "contact 3"]) -> None:
        """Let two parts not approach along these normals, which relieve the first."""
        rows = np.zeros((len(normals), len(self.movers), 3))
        for part, sign in ((first, -1.0), (second, 1.0)):
            if part in self._place:
                rows[:, self._place[part]] = sign * normals
        self._rows.append(rows.reshape(len(normals), 3 * len(self.movers)))

    def solve(self, part: int, axis: int, sign: float) -> Float[np.ndarray, "part 3"] | None:
        """Return velocities of all parts of the assembly, the least with this coordinate at ±1; None if there are none.

        The sum over the parts of each one's greatest coordinate is least.
        """
        self.solved += 1
        count = len(self.movers)
        size = 3 * count
        contacts = np.concatenate(self._rows)
        owner = np.repeat(np.eye(count), 3, axis=0)
        above = np.block(
            [
                [contacts, np.zeros((len(contacts), count))],
                [np.eye(size), -owner],
                [-np.eye(size), -owner],
            ]
        )
        fixed = np.zeros((1, size + count))
        fixed[0, 3 * self._place[part] + axis] = 1.0
        found = linprog(
            np.concatenate([np.zeros(size), np.ones(count)]),
            A_ub=above,
            b_ub=np.zeros(len(above)),
            A_eq=fixed,
            b_eq=[sign],
            bounds=[(-_FASTEST, _FASTEST)] * size + [(0.0, _FASTEST)] * count,
            method="highs",
        )
        if found.status != 0:
            return None
        velocities = np.zeros((len(self._parts), 3))
        velocities[self.movers] = found.x[:size].reshape(-1, 3)
        return velocities

    def stopped(self, velocities: Float[np.ndarray, "part 3"]) -> list[tuple[int, int, Float[np.ndarray, "contact 3"]]]:
        """Return the pairs that run into each other, each with normals that do not let it; none if all pass."""
        out = []
        # both ways: an overlap as assembled excuses by where it lies on the one that is looked at as fixed
        pairs = permutations(self._remaining, 2)
        for a, b, direction, _ in _relative_motions(velocities, pairs, self._config):
            travel = free_travel(self._parts, a, np.zeros(3), direction, b)
            if np.isfinite(travel):
                normals = self._touching.normals(a, b, offset=travel * direction)
                against = normals[normals @ direction < -_HEAD_ON]
                out.append((a, b, against if len(against) else -direction[None]))
        return out


_FASTEST = 50.0
"""Fastest coordinate, over the one that is 1."""
_HEAD_ON = 0.05
"""Least cosine between a motion and a contact that stops it."""

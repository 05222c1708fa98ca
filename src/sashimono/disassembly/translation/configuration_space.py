"""Configuration space of one part under translations, on a lattice, and the proof that there is no way out.

A path of displacements passes lattice displacements at most (√3/2) h away, neighbours among the 26.
Shrink the part by a and an obstacle by b, a + b >= (√3/2) h + 2 δ: where the shrunk ones share a point
at a lattice displacement, the real ones share a ball of radius δ at every displacement that rounds to
it. So if the 26-connected flood from the assembled pose does not reach the rim, every way out by
translations goes deeper than δ into some obstacle, and δ is more than the pair's allowance plus the
tolerance of a plan. Leaving out obstacles, or points of the part, keeps this true.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.translation.drawing import Drawing, KeptSolids
from sashimono.disassembly.translation.lattice_flood import (
    LatticeScene,
    cast,
    explore,
    label,
    label_all,
    met_on_every_way,
    nearest_steps,
    steps_back,
    steps_from,
    straightened,
)
from sashimono.disassembly.translation.lattice_scene import LatticeSceneBuilder

MOST_OBSTACLES = 62
"""Obstacles that a lattice can tell apart (bits of a word); the nearest are taken."""


NESTED = 3
"""Cells along one cell of a lattice's parent; odd, so that they fill it."""


@dataclass(frozen=True, kw_only=True)
class SpaceConfig:
    """Size of the lattices."""

    resolutions: tuple[float, ...] = (2.5, 5.0, 10.0)
    """Lattice cells to the part's smallest extent: coarse first, the next where that one leaks."""
    proof_resolutions: tuple[float, ...] = (5.0, 15.0, 45.0, 135.0)
    """The same for lattices that only prove, where all of the above leak: thin walls, small screws in large parts. Each
    `NESTED` times as fine as the one before, which is its parent."""
    proof_window: int = 6
    """Steps around the assembled pose with which a proof begins; it grows where the flood reaches the rim."""
    proof_walls: float = 4.0
    """Thin walls so many times as thick count as the part's smallest extent there."""
    proof_growth: int = 9
    """How much it grows at once on that side."""
    max_proof_spaces: int = 24
    """Lattices that only prove, kept for the part at hand."""
    max_proof_work: int = 20_000_000
    """Lattice points of all lattices looked at for one proof."""
    max_cells: int = 1_500_000
    """Most lattice points around the part; the window of displacements is cut to fit."""
    max_proof_cells: int = 4_000_000
    """The same for a lattice that only proves."""
    max_kept: int = 32_000_000
    """Lattice points in sum of the solids that are kept for other lattices of the part at hand."""
    max_points: int = 1000
    """Most lattice points that stand for one pair of parts; of more, evenly many are taken."""
    max_visited: int = 200_000
    """Most displacements visited by one flood."""
    max_proof_visited: int = 100_000
    """The same on a lattice that only proves."""
    max_swap_cells: int = 500_000
    """Most displacements of a lattice on which a proof is asked for others like it."""
    max_swap_visited: int = 10_000
    """Most of them visited for each obstacle that is put off, one that is visited again counted again."""
    max_lead: int = 2000
    """Most visited displacements that are kept to lead the search."""
    room_resolution: float = 5.0
    """Lattice cells to the part's smallest extent for the lattice that shows where there is room."""
    max_room_points: int = 4000
    """Most lattice points that stand for one pair of parts on it."""
    max_room_visited: int = 20_000
    """Most displacements visited on it by one look for a way out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Flood:
    """What a flood found."""

    blocked: bool
    """Whether there is provably no way out."""
    proof: tuple[int, ...] = ()
    """A few obstacles that already prove it."""
    cells: Int[np.ndarray, "cell 3"] = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    """Displacements visited, on the lattice."""
    steps: Int[np.ndarray, "cell"] = field(default_factory=lambda: np.zeros(0, np.int32))
    """Steps from each to the way out that was found."""
    rim: tuple[int, int] | None = None
    """Where it came out: side (0 down, 1 up) and axis."""


class Space:
    """The displacements of one part among the parts around it, on one lattice."""

    def __init__(
        self,
        parts: PlacedParts,
        part: int,
        resolution: float,
        *,
        config: SpaceConfig,
        window: Int[np.ndarray, "2 3"] | None = None,
        parent: Space | None = None,
        grown: bool = False,
        kept: KeptSolids | None = None,
    ) -> None:
        """Draw the lattice. A window of displacements, in steps down and up, is cut to the way out only; without one
        the lattice is as wide as fits. What a parent, `NESTED` times as coarse, has as blocked is blocked here too.
        ``grown``: a lattice that shows where there is room, and proves nothing. ``kept``: what other lattices of the
        part have drawn.
        """
        self.config = config
        self.rotation = parts.frame(part)
        boxes = parts.boxes_in(self.rotation)
        low, high = boxes[part]
        others = [k for k in range(len(parts)) if k != part]
        gaps = np.maximum(boxes[others, 0] - high, low - boxes[others, 1]).max(axis=1)
        self.obstacles = [others[k] for k in np.argsort(np.round(gaps, 9), kind="stable")[:MOST_OBSTACLES]]
        """The obstacles, by bit."""
        outer = boxes[self.obstacles]
        # where the inertia axes are not determined, the box along the faces may be the smaller one
        extent = min(float(parts.sizes[part]), float((high - low).min()))
        if window is not None:
            extent = min(extent, config.proof_walls * float(parts.bodies[part].wall))
        self.spacing = h = extent / resolution
        count = np.floor((high - low) / h).astype(int) + 1
        room = np.stack([high - outer[:, 0].min(axis=0), outer[:, 1].max(axis=0) - low])
        self.full = np.maximum(np.ceil(room / h).astype(int) + 1, 2)
        """Lattice steps down and up at which the part's box is past all others', (2, 3)."""
        most = config.max_cells if window is None else config.max_proof_cells
        self.window = _fit(self.full, count, most) if window is None else np.minimum(window, self.full)
        """Lattice steps that the displacements reach down and up, (2, 3)."""
        self.is_cut = bool((self.window < self.full).any())
        """Whether the rim of the lattice is not the way out yet."""
        shape = self.window.sum(axis=0) + 1
        size = shape if window is not None else shape + count - 1
        fits = np.prod(size, dtype=float) <= most
        self._labels = np.zeros(tuple(shape.tolist()) if fits else (0, 0, 0), np.int64)
        self._known = np.zeros(self._labels.shape, np.int64)
        self._parent = parent
        kept = kept or KeptSolids(most=config.max_kept)
        self._drawing = Drawing(parts, part, self.rotation, spacing=h, window=self.window, kept=kept, grown=grown)
        self._most = most
        self._grown = grown
        self._drawn = 0
        self._bits: dict[int, int] = {}
        self._inside = 0
        self._builder = LatticeSceneBuilder(
            shape, len(self.obstacles), max_points=config.max_room_points if grown else config.max_points
        )
        self._scene: LatticeScene | None = None

    def work(self, others: int) -> int:
        """Return how many lattice points stand for these obstacles (a mask of parts) and the part, those of a lattice
        on which none do included."""
        return self._labels.size + sum(self._cells(bit) for bit in bits(self._bits_of(others)))

    def within_reach(self, others: int) -> int:
        """Return those of the obstacles (a mask of parts) that the part can meet on this lattice."""
        return sum(1 << self.obstacles[bit] for bit in bits(self._bits_of(others)) if self._cells(bit))

    def _cells(self, bit: int) -> int:
        """Lattice points of a pair, 0 where they are too many to be drawn."""
        cells = self._drawing.cells[self.obstacles[bit]]
        return cells if cells <= self._most else 0

    def _draw(self, wanted: int) -> None:
        """Draw the obstacles (bits) that are not drawn yet; those too large for this lattice are never met."""
        missing = wanted & ~self._drawn
        if not missing or not self._labels.size:
            return
        self._drawn |= missing
        for bit in bits(missing):
            if self._cells(bit):
                self._builder.put(bit, *self._drawing.draw(self.obstacles[bit]))
        self._scene = self._builder.finished()
        if self._parent is not None:
            self._labels |= self._parent.labels_around(self.window, missing)
        start = tuple(int(n) for n in self.window[0])
        if self._scene is not None and not self._grown:
            self._inside = label(self._scene, start, self._labels, self._known)

    def labels_around(self, window: Int[np.ndarray, "2 3"], wanted: int) -> Int[np.ndarray, "x y z"] | int:
        """Return the labels of obstacles (bits) for a lattice `NESTED` times as fine, around the assembled pose.

        Each cell of the finer one is within one of this lattice.
        """
        self._draw(wanted)
        if self._scene is None:
            return 0
        label_all(self._scene, self._labels, self._known)
        wanted &= ~self._inside
        steps = [(np.arange(-low, high + 1) + NESTED // 2) // NESTED for low, high in window.T]
        return self._labels[np.ix_(*(at + low for at, low in zip(steps, self.window[0], strict=True)))] & wanted

    def flood(self, others: int, *, max_visited: int | None = None) -> Flood:
        """Return whether these obstacles (a mask of parts) hold the part, or the steps to a way out.

        Past ``max_visited`` displacements (the configuration's, if not given) it gives up: not blocked, no steps.
        """
        self._draw(self._bits_of(others))
        wanted = self._bits_of(others) & ~self._inside
        if not wanted or self._scene is None:  # too thin, or too wide, for this lattice
            return Flood(blocked=False)
        budget = max_visited or self.config.max_visited
        steps = np.full(self._labels.shape, -1, np.int32)
        queue = np.empty((min(budget, steps.size) + 1, 3), np.int32)
        start = tuple(int(n) for n in self.window[0])
        out, count, walls = explore(self._scene, self._labels, self._known, start, wanted, steps, queue, budget)
        if not out:
            return Flood(blocked=True, proof=tuple(self.obstacles[bit] for bit in cover(walls.tolist())))
        if count < 0:
            return Flood(blocked=False)
        steps_back(queue, count, steps)
        ends = np.stack([queue[count - 1], np.array(steps.shape) - 1 - queue[count - 1]])
        side, axis = np.unravel_index(int(ends.argmin()), ends.shape)
        cells = queue[np.unique(np.linspace(0, count - 1, min(count, self.config.max_lead)).astype(int))]
        steps = steps[cells[:, 0], cells[:, 1], cells[:, 2]]
        return Flood(blocked=False, cells=cells, steps=steps, rim=(int(side), int(axis)))

    def cells(self, offsets: Float[np.ndarray, "n 3"]) -> list[tuple[int, ...]]:
        """Return the cells of the lattice that displacements [m] are in."""
        places = np.round(offsets @ self.rotation.T / self.spacing).astype(int) + self.window[0]
        return list(map(tuple, places.tolist()))

    def way(self, others: int, offset: Float[np.ndarray, "3"], tried: set[tuple[int, ...]]) -> list[np.ndarray]:
        """Return displacements [m] that lead past the obstacles from one on to the rim, the last by going straight on.

        On a grown lattice: there is room along all of them. Empty if there is no room at the first, or no way on, or
        its cell is one that was tried before.
        """
        wanted = self._bits_of(others)
        self._draw(wanted)
        cell = self.cells(offset[None])[0]
        inside = all(0 < at < n - 1 for at, n in zip(cell, self._labels.shape, strict=True))
        if self._scene is None or cell in tried or not inside:
            return []
        tried.add(cell)
        if label(self._scene, cell, self._labels, self._known) & wanted:
            return []
        steps = np.full(self._labels.shape, -1, np.int32)
        queue = np.empty((min(self.config.max_room_visited, steps.size) + 1, 3), np.int32)
        out, count, _ = explore(
            self._scene, self._labels, self._known, cell, wanted, steps, queue, self.config.max_room_visited
        )  # fmt: skip
        tried.update(map(tuple, queue[: max(count, 0)].tolist()))
        if not out or count < 0:
            return []
        path = straightened(self._scene, self._labels, self._known, wanted, steps_from(steps, queue[count - 1]))
        end = path[-1]
        ends = np.stack([end, np.array(steps.shape) - 1 - end])
        side, axis = np.unravel_index(int(ends.argmin()), ends.shape)
        out_of = (1 if side else -1) * np.eye(3, dtype=int)[axis]
        return [(at - self.window[0]) @ self.rotation * self.spacing for at in [*path, end + out_of]]

    def smaller_proof(self, proof: tuple[int, ...], *, max_visited: int | None = None) -> tuple[int, ...]:
        """Return a subset of obstacles that hold the part, of which none can be spared on this lattice.

        A flood with fewer obstacles goes farther, so those that cover the walls of one flood may still be too many.
        """
        for other in proof:
            rest = tuple(part for part in proof if part != other)
            if len(rest) == len(proof):  # went with an earlier one
                continue
            flood = self.flood(sum(1 << part for part in rest), max_visited=max_visited)
            if flood.blocked:
                proof = flood.proof
        return proof

    def swapped(self, proof: tuple[int, ...], other: int, *, among: int) -> int:
        """Return those obstacles (a mask of parts) of which each holds the part in place of one of a proof's.

        Only some (a mask) are looked at, on lattices and as far as `SpaceConfig` says.
        """
        base = self._bits_of(sum(1 << part for part in proof if part != other))
        if not base or self._labels.size > self.config.max_swap_cells:
            return 0
        self._draw(self._bits_of(among))
        wanted = self._bits_of(among) & self._drawn & ~self._inside & ~base
        if not wanted or self._scene is None:
            return 0
        start = tuple(int(n) for n in self.window[0])
        budget = self.config.max_swap_visited
        each = met_on_every_way(self._scene, self._labels, self._known, start, base, wanted, budget)
        return sum(1 << self.obstacles[bit] for bit in bits(each))

    def distances(self, flood: Flood, offsets: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "2 n"]:
        """Return two guesses of the lattice steps from displacements to the way out that was found, 0 past the rim.

        By way of a displacement that the flood visited, since real halts are not on the lattice: of whichever makes the
        steps fewest, even behind a wall, and of the nearest one.
        """
        places = offsets @ self.rotation.T / self.spacing
        # past the rim of a window that was cut, what is left is at least the way past all boxes
        beyond = np.maximum(np.minimum(places + self.full[0], self.full[1] - places).min(axis=1), 0.0)
        places += self.window[0]
        if not len(flood.cells):
            return np.stack([beyond, beyond])
        out = np.empty((2, len(offsets)))
        nearest_steps(flood.cells, flood.steps, places, out)
        past = ((places <= 0.5) | (places >= np.array(self._labels.shape) - 1.5)).any(axis=1)
        return np.where(past, 0.0, out) + (beyond if self.is_cut else 0.0)

    def travel(
        self, others: int, offset: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
    ) -> tuple[float, int]:
        """Return an upper bound of the travel along a direction [m], and the mask of the parts that set it.

        0 where nothing does: then the travel to the rim.
        """
        wanted = self._bits_of(others)
        self._draw(wanted)
        wanted &= ~self._inside
        if self._scene is None:
            return np.inf, 0
        start = self.rotation @ offset / self.spacing + self.window[0]
        along = self.rotation @ direction
        steps, mask = cast(self._scene, self._labels, self._known, start, along, wanted)
        return steps * self.spacing, sum(1 << self.obstacles[bit] for bit in bits(mask))

    def _bits_of(self, others: int) -> int:
        """The obstacles as bits."""
        if others not in self._bits:
            self._bits[others] = sum(1 << bit for bit, part in enumerate(self.obstacles) if others >> part & 1)
        return self._bits[others]


def cover(walls: list[int]) -> list[int]:
    """Return a few bits of which every mask has at least one, none of them superfluous."""
    chosen: list[int] = []
    left = list(walls)
    while left:
        counts: dict[int, int] = {}
        for mask in left:
            for bit in bits(mask):
                counts[bit] = counts.get(bit, 0) + 1
        best = max(counts, key=lambda bit: (counts[bit], -bit))
        chosen.append(best)
        left = [mask for mask in left if not mask >> best & 1]
    for bit in list(chosen):
        rest = sum(1 << k for k in chosen if k != bit)
        if all(mask & rest for mask in walls):
            chosen.remove(bit)
    return sorted(chosen)


def _fit(window: Int[np.ndarray, "2 3"], count: Int[np.ndarray, "3"], max_cells: int) -> Int[np.ndarray, "2 3"]:
    """Cut the widest reaches of the window until part and window fit the lattice."""
    low, high = 2, int(window.max())
    if np.prod(count + window.sum(axis=0), dtype=float) <= max_cells:
        return window
    while high - low > 1:
        middle = (low + high) // 2
        fits = np.prod(count + np.minimum(window, middle).sum(axis=0), dtype=float) <= max_cells
        low, high = (middle, high) if fits else (low, middle)
    return np.minimum(window, low)

"""Beams notched into one another: woven half-lap lattices, and cubes of interlocked cells."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.product import Family, Product

Cell = tuple[int, int, int]
STEPS: tuple[Cell, ...] = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one lattice or cube that comes apart one part at a time."""
    pick = kit.Draw(rng)
    if pick.chance(0.3):
        return {"kind": "cube", "cell": pick.length(8.0, 16.0), "pieces": _draw_cube(pick)}
    rows, columns = pick.count(2, 5), pick.count(3, 5)
    while True:
        over = rng.integers(0, 2, size=(rows, columns))
        if _comes_apart(over):
            break
    crossings = [(i, j) for i in range(rows) for j in range(columns)]
    return {
        "kind": "weave",
        "over": over.tolist(),
        "width": pick.length(6.0, 12.0),
        "height": pick.length(6.0, 14.0),
        "pitch": pick.length(2.2, 3.4),
        "overhang": pick.length(0.8, 2.0),
        "angle": pick.choice((60.0, 75.0, 90.0)),
        "shear": pick.choice(([0.0, 0.0], [0.4, 0.0], [0.35, 0.35], [-0.5, 0.3]), (1, 1, 2, 2)),
        "gap": pick.choice((0.0, 0.05, 0.1)),
        "pegs": [
            [i, j, pick.choice((0.0, 12.0, 20.0))] for i, j in pick.some(crossings, pick.choice((0, 1, 2), (3, 2, 1)))
        ],
    }


def _comes_apart(over: np.ndarray) -> bool:
    """Return whether a weave comes apart: a beam leaves upwards when none crosses over it, downwards likewise."""
    rows, columns = set(range(over.shape[0])), set(range(over.shape[1]))
    for _ in range(sum(over.shape)):
        for group, others, table in ((rows, columns, over), (columns, rows, 1 - over.T)):
            for beam in sorted(group):
                if len({int(table[beam, other]) for other in others}) <= 1:
                    group.remove(beam)
                    break
    return not rows or not columns


def _draw_cube(pick: kit.Draw) -> list[list[Cell]]:
    """Return a cube of cells cut into connected pieces: of a few tries, the one with the fewest free pieces."""
    best, least = [], 1.0
    tries = 0
    while tries < 40 or not best:
        tries += 1
        pieces = _grow(pick, pick.choice((3, 4)), pick.count(4, 6))
        share = _solve(pieces) if all(map(_is_solid, pieces)) else None
        if share is not None and share < least:
            best, least = pieces, share
    return [[(int(x), int(y), int(z)) for x, y, z in sorted(piece)] for piece in best]


def _grow(pick: kit.Draw, side: int, count: int) -> list[set[Cell]]:
    """Return pieces grown from seeds until they fill the cube."""
    free: set[Cell] = set(itertools.product(range(side), range(side), range(side)))
    pieces = [{cell} for cell in pick.some(sorted(free), count)]
    free -= set().union(*pieces)
    while free:
        piece = pieces[pick.count(0, count - 1)]
        rim = sorted({_moved(cell, step) for cell in piece for step in STEPS} & free)
        if rim:
            cell = rim[pick.count(0, len(rim) - 1)]
            piece.add(cell)
            free.remove(cell)
    return pieces


def _moved(cell: Cell, step: Cell) -> Cell:
    return (cell[0] + step[0], cell[1] + step[1], cell[2] + step[2])


def _is_solid(piece: set[Cell]) -> bool:
    """Return whether no two cells of a piece touch along an edge or in a corner only."""
    for first, second in itertools.combinations(sorted(piece), 2):
        step = [b - a for a, b in zip(first, second, strict=True)]
        if max(map(abs, step)) == 1 and sum(map(abs, step)) > 1:
            ways = [(first[0] + step[0], first[1], first[2]), (first[0], first[1] + step[1], first[2])]
            ways.append((first[0], first[1], first[2] + step[2]))
            if not any(way in piece for way in ways if way != first):
                return False
    return True


def _solve(pieces: list[set[Cell]]) -> float | None:
    """Return the mean share of pieces that are free while all leave one at a time; None if some stay.

    A piece that needs several legs counts a little less than one that runs straight out.
    """
    left, shares = list(pieces), []
    while len(left) > 1:
        ways = [_way_out(piece, set().union(*(p for p in left if p is not piece))) for piece in left]
        free = [0.9**way for way in ways if way is not None]
        if not free:
            return None
        shares.append(sum(free) / len(left))
        left.pop(next(k for k, way in enumerate(ways) if way is not None))
    return sum(shares) / len(shares)


def _way_out(piece: set[Cell], others: set[Cell]) -> int | None:
    """Return the fewest steps along the lattice before a piece runs straight out past the others."""
    seen, frontier = {(0, 0, 0)}, [(0, 0, 0)]
    for steps in range(6):
        following = []
        for offset, step in itertools.product(frontier, STEPS):
            at = offset
            while not {_moved(cell, at) for cell in piece} & others and max(map(abs, at)) < 5:
                at = _moved(at, step)
            if max(map(abs, at)) >= 5:
                return steps
            one = _moved(offset, step)
            if at != one and one not in seen and not {_moved(cell, one) for cell in piece} & others:
                seen.add(one)
                following.append(one)
        frontier = following
    return None


def build(params: Mapping[str, Any]) -> Product:
    """Return the lattice or the cube."""
    product = _cube(params) if params["kind"] == "cube" else _weave(params)
    # a slanted peg may cut a crumb off a corner
    product.solids = {name: max(s.decompose(), key=Manifold.volume) for name, s in product.solids.items()}
    return product


def _cube(params: Mapping[str, Any]) -> Product:
    product, size = Product(), params["cell"]
    for piece in params["pieces"]:
        solid = kit.union(kit.box(cell, [c + 1 for c in cell]) for cell in piece)
        product.add("piece", solid.scale((size, size, size)))
    return product


def _weave(params: Mapping[str, Any]) -> Product:
    """Return the woven beams, sheared as a whole so that they leave along the slant, and their pegs."""
    product, over = Product(), params["over"]
    width, height, pitch = params["width"], params["height"], params["pitch"] * params["width"]
    rows, columns, angle = len(over), len(over[0]), params["angle"]
    stretch = 1.0 / math.sin(math.radians(angle))

    def reach(count: int, crossed: int) -> float:
        span = (crossed - 1 + (count - 1) * math.cos(math.radians(angle))) / 2.0 * pitch
        return (span + params["overhang"] * width) * stretch + 0.4 * width

    def beam(index: int, count: int, crossed: int, turn: float, wider: float = 0.0) -> Manifold:
        half = reach(count, crossed) + 0.6 * width
        middle, thick = (index - (count - 1) / 2.0) * pitch, width / 2.0 + wider
        return kit.box((-half, middle - thick, 0.0), (half, middle + thick, height)).rotate((0.0, 0.0, turn))

    def tall(solid: Manifold) -> Manifold:
        return solid.scale((1.0, 1.0, 3.0)).translate((0.0, 0.0, -height))

    row_names = [product.add("beam", beam(i, rows, columns, 0.0)) for i in range(rows)]
    column_names = [product.add("beam", beam(j, columns, rows, angle)) for j in range(columns)]
    low = kit.box((-999.0, -999.0, -1.0), (999.0, 999.0, height / 2.0))
    high = kit.box((-999.0, -999.0, height / 2.0), (999.0, 999.0, height + 1.0))
    gap = params["gap"] / 2.0
    for i, j in itertools.product(range(rows), range(columns)):
        row, column = tall(beam(i, rows, columns, 0.0, gap)), tall(beam(j, columns, rows, angle, gap))
        product.cut([row_names[i]], column ^ (low if over[i][j] else high))
        product.cut([column_names[j]], row ^ (high if over[i][j] else low))
    slant = np.array([[1.0, 0.0, params["shear"][0], 0.0], [0.0, 1.0, params["shear"][1], 0.0], [0.0, 0.0, 1.0, 0.0]])
    product.solids = {name: solid.transform(slant) for name, solid in product.solids.items()}
    if any(params["shear"]):
        end = reach(rows, columns)
        for i, name in enumerate(row_names):
            hole = kit.cylinder(0.55 * width, -2.0 * height, 4.0 * height, segments=12)
            for x in (-end, end):
                middle = (x, (i - (rows - 1) / 2.0) * pitch, 0.0)
                product.cut([name], kit.place(hole, middle, (*params["shear"], 1.0)))
    for i, j, tilt in params["pegs"]:
        y = (i - (rows - 1) / 2.0) * pitch
        x = (y * math.cos(math.radians(angle)) - (j - (columns - 1) / 2.0) * pitch) * stretch
        middle = (x + params["shear"][0] * height / 2.0, y + params["shear"][1] * height / 2.0, height / 2.0)
        axis = (math.sin(math.radians(tilt)), 0.0, math.cos(math.radians(tilt)))
        size, length = 0.45 * width, 0.5 * height / axis[2] + width
        product.cut(
            [row_names[i], column_names[j]],
            kit.place(kit.cylinder(size, -length - 1.0, length + 1.0, segments=12), middle, axis),
        )
        product.add("peg", kit.place(kit.cylinder(size, -0.7 * length, 0.7 * length, segments=12), middle, axis))
    return product


FAMILY = Family(
    name="burr_lattice",
    version=2,
    summary="woven beams that leave up or down a slant, pegged at crossings; cubes of cells with several legs",
    draw=draw,
    build=build,
)

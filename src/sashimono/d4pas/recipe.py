"""A recipe: the few numbers that make one product again, the same on every machine."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from manifold3d import Error, Manifold

from sashimono.assembly import Assembly, Part
from sashimono.d4pas import kit
from sashimono.d4pas.families import families
from sashimono.d4pas.product import Product
from sashimono.errors import InputError
from sashimono.geometry.mesh import topology
from sashimono.geometry.mesh.shapes import identical_shapes

GRID = 1e-9
"""Vertices lie on a grid of this width [m]: the last bits of sines and cosines differ between machines."""

ROTATION = "rotation"
"""The parameter, of every family, that turns the whole product: a quaternion (w, x, y, z), or None."""

ONLY = "only"
"""The parameter by which a blueprint is but some parts of a product, that hang together: their names."""

SIZES = {3: 0.22, 4: 0.2, 5: 0.16, 6: 0.12, 7: 0.1, 8: 0.08, 9: 0.06, 11: 0.06}
"""How many parts a blueprint has that is not a whole product, each with its share."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What makes one product: a family, its parameters, and the seed that they were drawn with."""

    family: str
    version: int
    params: Mapping[str, Any]
    seed: int
    name: str = ""
    """Name of the blueprint where it is somebody else's assembly; empty for our families."""

    @property
    def id(self) -> str:
        """Name of the blueprint, unique in a dataset."""
        return self.name or f"{self.family}-{self.seed:06d}{'-pair' if len(self.params.get(ONLY, ())) == 2 else ''}"


def draw_recipe(family: str, seed: int, *, turned: float = 0.25, whole: float = 1.0, pair: bool = False) -> Recipe:
    """Return the recipe of a family's member with this seed. Raises InputError for an unknown family.

    Args:
        family: Its name.
        seed: Of everything that is drawn.
        turned: Share of members that are turned out of the axes.
        whole: Share of members that are whole products; of the others, some parts that hang together are taken.
        pair: Take two parts that touch.
    """
    kind = families().get(family)
    if kind is None:
        raise InputError(f"family {family!r} is not known; choose from {', '.join(families())}")
    key = int.from_bytes(hashlib.sha256(family.encode()).digest()[:4], "big")
    rng = np.random.default_rng([key, seed])
    params = kind.draw(rng)
    assert not {ROTATION, ONLY} & set(params), f"{family}: a parameter's name is taken"
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    is_turned = bool(rng.random() < turned)
    params[ROTATION] = [round(float(x), 6) for x in quaternion] if is_turned else None
    is_whole = bool(rng.random() < whole)
    count = 2 if pair else int(rng.choice(list(SIZES), p=list(SIZES.values())))
    if pair or not is_whole:
        product = kind.build(params)
        if len(product.solids) > count:
            params[ONLY] = _hanging_together(product, count, rng)
    return Recipe(family=family, version=kind.version, params=params, seed=seed)


def build_product(recipe: Recipe) -> Product:
    """Return the product of a recipe as its family draws it [mm], not turned.

    Raises InputError if this release draws the family otherwise than the recipe's version.
    """
    kind = families().get(recipe.family)
    if kind is None or kind.version != recipe.version:
        here = "is not known" if kind is None else f"is at version {kind.version}"
        raise InputError(
            f"{recipe.id}: the recipe asks for version {recipe.version} of family {recipe.family}, which {here} here;"
            " install the release that made it"
        )
    product = kind.build(recipe.params)
    if ONLY in recipe.params:
        product.solids = {name: product.solids[name] for name in recipe.params[ONLY]}
    return kit.tidy(product)


def build_assembly(recipe: Recipe) -> Assembly:
    """Return the parts of a recipe in place [m], in an order that says nothing of how they go together."""
    return assembly_of(build_product(recipe), recipe)


def assembly_of(product: Product, recipe: Recipe) -> Assembly:
    """Return a recipe's product as an assembly [m]: turned, on the grid, its parts shuffled by the seed."""
    rotation = _rotation(recipe.params.get(ROTATION))
    names = sorted(product.solids, key=lambda name: hashlib.sha256(f"{recipe.seed}/{name}".encode()).digest())
    parts = []
    for name in names:
        mesh = product.solids[name].to_mesh64()
        points = np.array(mesh.vert_properties[:, :3]) @ rotation.T * 1e-3
        parts.append(
            Part(
                name=name,
                vertices_part=np.round(points / GRID) * GRID,
                faces=np.array(mesh.tri_verts, dtype=np.int32),
                T_world_part=np.eye(4),
            )
        )
    same = identical_shapes([(part.vertices_part, part.faces) for part in parts])
    return Assembly(parts=tuple(parts), identical=tuple(tuple(names[k] for k in members) for members in same))


def find_faults(product: Product, *, gap: float = 0.35) -> list[str]:
    """Return what is wrong with a product, a line each: parts that are no single solid, overlaps, parts apart.

    Args:
        product: What to look at.
        gap: Parts nearer than this touch [mm].
    """
    solids = product.solids
    faults = []
    for name, solid in solids.items():
        if solid.status() != Error.NoError or solid.is_empty():
            faults.append(f"{name} is empty or no solid")
        elif len(solid.decompose()) != 1:
            faults.append(f"{name} is in {len(solid.decompose())} pieces")
        elif not topology.is_closed(np.asarray(solid.to_mesh64().tri_verts, dtype=np.int32)):
            faults.append(f"{name} is not closed")
    if faults:
        return faults
    group = {name: name for name in solids}

    def root(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    for first, second in _near_boxes(solids, gap):
        shared = (solids[first] ^ solids[second]).volume()
        least = min(solids[first].volume(), solids[second].volume())
        if shared > 1e-4 * least and frozenset((first, second)) not in product.fits:
            faults.append(f"{first} and {second} overlap by {shared:.3g} mm³")
        if root(first) != root(second) and (shared > 0.0 or _near(solids[first], solids[second], gap)):
            group[root(first)] = root(second)
    apart = {root(name) for name in solids}
    if len(apart) > 1:
        faults.append(f"{len(apart)} groups of parts do not touch: {', '.join(sorted(apart))}")
    return faults


def content_hash(assembly: Assembly) -> str:
    """Return the SHA-256 of an assembly's geometry: names, vertices in steps of the grid, triangles."""
    digest = hashlib.sha256()
    for part in assembly.parts:
        digest.update(part.name.encode() + b"\0")
        digest.update(np.round(part.vertices_world / GRID).astype("<i8").tobytes())
        digest.update(part.faces.astype("<i4").tobytes())
    return digest.hexdigest()


def _near_boxes(solids: Mapping[str, Manifold], gap: float) -> Iterator[tuple[str, str]]:
    """Yield the pairs whose boxes are no farther apart than the gap, in the order of the parts."""
    names = list(solids)
    boxes = [np.array(solid.bounding_box()) for solid in solids.values()]
    for k in range(len(names)):
        for j in range(k):
            low, high = np.maximum(boxes[j][:3], boxes[k][:3]), np.minimum(boxes[j][3:], boxes[k][3:])
            if (low <= high + gap).all():
                yield names[j], names[k]


def _hanging_together(product: Product, count: int, rng: np.random.Generator, *, gap: float = 0.35) -> list[str]:
    """Names of this many parts, grown from one drawn at random by parts that touch those taken; in product order."""
    solids = product.solids
    touching: dict[str, list[str]] = {name: [] for name in solids}
    for first, second in _near_boxes(solids, gap):
        if _near(solids[first], solids[second], gap):
            touching[first].append(second)
            touching[second].append(first)
    names = list(solids)
    taken = [names[int(rng.integers(len(names)))]]
    while len(taken) < count:
        around = [name for name in names if name not in taken and any(name in touching[other] for other in taken)]
        taken.append(around[int(rng.integers(len(around)))])
    return [name for name in names if name in taken]


def _near(first: Manifold, second: Manifold, gap: float) -> bool:
    return first.min_gap(second, gap) < gap


def _rotation(quaternion: list[float] | None) -> np.ndarray:
    if quaternion is None:
        return np.eye(3)
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )

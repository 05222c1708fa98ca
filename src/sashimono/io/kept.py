"""Products and other sets of parts that stay one part: their surfaces united, in place of what they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sashimono.assembly import Assembly, Kept, Part, Product
from sashimono.bodies import merge_parts
from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.geometry.mesh.shapes import identical_shapes
from sashimono.io.checks import find_overlaps
from sashimono.io.raw import ReadConfig


def keep_together(assembly: Assembly, kept: Sequence[Kept], *, config: ReadConfig | None = None) -> Assembly:
    """Return the assembly with each of these products, or sets of parts, as one part, called like the product.

    It takes the place, frame, and colour of the product's first part. Its source says what was kept; each is noted. Of
    two products of which one is inside the other, the outer one becomes a part. Two uses of one product become the same
    shape.

    Raises InputError for a product or part that the assembly does not have, and where nothing is left to assemble.
    """
    if not kept:
        return assembly
    config = config or ReadConfig()
    where = assembly.source.path if assembly.source is not None else "the assembly"
    chosen = [_product_of(entry, assembly, where) for entry in kept]
    outer = [p for p in chosen if not any(p is not q and set(p.parts) < set(q.parts) for q in chosen)]
    part_of = {name: product for product in outer for name in product.parts}
    members_of = {product.name: product.parts for product in outer}
    merged: dict[str, Part] = {}
    for product in outer:
        members = [assembly.part(name) for name in product.parts]
        like = next((n for n in merged if _is_same([assembly.part(m) for m in members_of[n]], members)), None)
        if like is None:
            made = replace(merge_parts(members, members[0].name), name=product.name, color=members[0].color)
        else:
            made = replace(merged[like], name=product.name, T_world_part=members[0].T_world_part)
        merged[product.name] = made
    parts: list[Part] = []
    for part in assembly.parts:
        product = part_of.get(part.name)
        if product is None:
            parts.append(part)
        elif part.name == product.parts[0]:
            parts.append(merged[product.name])
    reasons = {entry.product: entry.reason for entry in kept}
    if len(parts) < 2:
        raise InputError(
            f"{where}: all {len(assembly)} parts are one ({reasons[parts[0].name]}): nothing to assemble."
            " --flat takes it apart."
        )
    notes = [f"{p.name}: {len(p.parts)} parts kept together as one ({reasons[p.name]})" for p in outer]
    same = identical_shapes([(part.vertices_part, part.faces) for part in parts])
    source = assembly.source
    if source is not None:
        source = replace(source, kept=tuple(entry for entry in kept if entry.product in merged))
    return Assembly(
        parts=tuple(parts),
        source=source,
        overlaps=find_overlaps(parts, config),
        identical=tuple(tuple(parts[k].name for k in members) for members in same),
        notes=(*assembly.notes, *notes),
        products=_remaining(assembly.products, part_of, len(parts)),
    )


def _product_of(entry: Kept, assembly: Assembly, where: str) -> Product:
    """The product of this name, or the parts that the entry names itself."""
    if entry.members:
        for name in entry.members:
            if name not in assembly.names:
                raise InputError(
                    f"{where}: has no part {name!r}, of which {entry.product} is made. Plan it again, or with --flat."
                )
        return Product(name=entry.product, parts=tuple(n for n in assembly.names if n in entry.members))
    for product in assembly.products:
        if product.name == entry.product:
            return product
    raise InputError(f"{where}: has no product {entry.product!r}. Plan it again, or plan it with --flat.")


def _is_same(first: Sequence[Part], second: Sequence[Part]) -> bool:
    """Whether two products are made of the same meshes, placed alike to one another."""
    if len(first) != len(second):
        return False
    back_first, back_second = se3.inverse(first[0].T_world_part), se3.inverse(second[0].T_world_part)
    for a, b in zip(first, second, strict=True):
        alike = a.vertices_part.shape == b.vertices_part.shape and np.array_equal(a.faces, b.faces)
        if not (alike and np.array_equal(a.vertices_part, b.vertices_part)):
            return False
        size = float(np.linalg.norm(np.ptp(a.vertices_part, axis=0)))
        apart = np.abs(back_first @ a.T_world_part - back_second @ b.T_world_part)
        if apart[:3, 3].max() > 1e-6 * size or apart[:3, :3].max() > 1e-6:
            return False
    return True


def _remaining(products: Sequence[Product], part_of: dict[str, Product], count: int) -> tuple[Product, ...]:
    """The products that are still made of several parts, of the parts that there are now."""
    out = []
    for product in products:
        names = tuple(dict.fromkeys(part_of[name].name if name in part_of else name for name in product.parts))
        if 1 < len(names) < count and names not in [other.parts for other in out]:
            out.append(Product(name=product.name, parts=names))
    return tuple(out)

"""Parts that are caged in one other part: a rod in its cylinder, a ball in its socket. They are bought as one thing.

Nobody can take such a pair apart, whatever else is gone. That is proven for all motions where a ball inside the part
cannot leave, else for translations, and pushing, turning and tilting find no way either. Pieces of a puzzle are no such
pair: each is held by several others, and by none of them alone.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from manifold3d import Manifold

from sashimono.assembly import Assembly, Kept, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.config import SeparateConfig
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.sequence.reasons import VerdictConfig, least_interference
from sashimono.disassembly.threads.surface import Threads
from sashimono.fasteners.recognise import find_fasteners
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.features.circle import circle_center
from sashimono.geometry.features.directions import frame_along
from sashimono.geometry.mesh import measures
from sashimono.plan import Answer, MotionClass, Unsolved
from sashimono.selection import shared_name


@dataclass(frozen=True, kw_only=True)
class CagedConfig:
    """When a part counts as caged for good."""

    separate: SeparateConfig = field(default_factory=lambda: SeparateConfig(tilting=True))
    """How it is asked whether the two come apart."""
    overlap: float = 0.02
    """Parts that overlap more than this as assembled are a fit, and no cage; over the smaller one's smallest extent."""
    give: float = 0.1
    """Where less than this has to give, straight out, it may be elastic; over the smaller one's smallest extent."""
    strain: float = 0.03
    """The same over the smaller one's largest extent."""
    ring: float = 0.5
    """A ring thinner than this, over its radius, may be stretched: seals, circlips."""
    through: int = 33
    """Points of a ring's axis that must be free."""
    balls: int = 6
    """Most balls inside a part that are looked at."""
    grid: float = 8.0
    """Their middles are looked for on a grid of this many points across the part's smallest extent,"""
    max_grid: int = 60_000
    """and of no more points than these."""
    verdict: VerdictConfig = field(default_factory=VerdictConfig)
    """How that depth is measured."""


def find_caged(
    assembly: Assembly, unsolved: Sequence[Unsolved], *, config: CagedConfig | None = None
) -> tuple[Kept, ...]:
    """Return the sets of parts that are caged in one of them, of the parts that could not leave.

    A part is caged in another one if translations provably do not part the two alone, and neither threads, pushes nor
    tilts do. Fasteners, parts with a common thread, thin rings, parts that overlap as assembled, and those of which
    little would have to give are left out: these are put together by other means. So is a set that is all there is.

    Args:
        assembly: All parts.
        unsolved: What a plan of it says of the parts that it does not place.
        config: What counts as caged.
    """
    config = config or CagedConfig()
    proven = [entry for entry in unsolved if entry.answer is Answer.PROVEN_BLOCKED and entry.part in assembly.names]
    if not proven or len(assembly) < 3:
        return ()
    fasteners = {fastener.part for fastener in find_fasteners(assembly)}
    bulk = {part.name: float(np.prod(np.ptp(part.bounds_world, axis=0))) for part in assembly.parts}
    sets: list[tuple[frozenset[str], list[str]]] = []
    asked: set[frozenset[str]] = set()
    for entry in proven:
        for other_name in entry.blocked_by:
            pair = frozenset((entry.part, other_name))
            if pair in asked or pair & fasteners or any(pair <= members for members, _ in sets):
                continue
            asked.add(pair)
            part, cage = sorted(pair, key=lambda name: (bulk[name], name))
            motions = caged_for(assembly, part, cage, config=config)
            if motions is None:
                continue
            words = [f"{part} is caged in {cage}, proven for {motions}"]
            if motions is not MotionClass.ALL:
                words[0] += ", and no push or tilt frees it"
            for other in [other for other in sets if other[0] & pair]:
                sets.remove(other)
                pair, words = pair | other[0], [*other[1], *words]
            sets.append((pair, words))
    kept: list[Kept] = []
    for members, words in sets:
        products = [set(product.parts) for product in assembly.products]
        crosses = any(members & p and not (members >= p or members <= p) for p in products)
        if len(members) < len(assembly) and not crosses:
            kept.append(_kept(assembly, members, words, taken={entry.product for entry in kept}))
    return tuple(kept)


def caged_for(assembly: Assembly, part: str, cage: str, *, config: CagedConfig | None = None) -> MotionClass | None:
    """Return the motions that provably do not free a part from another one, all else gone; None if it is not caged.

    For all motions it is proven by a ball inside the part that no translation takes out: whatever the part does, its
    ball only shifts. Where there is none, pushes and tilts have to fail as well.
    """
    config = config or CagedConfig()
    alone = Assembly(parts=(assembly.part(part), assembly.part(cage)))
    cascade = Cascade(alone, make_bodies(alone), config=config.separate)
    parts = cascade.parts
    size = parts.smaller_size(0, 1)
    if parts.overlaps[0, 1] > config.overlap * size or any(_is_thin_ring(each, config) for each in alone.parts):
        return None
    if Threads(parts, config=config.separate.unscrew).between(0, 1):
        return None
    translations = (cascade.directions, cascade.translations)
    if cascade.inquire().separate(0, parts.all_parts, stages=translations).proven_for is None:
        return None
    least = least_interference(parts, 0, [1], config=config.verdict)
    largest = min(float(body.extents.max()) for body in parts.bodies)
    if least is not None and least.depth < max(config.give * size, config.strain * largest):
        return None
    if any(_is_held(ball, alone.parts[1], parts.scale(0, 1), config) for ball in _balls_inside(parts, config)):
        return MotionClass.ALL
    for stage in (cascade.physics, cascade.tilting):
        if stage.separate(0, parts.all_parts, max_traced=config.separate.max_traced).answer is Answer.FREE:
            return None
    return MotionClass.TRANSLATIONS


def _balls_inside(parts: PlacedParts, config: CagedConfig) -> list[Part]:
    """Large balls inside the first of two parts that are in the other one's box, the largest first."""
    low, high = np.maximum(parts.boxes[0, 0], parts.boxes[1, 0]), np.minimum(parts.boxes[0, 1], parts.boxes[1, 1])
    if (low >= high).any():
        return []
    step = max(float(parts.sizes[0]) / config.grid, float(np.cbrt(np.prod(high - low) / config.max_grid)))
    axes = [np.linspace(a, b, 1 + max(2, round((b - a) / step))) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    depths = -SignedDistance(parts.vertices[0], parts.faces[0]).query(points)
    sphere = Manifold.sphere(1.0, 24).to_mesh64()
    unit, faces = np.array(sphere.vert_properties[:, :3]), np.array(sphere.tri_verts, dtype=np.int32)
    balls = []
    while len(balls) < config.balls and depths.max() > 0.0:
        deepest = int(np.argmax(depths))
        center, radius = points[deepest], float(depths[deepest])
        balls.append(Part(name="ball", vertices_part=center + radius * unit, faces=faces, T_world_part=np.eye(4)))
        depths[np.linalg.norm(points - center, axis=1) <= radius] = 0.0
    return balls


def _is_held(ball: Part, cage: Part, scale: float, config: CagedConfig) -> bool:
    """Whether translations provably do not free a ball from a part, as deep as one of this scale may go into it."""
    alone = Assembly(parts=(ball, replace(cage, name="cage")))
    bodies = make_bodies(alone)
    own = min(scale, PlacedParts(alone, bodies, config=config.separate.parts).scale(0, 1))
    tolerances = replace(config.separate.parts.tolerances, plan=config.separate.parts.tolerances.plan * scale / own)
    separate = replace(config.separate, parts=replace(config.separate.parts, tolerances=tolerances))
    return Cascade(alone, bodies, config=separate).translations.search.caged(0, [1]).proven


def _is_thin_ring(part: Part, config: CagedConfig) -> bool:
    """Whether a part is bent in a circle around nothing, open or closed, and thin: a circlip, a seal."""
    mass = measures.mass_properties(part.vertices_world, part.faces)
    distance = SignedDistance(part.vertices_world, part.faces)
    for axis in mass.axes.T:
        frame = frame_along(axis)
        turned = (part.vertices_world - mass.center) @ frame.T
        flat = turned[:, :2]
        middle = circle_center(flat)  # an open ring's centre of mass is not its middle
        radii = np.linalg.norm(flat - middle, axis=1)
        heights = np.linspace(turned[:, 2].min(), turned[:, 2].max(), config.through)
        line = np.column_stack([np.tile(middle, (config.through, 1)), heights])
        is_thin = radii.max() - radii.min() <= config.ring * radii.max()
        if is_thin and distance.query(mass.center + line @ frame).min() > 0.0:
            return True
    return False


def _kept(assembly: Assembly, members: frozenset[str], words: Sequence[str], *, taken: Collection[str]) -> Kept:
    """The entry that keeps these parts together: as the product that they are, or as a set of a name not taken."""
    said = f"bought: {'; '.join(words[:3])}{f'; and {len(words) - 3} more' if len(words) > 3 else ''}"
    product = next((product for product in assembly.products if set(product.parts) == members), None)
    if product is not None:
        return Kept(product=product.name, reason=said)
    names = tuple(name for name in assembly.names if name in members)
    taken = {*taken, *assembly.names, *(product.name for product in assembly.products)}
    return Kept(product=shared_name(names, taken, "_with_".join(names[:2])), reason=said, members=names)

"""A removal checked by `verify`, with none of the code that found it."""

from __future__ import annotations

from sashimono.assembly import Assembly, Part
from sashimono.disassembly.removal import Removal
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.overlap import AssembledOverlaps
from sashimono.verify.pairs import check_pair, pair_tolerance
from sashimono.verify.sweep import Screws


def problems(parts: Assembly, part: Part, others: list[Part], removal: Removal) -> list[str]:
    """Return what the check has against a removal."""
    config = VerifyConfig(samples=1000)
    bodies = {p.name: SampledBody(p.name, p.vertices_part, p.faces, samples=config.samples) for p in parts.parts}
    overlaps = AssembledOverlaps(bodies, {p.name: p.T_world_part for p in parts.parts}, config)
    path = Screws.between(removal.displacements[::-1] @ part.T_world_part)
    found = [
        check_pair(
            bodies[part.name],
            bodies[other.name],
            path,
            other.T_world_part,
            overlaps=overlaps,
            tolerance=pair_tolerance(bodies[part.name], bodies[other.name], config),
            config=config,
        ).problem
        for other in others
    ]
    return [problem for problem in found if problem]

"""The bodies of an assembly's parts: made once, shared by all levels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.geometry.body import Body, SampleConfig
from sashimono.geometry.mesh.solid import unite


def make_body(
    part: Part,
    *,
    config: SampleConfig | None = None,
    rng: np.random.Generator | None = None,
) -> Body:
    """Return one part's body, sampled with this generator (seed 0 if none is given)."""
    config, rng = config or SampleConfig(), rng or np.random.default_rng(0)
    return Body(part.name, part.vertices_part, part.faces, config=config, rng=rng)


def make_bodies(
    assembly: Assembly, *, config: SampleConfig | None = None, rng: np.random.Generator | None = None
) -> dict[str, Body]:
    """Return the body of every part, by name, each sampled with a generator of its own (seed 0 if none is given)."""
    rng = rng or np.random.default_rng(0)
    return {
        part.name: make_body(part, config=config, rng=child)
        for part, child in zip(assembly.parts, rng.spawn(len(assembly)), strict=True)
    }


def merge_parts(parts: Sequence[Part], name: str) -> Part:
    """Return parts in their assembled poses as one rigid part, with name, frame and pose of one of them.

    StopIteration if no part has this name.
    """
    leader = next(part for part in parts if part.name == name)
    T_leader_world = se3.inverse(leader.T_world_part)
    vertices, faces = unite(
        [(se3.apply(T_leader_world @ part.T_world_part, part.vertices_part), part.faces) for part in parts]
    )
    return Part(name=name, vertices_part=vertices, faces=faces, T_world_part=leader.T_world_part)

"""The labels of D4PAS against an oracle that shares no code with level 1: brute-force boolean sweeps.

    python benchmarks/d4pas_oracle.py [DATASET] [--blueprints 200] [--witnesses 500] [--workers 2]

For small blueprints, every part is moved along many directions (an even sphere, the axes, all its own face normals)
in small steps, and its exact intersection with each other part is measured. In every reachable state, a part
that the oracle frees must be free in the labels, and every witness of a clause must be clear of what stays. For further
blueprints, `verify` checks each motion and contact in steps.parquet. A contradiction is printed and counted.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path

import manifold3d
import numpy as np

from sashimono.d4pas import Blueprint, load
from sashimono.d4pas.check import check_dataset
from sashimono.d4pas.labels import LabelConfig, label_assembly
from sashimono.d4pas.states import all_states, can_leave

SPHERE = 150
"""Directions spread evenly; to them come the axes and each part's face normals."""

NOTHING = 1e-9
"""Shared volume, over the smaller part's: less is touching."""

SHARE = 1e-4
"""The same beyond that of the assembled pose, of two parts that overlap there."""

TOLERANCE = 0.02
"""Thickness of the shared body that a motion may have, over the smaller part's smallest extent, as in `verify`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", nargs="?", default="v1")
    parser.add_argument("--blueprints", type=int, default=200, help="small ones, looked at by booleans")
    parser.add_argument("--most-parts", type=int, default=6)
    parser.add_argument("--witnesses", type=int, default=500, help="blueprints whose motions verify checks")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    data = load(options.dataset)
    small = [b for b in data if 3 <= len(b) <= options.most_parts]
    rng = np.random.default_rng(0)
    chosen = [small[k] for k in rng.permutation(len(small))[: options.blueprints]]
    start = time.monotonic()
    found, queries = [], 0
    with ProcessPoolExecutor(options.workers) as pool:
        for blueprint, (asked, problems) in zip(chosen, pool.map(against_booleans, chosen, chunksize=1), strict=True):
            queries += asked
            found += [f"{blueprint.id}: {problem}" for problem in problems]
    print(f"booleans: {len(chosen)} blueprints, {queries} (state, part) pairs, {len(found)} contradictions")
    checked = check_dataset(data, sample=options.witnesses, seed=1)
    print(
        f"verify: {checked.blueprints} blueprints, {checked.motions} motions, {checked.contacts} contacts, "
        f"{len(checked.problems)} refuted"
    )
    for line in (*found, *checked.problems):
        print(line)
    print(f"{time.monotonic() - start:.0f} s")
    if options.json:
        result = {"dataset": data.hash, "blueprints": len(chosen), "pairs": queries, "contradictions": found}
        result |= {"verified": checked.blueprints, "motions": checked.motions, "refuted": list(checked.problems)}
        options.json.write_text(json.dumps(result, indent=1) + "\n")


def against_booleans(blueprint: Blueprint) -> tuple[int, list[str]]:
    """Return how many (state, part) pairs were asked and what contradicts the labels."""
    assembly = blueprint.assembly()
    sweeps = Sweeps(assembly)
    problems, asked = [], 0
    states = all_states(blueprint.masks, limit=10_000) or {}
    for state in states:
        for part in range(len(blueprint)):
            if not state >> part & 1:
                continue
            others = [k for k in range(len(blueprint)) if state >> k & 1 and k != part]
            asked += 1
            if not can_leave(blueprint.masks, part, state & ~(1 << part)):
                direction = sweeps.way_out(part, others)
                if direction is not None:
                    names = [blueprint.parts[k] for k in others]
                    problems.append(f"{blueprint.parts[part]} leaves {names} along {np.round(direction, 3)}")
    conditions = label_assembly(assembly, config=LabelConfig(), seed=blueprint.seed).conditions
    everything = (1 << len(blueprint)) - 1
    for part, clauses in enumerate(conditions.clauses):
        for clause in clauses:
            staying = [k for k in range(len(blueprint)) if everything >> k & 1 and k != part]
            staying = [k for k in staying if not clause.blockers >> k & 1]
            hit = sweeps.hit(part, staying, clause.removal.displacements)
            if hit is not None and clause.stage in ("blocking", "contacts", "translation"):
                problems.append(f"{blueprint.parts[part]} hits {blueprint.parts[hit]} on its way out")
    return asked, problems


class Sweeps:
    """Which part stops which along which direction, by booleans, worked out when asked for."""

    def __init__(self, assembly) -> None:
        self.solids = [solid(part) for part in assembly.parts]
        self.boxes = [np.array(s.bounding_box()).reshape(2, 3) for s in self.solids]
        self.volumes = [s.volume() for s in self.solids]
        self.directions = [self._directions(part) for part in assembly.parts]
        self.known: dict[tuple[int, int, int], bool] = {}
        self.shared: dict[tuple[int, int], float] = {}

    def way_out(self, part: int, others: list[int]) -> np.ndarray | None:
        """Return a direction along which a part passes all others, or None."""
        for d, direction in enumerate(self.directions[part]):
            if all(self._passes(part, other, d) for other in others):
                return direction
        return None

    def hit(self, part: int, others: list[int], displacements: np.ndarray, *, steps: int = 60) -> int | None:
        """Return the first part that another one runs into by more than rolling along a facet, or None."""
        share = 2e-2  # a facet's sagitta and the verifier's own tolerance, in volume
        for a, b in pairwise(displacements):
            for u in (np.arange(steps) + 1.0) / steps:
                T = np.array(a)
                T[:3, 3] = (1.0 - u) * a[:3, 3] + u * b[:3, 3]
                moved = self.solids[part].transform(np.ascontiguousarray(T[:3]))
                for other in others:
                    if self._overlap(moved, part, other) > share:
                        return other
        return None

    def _passes(self, part: int, other: int, d: int) -> bool:
        key = (part, other, d)
        if key not in self.known:
            direction = self.directions[part][d]
            own, its = self.boxes[part], self.boxes[other]
            reach = float(np.abs(direction) @ np.maximum(own[1] - its[0], its[1] - own[0]))  # until past it
            least = float(np.ptp(self.boxes[part], axis=0).min())
            steps = np.unique(np.concatenate([np.geomspace(0.05 * least, max(reach, least), 24)]))
            steps = np.unique(np.concatenate([steps, np.arange(0.2 * least, reach, max(0.2 * least, reach / 60))]))
            self.known[key] = all(
                self._is_clear(self.solids[part].translate(tuple(float(x) for x in t * direction)), part, other)
                for t in steps
            )
        return self.known[key]

    def _is_clear(self, moved, part: int, other: int) -> bool:
        """Whether a moved part shares nothing with another, or a body so thin that the verifier allows it."""
        extra = self._overlap(moved, part, other)
        if extra <= NOTHING:
            return True
        if self.shared[part, other] > NOTHING * min(self.volumes[part], self.volumes[other]):
            return extra <= SHARE
        low, high = np.array((moved ^ self.solids[other]).bounding_box()).reshape(2, 3)
        least = min(float(np.ptp(self.boxes[k], axis=0).min()) for k in (part, other))
        return float((high - low).min()) <= TOLERANCE * least

    def _overlap(self, moved, part: int, other: int) -> float:
        """Shared volume beyond the assembled pose's, over the smaller part's."""
        box = np.array(moved.bounding_box()).reshape(2, 3)
        if (box[0] >= self.boxes[other][1]).any() or (box[1] <= self.boxes[other][0]).any():
            return 0.0
        pair = (part, other)
        if pair not in self.shared:
            self.shared[pair] = (self.solids[part] ^ self.solids[other]).volume()
        extra = (moved ^ self.solids[other]).volume() - self.shared[pair]
        return extra / min(self.volumes[part], self.volumes[other])

    def _directions(self, part) -> np.ndarray:
        k = np.arange(SPHERE) + 0.5
        z, angle = 1.0 - 2.0 * k / SPHERE, np.pi * (1.0 + np.sqrt(5.0)) * k
        sphere = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
        corners = part.vertices_world[part.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = normals[np.linalg.norm(normals, axis=1) > 1e-12]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.unique(np.round(np.concatenate([normals, -normals, np.eye(3), -np.eye(3)]), 6), axis=0)
        return np.concatenate([normals, sphere])


def solid(part) -> manifold3d.Manifold:
    """Return a part in place as an exact solid."""
    return manifold3d.Manifold(
        manifold3d.Mesh64(np.array(part.vertices_world, np.float64), np.array(part.faces, np.uint64))
    )


if __name__ == "__main__":
    main()

"""A contact for each step: two fingertips that grasp the part, or one that pushes it, clear of what is fixed.

Fingertips are spheres at the contact points, as in the paper's figures. A fingertip must be clear of the fixed parts
along the insertion, and have room to come straight off the surface at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.contact import ContactConfig
from sashimono.contact.candidates import GraspCandidates, congruence, find_candidates
from sashimono.contact.gripper import proportionate_gripper
from sashimono.geometry import se3
from sashimono.geometry.body import Body


@dataclass(frozen=True, kw_only=True)
class FingertipConfig:
    """How contacts are chosen."""

    contact: ContactConfig = field(default_factory=lambda: ContactConfig(samples=96))
    """Level 3's options: friction, samples of the surface."""
    radius: float = 0.2
    """Radius of a fingertip over the part's middle extent."""
    most_radius: float = 0.004
    """Largest radius of a fingertip [m]."""
    approach: float = 2.0
    """Way straight off the surface that must be clear, in radii."""
    poses: int = 6
    """Poses looked at on each leg of the insertion, close to its end closest together."""
    max_candidates: int = 40
    """Contacts looked at, the best first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StepContact:
    """Where a part is held or pushed, in its own frame."""

    kind: Literal["grasp", "push"]
    points: Float[np.ndarray, "contact 3"]
    """Contact points [m]."""
    normals: Float[np.ndarray, "contact 3"]
    """Unit inward normals of the surface there."""


class ContactFinder:
    """Finds contacts for the steps of one assembly; identical parts share their candidates."""

    def __init__(
        self, assembly: Assembly, bodies: Sequence[Body], *, config: FingertipConfig, rng: np.random.Generator
    ) -> None:
        self._assembly, self._bodies, self._config = assembly, bodies, config
        self._streams = rng.spawn(len(assembly))
        self._candidates: dict[int, GraspCandidates] = {}

    def find(self, part: int, fixed: Sequence[int], poses: Float[np.ndarray, "waypoint 4 4"]) -> StepContact | None:
        """Return a contact with which a part can be inserted among fixed ones, or None.

        Args:
            part: The part that moves.
            fixed: The parts that are placed.
            poses: ``T_world_part`` along the insertion, the assembled pose last.
        """
        tips = _Tips(self._bodies[part], poses, [self._seen(k) for k in fixed], self._config)
        candidates = self._of(part)
        for k, _ in candidates.ranked()[: self._config.max_candidates]:
            points, normals = candidates.pairs.points[k], candidates.pairs.normals[k]
            if tips.are_clear(points, normals) and candidates.quality(k) > 0.0:
                return StepContact(kind="grasp", points=points, normals=normals)
        return self._push(part, poses, tips)

    def _push(self, part: int, poses: Float[np.ndarray, "waypoint 4 4"], tips: _Tips) -> StepContact | None:
        """A point whose friction cone holds the direction of travel, on a line near the centre of mass."""
        body = self._bodies[part]
        travel = poses[-1][:3, :3].T @ (poses[-1][:3, 3] - poses[-2][:3, 3])
        length = float(np.linalg.norm(travel))
        if length == 0.0:
            return None
        travel /= length
        inward = -body.sample_normals
        held = np.flatnonzero(inward @ travel >= 1.0 / np.hypot(1.0, self._config.contact.tangential_friction))
        arm = np.linalg.norm(np.cross(body.samples[held] - body.mass_center, travel), axis=1)
        for k in held[np.argsort(np.round(arm, 9), kind="stable")][: self._config.max_candidates]:
            if tips.are_clear(body.samples[k : k + 1], inward[k : k + 1]):
                return StepContact(kind="push", points=body.samples[k : k + 1], normals=inward[k : k + 1])
        return None

    def _seen(self, k: int) -> tuple[Body, Float[np.ndarray, "4 4"]]:
        return self._bodies[k], self._assembly.parts[k].T_world_part

    def _of(self, part: int) -> GraspCandidates:
        if part not in self._candidates:
            self._candidates[part] = self._from_twin(part) or self._found(part)
        return self._candidates[part]

    def _found(self, part: int) -> GraspCandidates:
        body = self._bodies[part]
        return find_candidates(
            self._assembly.parts[part],
            body,
            gripper=proportionate_gripper(body, room=4.0 * float(body.extents[2] / body.extents[1])),
            config=self._config.contact,
            rng=self._streams[part],
        )

    def _from_twin(self, part: int) -> GraspCandidates | None:
        moving = self._assembly.parts[part]
        for other, candidates in self._candidates.items():
            if _are_twins(self._assembly, moving, self._assembly.parts[other]):
                T = congruence(self._assembly.parts[other], moving)
                if T is not None:
                    return candidates.moved(T)
        return None


class _Tips:
    """Whether fingertips on one part are clear of its surroundings along one insertion."""

    def __init__(
        self,
        body: Body,
        poses: Float[np.ndarray, "waypoint 4 4"],
        fixed: Sequence[tuple[Body, Float[np.ndarray, "4 4"]]],
        config: FingertipConfig,
    ) -> None:
        self._body, self._config = body, config
        self._radius = min(config.radius * float(body.extents[1]), config.most_radius)
        self._poses = _along(poses, config.poses)
        self._fixed = [(other, se3.inverse(T)) for other, T in fixed]

    def are_clear(self, points: Float[np.ndarray, "contact 3"], normals: Float[np.ndarray, "contact 3"]) -> bool:
        """Return whether the tips at these contacts touch nothing but the part, there and on the way off."""
        radius = self._radius
        held = points - 1.02 * radius * normals
        off = points - (1.0 + self._config.approach) * radius * normals
        own = np.concatenate([held, off])
        if float(self._body.signed_distance.query(own).min()) < 0.98 * radius:
            return False
        last = self._poses[-1]
        world = np.concatenate([*(se3.apply(T, held) for T in self._poses), se3.apply(last, off)])
        for other, T_other_world in self._fixed:
            seen = se3.apply(T_other_world, world)
            near = ((seen > other.bounds[0] - radius) & (seen < other.bounds[1] + radius)).all(axis=1)
            if near.any() and float(other.signed_distance.query(seen[near]).min()) < radius:
                return False
        return True


def _along(poses: Float[np.ndarray, "waypoint 4 4"], count: int) -> list[np.ndarray]:
    """Poses on each leg, closer together towards its end, the last one last."""
    fractions = 1.0 - (1.0 - np.arange(count) / count) ** 2
    out = []
    for start, stop in pairwise(poses):
        out += [se3.interpolate(start, stop, float(u)) for u in fractions]
    return [*out, poses[-1]]


def _are_twins(assembly: Assembly, a: Part, b: Part) -> bool:
    return any(a.name in names and b.name in names for names in assembly.identical)

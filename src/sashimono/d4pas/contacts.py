"""Contacts of one blueprint by level 3: a grasp or push for each step, and which parts must be gone for one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.contact import ContactConfig
from sashimono.contact.candidates import congruence
from sashimono.contact.contact_blockers import ContactBlockers
from sashimono.contact.tip_contact import TipGrasps, choose_push, find_tip_grasps
from sashimono.disassembly.conditions.clauses import Clause
from sashimono.disassembly.masks import bits
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Segment


@dataclass(frozen=True, kw_only=True, eq=False)
class StepContact:
    """Where a part is held or pushed, in its own frame."""

    kind: Literal["grasp", "push"]
    points: Float[np.ndarray, "contact 3"]
    """Contact points [m]."""
    normals: Float[np.ndarray, "contact 3"]
    """Unit inward normals of the surface there."""
    radius: float
    """Of the fingertips [m]."""
    begins: float
    """Pose of the way, with a fraction, from which on the contact acts; a grasp acts all along."""


class ContactFinder:
    """Finds contacts for the removals of one assembly; identical parts share their grasps."""

    def __init__(
        self, assembly: Assembly, bodies: Mapping[str, Body], *, config: ContactConfig, rng: np.random.Generator
    ) -> None:
        self._assembly, self._config = assembly, config
        self._bodies = [bodies[name] for name in assembly.names]
        self._streams = rng.spawn(len(assembly))
        self._grasps: dict[int, TipGrasps] = {}
        self._found: dict[tuple[int, int], ContactBlockers] = {}

    def executable(self, part: int, clauses: Sequence[Clause]) -> list[int]:
        """Return the minimal masks of parts that must be gone so that some contact moves the part.

        Args:
            part: The part.
            clauses: Its removal conditions, with their motions.
        """
        masks = {clause.blockers | met for clause in clauses for met in self._blockers(part, clause).minimal()}
        kept: list[int] = []
        for mask in sorted(masks, key=lambda mask: (mask.bit_count(), mask)):
            if all(other & ~mask for other in kept):
                kept.append(mask)
        return kept

    def find(self, part: int, placed: int, clause: Clause) -> StepContact | None:
        """Return the contact with which a part goes in among the placed ones (a mask) by a clause's motion, or None."""
        chosen = self._blockers(part, clause).best(placed)
        if chosen is not None:
            radius = self._of(part).tips(chosen.scale).radius
            return StepContact(
                kind=chosen.kind, points=chosen.points, normals=chosen.normals, radius=radius, begins=0.0
            )
        motion, fixed = self._motion(part, clause), [self._obstacle(k) for k in bits(placed)]
        options = {"body": self._bodies[part], "grasps": self._of(part), "config": self._config}
        push = choose_push(motion, fixed, None, **options)
        if push is None:
            return None
        return StepContact(
            kind="push",
            points=push.points_part,
            normals=push.normals_part,
            radius=push.details["fingertips"]["radius"],
            begins=push.details["from_pose"],
        )

    def _blockers(self, part: int, clause: Clause) -> ContactBlockers:
        key = (part, clause.blockers)
        if key not in self._found:
            gone = clause.blockers | 1 << part
            others = {k: self._obstacle(k) for k in range(len(self._bodies)) if not gone >> k & 1}
            self._found[key] = ContactBlockers(
                self._motion(part, clause), others, body=self._bodies[part], grasps=self._of(part), config=self._config
            )
        return self._found[key]

    def _motion(self, part: int, clause: Clause) -> Motion:
        poses = clause.removal.displacements[::-1] @ self._assembly.parts[part].T_world_part
        return Motion(T_world_part=poses, segments=(Segment(kind="insertion", start=0, stop=len(poses) - 1),))

    def _obstacle(self, k: int) -> Obstacle:
        return Obstacle(body=self._bodies[k], T_world_part=self._assembly.parts[k].T_world_part)

    def _of(self, part: int) -> TipGrasps:
        if part not in self._grasps:
            self._grasps[part] = self._from_twin(part) or find_tip_grasps(
                self._assembly.parts[part], self._bodies[part], config=self._config, rng=self._streams[part]
            )
        return self._grasps[part]

    def _from_twin(self, part: int) -> TipGrasps | None:
        moving = self._assembly.parts[part]
        for other, grasps in self._grasps.items():
            twin = self._assembly.parts[other]
            if any(moving.name in names and twin.name in names for names in self._assembly.identical):
                T = congruence(twin, moving)
                if T is not None:
                    return grasps.moved(T, self._bodies[part])
        return None

"""Which parts must be gone for a contact: the paper's ``isExec`` as conditions, for every set of parts at once.

A grasp that is clear among some parts is clear among fewer, so the parts that its fingertips meet on the way out say
all about it. The same holds for a push through the centre of mass, which needs nothing to lean on. Pushes that lean on
the parts around are left out: fewer of those can be worse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.contact.config import ContactConfig
from sashimono.contact.fingertips import Passage, clear_of_itself
from sashimono.contact.samples import cast, steady
from sashimono.contact.tip_contact import TipGrasps
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion

_STRAIGHT = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockedContact:
    """A contact of a part, and what its fingertips meet along one motion."""

    kind: Literal["grasp", "push"]
    points: Float[np.ndarray, "contact 3"]
    """In the part's frame [m]."""
    normals: Float[np.ndarray, "contact 3"]
    """Unit inward normals of the surface there."""
    scale: float
    """Of the fingertips, over their usual radius."""
    grasp: int | None
    """Index in the part's grasps."""
    met: int
    """Mask of the parts that a fingertip meets on the way, or while it comes off the part at either end of it."""


class ContactBlockers:
    """The contacts of one part along one motion, with what each of them meets."""

    def __init__(
        self,
        motion: Motion,
        others: Mapping[int, Obstacle],
        *,
        body: Body,
        grasps: TipGrasps,
        config: ContactConfig,
        most: int = 64,
    ) -> None:
        """Look at grasps and pushes, tips as large as possible; smaller ones where every contact meets something.

        Args:
            motion: The part's way among the others.
            others: By part, what could be met.
            body: The part that moves.
            grasps: Its grasps.
            config: Options of level 3.
            most: Grasps looked at with tips of one size, those of best bounds.
        """
        self._grasps, self._config = grasps, config
        self._passage = Passage(body, motion, list(others.values()), None, config)
        self._weights = [1 << k for k in others]
        self._body = body
        self.contacts: list[BlockedContact] = []
        pushes = central_pushes(motion, body, config)
        for scale in config.tip_scales:
            found = [*self._grasped(scale, most), *self._pushed(scale, *pushes)]
            self.contacts += found
            if not all(entry.met for entry in found if entry.kind == "grasp") and self._holds(found):
                break

    def best(self, placed: int) -> BlockedContact | None:
        """Return the best contact that meets none of the placed parts (a mask), or None.

        Grasps come before pushes, large tips before small ones, then quality counts.
        """
        clear = [entry for entry in self.contacts if not entry.met & placed]
        for scale in self._config.tip_scales:
            grasps = [entry for entry in clear if entry.scale == scale and entry.kind == "grasp"]
            shortlist = grasps[: self._config.shortlist]
            rated = [(self._quality(entry), -k) for k, entry in enumerate(shortlist)]
            if rated and max(rated)[0] > 0.0:
                return shortlist[-max(rated)[1]]
        return next((entry for entry in clear if entry.kind == "push"), None)

    def minimal(self) -> list[int]:
        """Return the minimal masks of parts that must be gone so that some contact is clear and holds the part."""
        kept: list[int] = []
        for entry in sorted(self.contacts, key=lambda entry: (entry.met.bit_count(), -entry.scale)):
            if all(mask & ~entry.met for mask in kept) and self._quality(entry) > 0.0:
                kept.append(entry.met)
        return kept

    def _quality(self, entry: BlockedContact) -> float:
        return 1.0 if entry.grasp is None else self._grasps.graded(entry.scale).quality(entry.grasp)

    def _holds(self, found: Sequence[BlockedContact]) -> bool:
        return any(not entry.met and self._quality(entry) > 0.0 for entry in found)

    def _grasped(self, scale: float, most: int) -> list[BlockedContact]:
        pairs = self._grasps.pairs
        if not len(pairs):
            return []
        itself = self._grasps.clear_of_itself(scale)
        order = [k for k, bound in self._grasps.graded(scale).ranked() if itself[k] and bound > 0.0][:most]
        met = self._met(pairs.points[order], pairs.normals[order], scale)
        return [
            BlockedContact(kind="grasp", points=pairs.points[k], normals=pairs.normals[k], scale=scale, grasp=k, met=m)
            for k, m in zip(order, met, strict=True)
        ]

    def _pushed(self, scale: float, points: np.ndarray, normals: np.ndarray) -> list[BlockedContact]:
        tips = self._grasps.tips(scale)
        clear = clear_of_itself(self._body, points, normals, tips, self._config.tip_slack)
        points, normals = points[clear][:, None], normals[clear][:, None]
        return [
            BlockedContact(kind="push", points=p, normals=n, scale=scale, grasp=None, met=m)
            for p, n, m in zip(points, normals, self._met(points, normals, scale), strict=True)
        ]

    def _met(self, points: np.ndarray, normals: np.ndarray, scale: float) -> list[int]:
        """Mask of what each contact's tips meet; points are (contact, tip, 3)."""
        tips, shape = self._grasps.tips(scale), (*points.shape[:2], len(self._weights))
        points, normals = np.ascontiguousarray(points.reshape(-1, 3)), normals.reshape(-1, 3)
        hits = self._passage.hits(points - tips.radius * normals, -tips.approach * normals, tips.radius)
        rows = np.logical_or.reduce(hits.reshape(shape), axis=1)
        return [sum(w for w, hit in zip(self._weights, row, strict=True) if hit) for row in rows]


def central_pushes(
    motion: Motion, body: Body, config: ContactConfig
) -> tuple[Float[np.ndarray, "push 3"], Float[np.ndarray, "push 3"]]:
    """Return where, and along which inward normals, a finger can push a part straight along all of its way.

    They lie on the line through the centre of mass along the way, so that the push alone balances what resists it.
    There are none if the way is not straight, or at surfaces that it would slip off.
    """
    poses = motion.T_world_part
    twists = np.array([se3.log(se3.inverse(a) @ b) for a, b in pairwise(poses)])
    lengths = np.linalg.norm(twists, axis=1)
    none = np.zeros((0, 3)), np.zeros((0, 3))
    if not len(twists) or not lengths.sum() > 0.0:
        return none
    ways = twists[lengths > 0.0] / lengths[lengths > 0.0, None]
    way = ways[0, :3]
    if np.abs(ways[:, 3:]).max() * body.radius > _STRAIGHT or (ways[:, :3] @ way).min() < 1.0 - _STRAIGHT:
        return none
    points, normals = [], []
    start, left = body.mass_center - 2.0 * body.radius * way, 4.0 * body.radius
    while left > 0.0:
        distance, outward = cast(body, start[None], way[None], side="entering")
        if not float(distance[0]) < left:
            break
        points.append(start + distance[0] * way)
        normals.append(-outward[0])
        step = float(distance[0]) + 1e-6 * body.radius
        start, left = start + step * way, left - step
    if not points:
        return none
    found, inward = np.array(points), np.array(normals)
    held = (inward @ way >= 1.0 / math.hypot(1.0, config.tangential_friction)) & steady(body, found, inward)
    return found[held], inward[held]

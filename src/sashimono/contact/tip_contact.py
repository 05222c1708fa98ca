"""A contact for one step with fingertips: a grasp all the way, a grasp that takes over, or a push at the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Part
from sashimono.contact.antipodal import GraspPairs, antipodal_pairs
from sashimono.contact.candidates import GraspCandidates
from sashimono.contact.cone_program import Pushes, least_pushes
from sashimono.contact.config import ContactConfig
from sashimono.contact.fingertips import Fingertips, Passage, clear_of_itself, fingertips_for
from sashimono.contact.push import find_supports, scaled, wanted_wrench
from sashimono.contact.samples import main_lines, sample_contacts, steady, steady_pairs
from sashimono.geometry.body import Body
from sashimono.geometry.mesh import measures
from sashimono.motion.scene import Obstacle
from sashimono.plan import Contact, Motion, Table

_CHUNK = 48


class TipChoice(NamedTuple):
    """What holds the part at the end of its way, what brings it there if that is something else, and why not."""

    contact: Contact | None
    carry: Contact | None
    reason: str | None


class TipGrasps:
    """The fingertip grasps of one part, before anything around it is looked at."""

    def __init__(
        self,
        body: Body,
        pairs: GraspPairs,
        *,
        center: Float[np.ndarray, "3"],
        radius: float,
        lines: Float[np.ndarray, "line 3"],
        config: ContactConfig,
    ) -> None:
        self.pairs, self.center, self.radius = pairs, center, radius
        self._body, self._lines, self._config = body, lines, config
        self._graded: dict[float, GraspCandidates[Fingertips]] = {}
        self._itself: dict[float, np.ndarray] = {}

    def graded(self, scale: float) -> GraspCandidates[Fingertips]:
        """Return the grasps with tips of this scale, with their qualities."""
        if scale not in self._graded:
            self._graded[scale] = GraspCandidates(
                self.pairs,
                gripper=self.tips(scale),
                center=self.center,
                radius=self.radius,
                lines=self._lines,
                config=self._config,
            )
        return self._graded[scale]

    def tips(self, scale: float) -> Fingertips:
        """Return the tips of this scale."""
        return fingertips_for(self._body, self._config, scale)

    def clear_of_itself(self, scale: float) -> np.ndarray:
        """Return which grasps touch the part at their two points only."""
        if scale not in self._itself:
            flags = clear_of_itself(
                self._body,
                self.pairs.points.reshape(-1, 3),
                self.pairs.normals.reshape(-1, 3),
                self.tips(scale),
                self._config.tip_slack,
            )
            first, second = flags.reshape(-1, 2).T
            self._itself[scale] = first & second
        return self._itself[scale]

    def moved(self, T: Float[np.ndarray, "4 4"], body: Body) -> TipGrasps:
        """Return the same grasps for an identical part: T takes this part's points to that part's."""
        R = T[:3, :3]
        out = TipGrasps(
            body,
            replace(self.pairs, points=self.pairs.points @ R.T + T[:3, 3], normals=self.pairs.normals @ R.T),
            center=R @ self.center + T[:3, 3],
            radius=self.radius,
            lines=self._lines @ R.T,
            config=self._config,
        )
        out._itself = self._itself
        out._graded = {scale: grasps.moved(T) for scale, grasps in self._graded.items()}
        return out


def find_tip_grasps(part: Part, body: Body, *, config: ContactConfig, rng: np.random.Generator) -> TipGrasps:
    """Return the distinct antipodal grasps of a part, contacts near an edge left out."""
    center = body.mass_center
    radius = measures.radius(part.vertices_part, center)
    lines = main_lines(part.vertices_part, part.faces, config)
    sampling = replace(config, samples=config.tip_samples)
    samples = sample_contacts(part.vertices_part, part.faces, body, lines, center=center, config=sampling, rng=rng)
    pairs = antipodal_pairs(samples, body, max_opening=np.inf, center=center, radius=radius, config=config)
    if len(pairs):
        kept = steady_pairs(body, pairs.points, pairs.normals)
        pairs = replace(pairs, points=pairs.points[kept], normals=pairs.normals[kept])
    return TipGrasps(body, pairs, center=center, radius=radius, lines=lines, config=config)


def choose_tip_contact(
    motion: Motion,
    fixed: Sequence[Obstacle],
    resting: Sequence[Obstacle],
    table: Table | None,
    *,
    body: Body,
    grasps: TipGrasps,
    config: ContactConfig,
) -> TipChoice:
    """Return the contact of one step with fingertips, or why there is none.

    Tried in turn: a grasp whose tips are clear all the way, with tips as large as possible; a grasp clear on the last
    insertion, with another one that carries the part up to there; a push along the end of the way, likewise.
    """
    search = _Search(motion, fixed, resting, table, body=body, grasps=grasps, config=config)
    scales = config.tip_scales if len(grasps.pairs) else ()
    for scale in scales:
        if contact := search.grasp(scale, 0, search.passage.last):
            return TipChoice(contact, None, None)
    start = search.insertion_start
    for scale in scales:
        if 0 < start < search.passage.last and (contact := search.grasp(scale, start, search.passage.last)):
            return TipChoice(contact, search.carry(start), None)
    for scale in config.tip_scales:
        if found := search.push(scale):
            contact, start = found
            return TipChoice(contact, search.carry(start) if start > 0 else None, None)
    return TipChoice(None, None, search.reason())


def choose_push(
    motion: Motion,
    fixed: Sequence[Obstacle],
    table: Table | None,
    *,
    body: Body,
    grasps: TipGrasps,
    config: ContactConfig,
) -> Contact | None:
    """Return the push of least force along the end of one step's way, with tips as large as possible, or None."""
    search = _Search(motion, fixed, (), table, body=body, grasps=grasps, config=config)
    return next((found[0] for scale in config.tip_scales if (found := search.push(scale))), None)


class _Search:
    """One step's search; what is clear is worked out once for each size of tips."""

    def __init__(
        self,
        motion: Motion,
        fixed: Sequence[Obstacle],
        resting: Sequence[Obstacle],
        table: Table | None,
        *,
        body: Body,
        grasps: TipGrasps,
        config: ContactConfig,
    ) -> None:
        self._motion, self._fixed, self._table = motion, fixed, table
        self._body, self._grasps, self._config = body, grasps, config
        self.passage = Passage(body, motion, [*fixed, *resting], table, config)
        first = motion.segments[-1].start if motion.segments else 0
        self.insertion_start = int(np.searchsorted(self.passage.path.parameter, first - 1e-9))
        self._pushes: Pushes | None = None
        self._tried = 0
        self._clear_pushes = 0

    def grasp(self, scale: float, start: int, stop: int) -> Contact | None:
        """Return the best grasp that is clear from one index of the dense path to another, ways off included."""
        grasps, config = self._grasps, self._config
        tips, graded, itself = grasps.tips(scale), grasps.graded(scale), grasps.clear_of_itself(scale)
        order = [k for k, bound in graded.ranked() if itself[k] and bound > 0.0]
        found: list[int] = []
        for begin in range(0, len(order), _CHUNK):
            chunk = np.array(order[begin : begin + _CHUNK])
            points, normals = grasps.pairs.points[chunk], grasps.pairs.normals[chunk]
            clear = self._clear(points.reshape(-1, 3), normals.reshape(-1, 3), tips, start, stop)
            found += chunk[clear.reshape(-1, 2).all(axis=1)].tolist()
            if len(found) >= config.shortlist:
                break
        self._tried += len(order)
        rated = [(graded.quality(k), -i, k) for i, k in enumerate(found[: config.shortlist])]
        rated = [entry for entry in rated if entry[0] > 0.0]
        if not rated:
            return None
        quality, _, k = max(rated)
        return Contact(
            kind="grasp",
            points_part=grasps.pairs.points[k],
            normals_part=grasps.pairs.normals[k],
            friction=config.friction,
            quality=quality,
            details={"contact_model": "soft finger", "candidates": len(order), **self._details(tips, start, stop)},
        )

    def carry(self, stop: int) -> Contact | None:
        """Return a grasp that brings the part from its resting pose up to this index."""
        scales = self._config.tip_scales if len(self._grasps.pairs) else ()
        return next((contact for scale in scales if (contact := self.grasp(scale, 0, stop))), None)

    def _clear(self, points: np.ndarray, normals: np.ndarray, tips: Fingertips, start: int, stop: int) -> np.ndarray:
        passage = self.passage
        centers, ways = points - tips.radius * normals, -tips.approach * normals
        left = np.arange(len(points))
        for index in {stop, start}:
            kept = passage.clear_way_off(centers[left], ways[left], tips.radius, index)
            left = left[kept]
        if stop == passage.last:
            left = left[passage.clear_from(centers[left], tips.radius) <= start]
        else:
            left = left[passage.clear_until(centers[left], tips.radius) >= stop]
        clear = np.zeros(len(points), dtype=np.bool_)
        clear[left] = True
        return clear

    def _details(self, tips: Fingertips, start: int, stop: int) -> dict[str, Any]:
        where = self.passage.path.parameter
        return {
            "friction_cone": self._config.friction_cone,
            "fingertips": {"radius": tips.radius, "patch_radius": tips.patch_radius, "approach": tips.approach},
            "from_pose": float(where[start]),
            "to_pose": float(where[stop]),
        }

    def push(self, scale: float) -> tuple[Contact, int] | None:
        """Return the push of least force that is clear along the end of the way, and where on the path it begins."""
        config, body, passage = self._config, self._body, self.passage
        tips = self._grasps.tips(scale)
        points, normals = self._push_points()
        pushes = self._balanced(points, normals)
        chosen = np.flatnonzero(pushes.feasible)
        chosen = chosen[clear_of_itself(body, points[chosen], normals[chosen], tips, config.tip_slack)]
        centers, ways = points[chosen] - tips.radius * normals[chosen], -tips.approach * normals[chosen]
        chosen_from = passage.clear_from(centers, tips.radius)
        # the push may begin with the insertion; at the latest so that it drives the part by a tip's radius
        latest = int(np.searchsorted(passage.path.length, passage.path.length[-1] - tips.radius, side="right")) - 1
        latest = max(latest, self.insertion_start)
        good = (chosen_from <= latest) & passage.clear_way_off(centers, ways, tips.radius, passage.last)
        self._clear_pushes = max(self._clear_pushes, int(good.sum()))
        force = np.linalg.norm(pushes.forces[chosen], axis=1)
        for i in np.flatnonzero(good)[np.argsort(np.round(force[good], 9), kind="stable")]:
            start = max(int(chosen_from[i]), self.insertion_start)
            if not passage.clear_way_off(centers[i : i + 1], ways[i : i + 1], tips.radius, start).all():
                continue
            k = int(chosen[i])
            contact = Contact(
                kind="push",
                points_part=points[k : k + 1],
                normals_part=normals[k : k + 1],
                friction=config.friction,
                quality=0.0,
                force_part=pushes.forces[k : k + 1],
                details={
                    "contact_model": "point with friction",
                    **self._details(tips, start, passage.last),
                    **self._balance_details(pushes, k),
                },
            )
            return contact, start
        return None

    def _balance_details(self, pushes: Pushes, k: int) -> dict[str, Any]:
        return {
            "density": self._config.density,
            "drive": self._config.drive,
            "wrench": self._wrench.tolist(),
            "torque_about": self._body.mass_center.tolist(),
            "residual": float(pushes.residuals[k]),
            "supports": {
                "parts": list(self._supports.parts),
                "points_part": self._supports.points.tolist(),
                "normals_part": self._supports.normals.tolist(),
                "forces_part": pushes.reactions[k].tolist(),
                "gap": self._config.support_gap * self._body.smallest_extent,
            },
        }

    def _push_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Surface points, those first at which a finger pushes the way the part goes, nearest to its centre's line."""
        body = self._body
        points, normals = body.samples, -body.sample_normals
        wrench, _ = wanted_wrench(body, self._motion, None, self._grasps.radius, self._config)
        size = float(np.linalg.norm(wrench[:3]))
        way = wrench[:3] / size if size > 0.0 else np.zeros(3)
        along = normals @ way
        arm = np.linalg.norm(np.cross(points - body.mass_center, way), axis=1) / self._grasps.radius
        rank = np.argsort(np.round(0.25 * arm - along, 9), kind="stable")[: 2 * self._config.push_points]
        rank = rank[steady(body, points[rank], normals[rank])][: self._config.push_points]
        return points[rank], normals[rank]

    def _balanced(self, points: np.ndarray, normals: np.ndarray) -> Pushes:
        """Equation (1) for all points; the same for every size of tips, so worked out once."""
        if self._pushes is None:
            body, config, radius = self._body, self._config, self._grasps.radius
            T = self._motion.T_world_part[-1]
            self._wrench, _ = wanted_wrench(body, self._motion, self._table, radius, config)
            self._supports = find_supports(body, T, self._fixed, config)
            unit = np.concatenate([self._wrench[:3], self._wrench[3:] / radius])
            friction = config.tangential_friction
            self._pushes = least_pushes(
                scaled(points, normals, body.mass_center, radius),
                scaled(self._supports.points, self._supports.normals, body.mass_center, radius),
                unit,
                friction=friction,
                support_friction=friction,
            )
        return self._pushes

    def reason(self) -> str:
        """Return in plain words why there is no contact."""
        pushes = self._pushes
        balanced = 0 if pushes is None else int(pushes.feasible.sum())
        total = 0 if pushes is None else len(pushes.feasible)
        if len(self._grasps.pairs) == 0:
            told = "no antipodal pair among the surface samples"
        else:
            told = f"{len(self._grasps.pairs)} grasps, none clear of what is around"
        return f"{told}; {balanced} of {total} pushes balance, {self._clear_pushes} of them clear"

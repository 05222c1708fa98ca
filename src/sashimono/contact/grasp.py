"""Level 3: where a robot holds each part on its way."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies, make_body
from sashimono.contact.access import Access
from sashimono.contact.candidates import GraspCandidates, congruence, find_candidates
from sashimono.contact.config import ContactConfig
from sashimono.contact.gripper import FingertipTool, Gripper, Tool, proportionate_gripper
from sashimono.contact.suction import SuctionCup, why_no_suction
from sashimono.contact.tip_contact import TipGrasps, choose_tip_contact, find_tip_grasps
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Contact, Motion, Table

logger = logging.getLogger(__name__)

BASE_REASON = "base part: starts in place"


class ContactChoice(NamedTuple):
    """A contact, or the reason why there is none."""

    contact: Contact | None
    reason: str | None
    carry: Contact | None = None
    """The grasp that brings the part to where ``contact`` takes over; None if that holds it all the way."""
    grippers: Mapping[str, str | None] = {}
    """Of the grippers asked about: None for one that can take the part all the way, else why it cannot."""


def choose_contact(
    part: Part,
    motion: Motion,
    obstacles: Sequence[Obstacle],
    table: Table | None,
    *,
    gripper: Gripper,
    config: ContactConfig,
    rng: np.random.Generator,
    body: Body | None = None,
    candidates: GraspCandidates[Gripper] | None = None,
) -> ContactChoice:
    """Return the best grasp with which the gripper reaches, carries and lets go of the part, or why there is none.

    It has the highest Ferrari-Canny quality of those whose gripper is clear of everything in one of several
    approach directions; the search goes in descending order of an upper bound of it. Checked are: the part itself;
    release at the assembled pose and pick-up at the resting pose, opening and straight retreat included, both
    as exact sweeps; the motion in between, at poses close together.

    Args:
        part: What is held.
        motion: Its path, from the resting to the assembled pose.
        obstacles: What stands still: fixed parts in their assembled, resting parts in their resting poses.
        table: The plane on which parts rest; None for none.
        gripper: What holds the part.
        config: Options.
        rng: Draws the surface samples.
        body: Of the part; made here if None.
        candidates: Of the part and this gripper; found here if None.
    """
    if body is None:
        body = make_body(part)
    if candidates is None:
        candidates = find_candidates(part, body, gripper=gripper, config=config, rng=rng, off_edges=True)
    if len(candidates) == 0:
        return ContactChoice(None, _no_pair_reason(candidates))
    access = Access(body, motion, obstacles, table, gripper, config)
    best: tuple[float, int, Float[np.ndarray, "4 4"]] | None = None
    checked = 0
    for k, bound in candidates.ranked():
        if checked == config.max_candidates or bound <= (best[0] if best else 0.0):
            break
        # a hull costs more than a few collision checks: no exact quality until one grasp has passed them
        if best and candidates.quality(k) <= best[0]:
            continue
        checked += 1
        T_part_gripper = access.first_clear(candidates.opening(k), candidates.approaches(k))
        if T_part_gripper is not None and candidates.quality(k) > 0.0:
            best = (candidates.quality(k), k, T_part_gripper)
    if best is None:
        return ContactChoice(None, access.reason(len(candidates), checked))
    return ContactChoice(_contact(candidates, best[1], best[2], access, checked), None)


def choose_contacts(
    assembly: Assembly,
    order: Sequence[str],
    motions: Mapping[str, Motion],
    table: Table | None,
    *,
    gripper: Tool,
    config: ContactConfig,
    rng: np.random.Generator,
    bodies: Mapping[str, Body] | None = None,
    simultaneous: Mapping[str, Sequence[str]] = MappingProxyType({}),
    report: Sequence[Gripper | SuctionCup] = (),
    progress: Callable[[str], object] | None = None,
) -> dict[str, ContactChoice]:
    """Return the contact of each part in an assembly order (base part first), or why it has none.

    `FINGERTIPS` asks for two balls that can hold the part, else one that can push it home (`choose_tip_contact`);
    ``gripper=None`` takes one in proportion to each part (`proportionate_gripper`). For the tools in ``report`` it is
    said besides whether each can take the part all the way, looking at ``config.report_candidates`` grasps.
    Parts without a motion are neither held nor in the way. Identical parts share their candidates.

    Args:
        assembly: Parts in their assembled poses.
        order: Assembly order, base part first.
        motions: Of each part that has one, from level 2.
        table: The plane on which parts rest; None for none.
        gripper: What holds the parts; None for jaws in proportion to each.
        config: Options.
        rng: Draws the surface samples.
        bodies: Those of level 2, to share them; made here if None.
        simultaneous: Of a part, those that go in at the same time. No contact is looked for: the grippers would pass
            each other.
        report: Further tools of which it is said whether they can take each part.
        progress: Called with the name of each part when it is done.
    """
    if bodies is None:
        bodies = make_bodies(assembly)
    choosers = [_Chooser(assembly, bodies, tool, config, rng) for tool in (gripper, *report)]
    for chooser in choosers[1:]:
        chooser.config = replace(config, max_candidates=config.report_candidates)
    choices: dict[str, ContactChoice] = {}
    moved = [name for name in order if name in motions]
    for name in order:
        if name not in motions:
            choices[name] = ContactChoice(None, "no motion along which to hold the part")
        elif name == order[0] or len(motions[name].T_world_part) == 1:
            choices[name] = ContactChoice(None, BASE_REASON)
        elif name in simultaneous:
            choices[name] = ContactChoice(None, "contacts of what goes in at the same time are not looked for")
        else:
            k = moved.index(name)
            around = (_placed(assembly, moved[:k], bodies), _waiting(moved[k + 1 :], motions, bodies))
            chosen, *others = (chooser(name, motions[name], *around, table) for chooser in choosers)
            said = {tool.name: other.reason for tool, other in zip(report, others, strict=True)}
            choices[name] = chosen._replace(grippers=said)
        logger.debug("contact of %s: %s", name, choices[name].reason or "found")
        if progress is not None:
            progress(name)
    return choices


class _Chooser:
    """Chooses contacts with one tool; identical parts share what was worked out for one of them."""

    def __init__(
        self,
        assembly: Assembly,
        bodies: Mapping[str, Body],
        tool: Tool | SuctionCup,
        config: ContactConfig,
        rng: np.random.Generator,
    ) -> None:
        self._assembly, self._bodies, self._tool, self.config = assembly, bodies, tool, config
        self._streams = dict(zip(assembly.names, rng.spawn(len(assembly)), strict=True))
        self._twins = {name: group for group in assembly.identical for name in group}
        self._jaws: dict[str, GraspCandidates[Gripper]] = {}
        self._tips: dict[str, TipGrasps] = {}

    def __call__(
        self, name: str, motion: Motion, fixed: list[Obstacle], resting: list[Obstacle], table: Table | None
    ) -> ContactChoice:
        """Return the contact of one part among what is placed and what still rests."""
        if isinstance(self._tool, FingertipTool):
            grasps = self._tip_grasps(name)
            options = {"body": self._bodies[name], "grasps": grasps, "config": self.config}
            chosen = choose_tip_contact(motion, fixed, resting, table, **options)
            return ContactChoice(chosen.contact, chosen.reason, carry=chosen.carry)
        if isinstance(self._tool, SuctionCup):
            most = self.config.max_candidates
            options = {"cup": self._tool, "config": self.config, "most": most}
            return ContactChoice(None, why_no_suction(self._bodies[name], motion, fixed + resting, table, **options))
        candidates = self._candidates(name, self._tool)
        return choose_contact(
            self._assembly.part(name),
            motion,
            fixed + resting,
            table,
            gripper=candidates.gripper,
            config=self.config,
            rng=self._streams[name],
            body=self._bodies[name],
            candidates=candidates,
        )

    def _twin(self, name: str, shared: Mapping[str, Any]) -> tuple[str, Float[np.ndarray, "4 4"]] | None:
        for twin in self._twins.get(name, ()):
            if twin in shared and (T := congruence(self._assembly.part(twin), self._assembly.part(name))) is not None:
                return twin, T
        return None

    def _candidates(self, name: str, tool: Gripper | None) -> GraspCandidates[Gripper]:
        if found := self._twin(name, self._jaws):
            return self._jaws[found[0]].moved(found[1])
        body = self._bodies[name]
        jaw = tool or proportionate_gripper(body)
        part, rng = self._assembly.part(name), self._streams[name]
        self._jaws[name] = find_candidates(part, body, gripper=jaw, config=self.config, rng=rng, off_edges=True)
        return self._jaws[name]

    def _tip_grasps(self, name: str) -> TipGrasps:
        body = self._bodies[name]
        if found := self._twin(name, self._tips):
            return self._tips[found[0]].moved(found[1], body)
        part, rng = self._assembly.part(name), self._streams[name]
        self._tips[name] = find_tip_grasps(part, body, config=self.config, rng=rng)
        return self._tips[name]


def _contact(
    candidates: GraspCandidates[Gripper],
    k: int,
    T_part_gripper: Float[np.ndarray, "4 4"],
    access: Access,
    checked: int,
) -> Contact:
    gripper, opening = candidates.gripper, candidates.opening(k)
    return Contact(
        kind="grasp",
        points_part=candidates.pairs.points[k],
        normals_part=candidates.pairs.normals[k],
        friction=access.config.friction,
        quality=candidates.quality(k),
        T_part_gripper=T_part_gripper,
        details={
            "contact_model": "soft finger",
            "friction_cone": access.config.friction_cone,
            "gripper": {**asdict(gripper), "opening": opening, "opened": opening + 2.0 * gripper.margin(opening)},
            "retreat": access.retreat,
            "checked_spacing": dict(access.spacing),
            "candidates": len(candidates),
            "checked": checked,
        },
    )


def _no_pair_reason(candidates: GraspCandidates[Gripper]) -> str:
    opening = f"{candidates.gripper.max_opening * 1e3:.3g} mm opening"
    if candidates.pairs.found == 0:
        return "no antipodal pair among the surface samples"
    return f"no antipodal pair within the {opening} (the narrowest spans {candidates.pairs.narrowest * 1e3:.3g} mm)"


def _placed(assembly: Assembly, names: Sequence[str], bodies: Mapping[str, Body]) -> list[Obstacle]:
    return [Obstacle(body=bodies[name], T_world_part=assembly.part(name).T_world_part) for name in names]


def _waiting(names: Sequence[str], motions: Mapping[str, Motion], bodies: Mapping[str, Body]) -> list[Obstacle]:
    return [Obstacle(body=bodies[name], T_world_part=motions[name].T_world_part[0]) for name in names]

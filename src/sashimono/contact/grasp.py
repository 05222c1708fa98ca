"""Level 3: where a robot holds each part on its way."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies, make_body
from sashimono.contact.access import Access
from sashimono.contact.candidates import GraspCandidates, congruence, find_candidates
from sashimono.contact.clearance import Obstacle
from sashimono.contact.config import ContactConfig
from sashimono.contact.gripper import Gripper, proportionate_gripper
from sashimono.geometry.body import Body
from sashimono.plan import Contact, Motion, Table

logger = logging.getLogger(__name__)

BASE_REASON = "base part: starts in place"


class ContactChoice(NamedTuple):
    """A contact, or the reason why there is none."""

    contact: Contact | None
    reason: str | None


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
    candidates: GraspCandidates | None = None,
) -> ContactChoice:
    """Return the best grasp with which the gripper reaches, carries and lets go of the part, or why there is none.

    It has the highest Ferrari-Canny quality of those whose gripper is clear of everything in one of several
    approach directions; the search goes in descending order of an upper bound of it. Checked are: the part itself;
    release at the assembled pose and pick-up at the resting pose, opening and straight retreat included, both
    as exact sweeps; the motion in between, at poses close together. ``obstacles`` stand still: fixed
    parts in their assembled and resting parts in their resting poses. ``body`` and ``candidates`` (for this
    gripper) may be given to save building them again.
    """
    if body is None:
        body = make_body(part)
    if candidates is None:
        candidates = find_candidates(part, body, gripper=gripper, config=config, rng=rng)
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
    gripper: Gripper | None,
    config: ContactConfig,
    rng: np.random.Generator,
    bodies: Mapping[str, Body] | None = None,
    progress: Callable[[str], object] | None = None,
) -> dict[str, ContactChoice]:
    """Return the contact of each part in an assembly order (base part first), or why it has none.

    ``gripper=None`` takes one in proportion to each part (`proportionate_gripper`). Parts without a motion are
    neither held nor in the way. Identical parts share their candidates. ``bodies`` may be those of level 2;
    ``progress`` is called with the name of each part when it is done.
    """
    if bodies is None:
        bodies = make_bodies(assembly)
    streams = dict(zip(assembly.names, rng.spawn(len(assembly)), strict=True))
    twins = {name: group for group in assembly.identical for name in group}
    shared: dict[str, GraspCandidates] = {}
    choices: dict[str, ContactChoice] = {}
    moved = [name for name in order if name in motions]
    for name in order:
        if name not in motions:
            choices[name] = ContactChoice(None, "no motion along which to hold the part")
        elif name == order[0] or len(motions[name].T_world_part) == 1:
            choices[name] = ContactChoice(None, BASE_REASON)
        else:
            part, body = assembly.part(name), bodies[name]
            candidates = _from_twin(assembly, part, twins.get(name, ()), shared)
            if candidates is None:
                jaw = gripper or proportionate_gripper(body)
                candidates = find_candidates(part, body, gripper=jaw, config=config, rng=streams[name])
                shared[name] = candidates
            choices[name] = choose_contact(
                part,
                motions[name],
                _obstacles(assembly, moved, moved.index(name), motions, bodies),
                table,
                gripper=candidates.gripper,
                config=config,
                rng=streams[name],
                body=body,
                candidates=candidates,
            )
        logger.debug("contact of %s: %s", name, choices[name].reason or "grasp")
        if progress is not None:
            progress(name)
    return choices


def _contact(
    candidates: GraspCandidates,
    k: int,
    T_part_gripper: Float[np.ndarray, "4 4"],
    access: Access,
    checked: int,
) -> Contact:
    gripper, opening = access.gripper, candidates.opening(k)
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


def _no_pair_reason(candidates: GraspCandidates) -> str:
    opening = f"{candidates.gripper.max_opening * 1e3:.3g} mm opening"
    if candidates.pairs.found == 0:
        return "no antipodal pair among the surface samples"
    return f"no antipodal pair within the {opening} (the narrowest spans {candidates.pairs.narrowest * 1e3:.3g} mm)"


def _from_twin(
    assembly: Assembly, part: Part, twins: Sequence[str], shared: Mapping[str, GraspCandidates]
) -> GraspCandidates | None:
    """Candidates of an identical part that has them already, moved to this part's frame."""
    for twin in twins:
        if twin in shared and (T := congruence(assembly.part(twin), part)) is not None:
            return shared[twin].moved(T)
    return None


def _obstacles(
    assembly: Assembly, moved: Sequence[str], k: int, motions: Mapping[str, Motion], bodies: Mapping[str, Body]
) -> list[Obstacle]:
    """Parts placed before the k-th in their assembled, parts after it in their resting poses."""
    placed = [Obstacle(body=bodies[name], T_world_part=assembly.part(name).T_world_part) for name in moved[:k]]
    resting = [Obstacle(body=bodies[name], T_world_part=motions[name].T_world_part[0]) for name in moved[k + 1 :]]
    return placed + resting

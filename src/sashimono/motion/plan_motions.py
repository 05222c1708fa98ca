"""Level 2, composed: table, resting poses, tray, and for each part transit and insertion."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.removal import Removal
from sashimono.geometry.body import Body
from sashimono.motion import table as tables
from sashimono.motion.config import MotionConfig
from sashimono.motion.insertion import Insertion, plan_insertion, sweep_low, whole_insertion
from sashimono.motion.one_motion import Setting, plan_motion
from sashimono.motion.scene import Obstacle, slab_directions
from sashimono.motion.workspace import rest_parts
from sashimono.plan import Answer, Motion, RestingPoses, Table, Unsolved

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionResult:
    """What level 2 found."""

    table: Table
    fixture_height: float
    """How far above the table the base part is held [m]; 0 if it stands on the table."""
    resting: Mapping[str, Float[np.ndarray, "4 4"]]
    """Resting pose of every part in the order but the base."""
    motions: Mapping[str, Motion]
    """By part; the base part and the parts in place have one pose."""
    unsolved: tuple[Unsolved, ...]
    """Parts for which no motion was found, in assembly order."""

    @property
    def complete(self) -> bool:
        """Whether every part has a motion."""
        return not self.unsolved


def plan_motions(
    assembly: Assembly,
    order: Sequence[str],
    removals: Mapping[str, Removal],
    *,
    config: MotionConfig,
    rng: np.random.Generator,
    in_place: Sequence[str] = (),
    simultaneous: Mapping[str, Sequence[str]] = MappingProxyType({}),
    bodies: Mapping[str, Body] | None = None,
    resting: RestingPoses | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> MotionResult:
    """Return a motion from resting to assembled pose for each part that has one.

    Not finding one is an answer: the part is listed in ``unsolved`` with what stood in
    the way. For the parts after it, it counts as resting and as assembled, whichever
    is in the way. Parts that are neither in the order nor in place are left out.

    Args:
        assembly: Parts in assembled poses.
        order: Assembly order, base part first.
        removals: How each part of the order but the base leaves the parts before it.
        config: Options.
        rng: Source of randomness; each part gets its own child, by its index in the assembly.
        in_place: Parts that stand assembled with the base part from the beginning.
        simultaneous: Of a part, those next to it in the order that are inserted at the same time. Each is brought to
            where its insertion begins, which is its whole removal. If one of them has no motion, none has.
        bodies: From `make_bodies`, to share them with other levels; made here if None.
        resting: Table and resting poses from elsewhere; parts that it does not name are laid out beside them.
        progress: Called with (parts done, parts in all).

    Raises:
        KeyError: A name is not in the assembly.
    """
    if bodies is None:
        bodies = {name: body for name, body in make_bodies(assembly).items() if name in {*order, *in_place}}
    assembled = {name: assembly.part(name).T_world_part for name in (*order, *in_place)}
    rngs = rng.spawn(len(assembly))
    base, moving = order[0], [name for name in order[1:] if name not in in_place]
    known = {name: removals[name] for name in moving if name in removals}
    if resting is None:
        normal = tables.choose_normal(bodies[base], assembled[base][:3, :3], known, config.table, config.resting)
    else:
        normal = resting.table.normal
    R_table = tables.frame(normal)
    directions = slab_directions(R_table)

    insertions = _plan_insertions((base, *in_place), moving, known, simultaneous, bodies, assembled, directions, config)
    standing = min(bodies[name].lowest(assembled[name], normal) for name in (base, *in_place))
    if resting is None:
        offset = _table_offset(standing, normal, moving, insertions, bodies, assembled, config)
    else:
        offset = resting.table.offset
    table = Table(normal=normal, offset=offset)
    given = None if resting is None else resting.poses
    rest = rest_parts(moving, bodies, assembled, insertions, table, R_table, config, given)
    setting = Setting(
        bodies=bodies,
        assembled=assembled,
        rest=rest,
        table=table,
        R_table=R_table,
        directions=directions,
        fixture_height=standing - offset,
    )
    motions = {
        name: Motion(T_world_part=assembled[name][None], segments=(), evidence={"fixture_height": standing - offset})
        for name in (base, *in_place)
    }
    unsolved: list[Unsolved] = []
    for k, name in enumerate(moving):
        mates = simultaneous.get(name, ())
        fixed = [n for n in (base, *in_place, *moving[:k]) if n not in mates]
        loose = [n for n in (*(u.part for u in unsolved), *moving[k + 1 :]) if n not in mates]
        meanwhile = {n: insertions[n].poses[0] if n in motions else None for n in mates}
        if name not in insertions:
            answer: Motion | Unsolved = Unsolved(
                part=name, answer=Answer.UNKNOWN, blocked_by=(), reason="no removal motion to reverse"
            )
        else:
            options = {"config": config, "rng": rngs[assembly.index(name)], "simultaneous": meanwhile}
            answer = plan_motion(name, insertions[name], fixed, loose, setting, **options)
        if isinstance(answer, Motion):
            motions[name] = answer
        else:
            unsolved.append(answer)
            _logger.info("no motion for %s: %s", name, answer.reason)
        if progress is not None:
            progress(k + 1, len(moving))
    for name, mates in simultaneous.items():
        if name not in motions:
            continue
        if missing := next((other for other in mates if other not in motions), None):
            reason = f"it goes in at the same time as {missing}, which has no motion"
            unsolved.append(Unsolved(part=name, answer=Answer.UNKNOWN, blocked_by=(missing,), reason=reason))
        else:
            slowest = max(_insertion_time(motions[other]) for other in (name, *mates))
            motions[name] = _with_insertion_time(motions[name], slowest)
    for entry in unsolved:
        motions.pop(entry.part, None)
    return MotionResult(
        table=table,
        fixture_height=standing - offset,
        resting=rest.poses,
        motions=motions,
        unsolved=tuple(unsolved),
    )


def _insertion_time(motion: Motion) -> float:
    """How long an insertion along one geodesic takes [s]."""
    assert motion.times is not None
    return float(motion.times[-1] - motion.times[-2])


def _with_insertion_time(motion: Motion, seconds: float) -> Motion:
    """The motion with a slower insertion, along one geodesic."""
    assert motion.times is not None
    times = motion.times.copy()
    times[-1] = times[-2] + seconds
    return replace(motion, times=times, evidence={**motion.evidence, "duration": float(times[-1])})


def _plan_insertions(
    standing: Sequence[str],
    moving: Sequence[str],
    removals: Mapping[str, Removal],
    simultaneous: Mapping[str, Sequence[str]],
    bodies: Mapping[str, Body],
    assembled: Mapping[str, Float[np.ndarray, "4 4"]],
    directions: Float[np.ndarray, "direction 3"],
    config: MotionConfig,
) -> dict[str, Insertion]:
    """The insertion of each part that has a removal, among the parts placed before it."""
    insertions: dict[str, Insertion] = {}
    before = list(standing)
    for name in moving:
        if name in removals:
            mates = simultaneous.get(name, ())
            placed = [Obstacle(body=bodies[n], T_world_part=assembled[n]) for n in before if n not in mates]
            which = (bodies[name], assembled[name], removals[name], placed)
            if mates:
                insertions[name] = whole_insertion(*which, directions=directions)
            else:
                margin = config.preinsertion_margin * bodies[name].size
                options = {"margin": margin, "max_checks": config.max_edge_checks}
                insertions[name] = plan_insertion(*which, directions=directions, **options)
        before.append(name)
    return insertions


def _table_offset(
    standing: float,
    normal: Float[np.ndarray, "3"],
    moving: Sequence[str],
    insertions: Mapping[str, Insertion],
    bodies: Mapping[str, Body],
    assembled: Mapping[str, Float[np.ndarray, "4 4"]],
    config: MotionConfig,
) -> float:
    """How high the table lies, given the lowest point of the parts that stand from the beginning [m]."""
    starts, sweeps = {}, {}
    for name in moving:
        if name in insertions:
            insertion = insertions[name]
            starts[name] = min(bodies[name].lowest(T, normal) for T in (insertion.poses[0], insertion.T_clear))
            sweeps[name] = sweep_low(bodies[name], insertion.poses, normal)
        else:
            sweeps[name] = bodies[name].lowest(assembled[name], normal)
    margins = {name: config.preinsertion_margin * bodies[name].size for name in moving}
    return tables.table_offset(standing, starts, sweeps, margins)

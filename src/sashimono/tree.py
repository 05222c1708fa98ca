"""The assembly tree: every level planned as an assembly of its own, in which a subassembly is one part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_body, merge_parts
from sashimono.contact import ContactChoice, ContactConfig, Gripper, choose_contacts, named_gripper, real_tool
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.separation import Separation, names_of
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult
from sashimono.geometry.body import Body, SampleConfig
from sashimono.motion import MotionConfig, MotionResult, plan_motions
from sashimono.plan import DeclaredHelix, Motion, RestingPoses, Step, Subassembly, Table, Unsolved

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLevel:
    """One level of the tree, with all that is below it."""

    steps: tuple[Step, ...]
    """In assembly order."""
    table: Table
    unsolved: tuple[Unsolved, ...]
    """Parts without a step of their own on this level or below."""
    refused: frozenset[Refusal]
    """Departures for which no motion was found."""
    failed: tuple[Unsolved, ...]
    """What is said of each of them."""

    @property
    def order(self) -> tuple[str, ...]:
        """Assembly order."""
        return tuple(step.part for step in self.steps)


@dataclass(frozen=True, kw_only=True, eq=False)
class TreePlanner:
    """Levels 2 and 3 for every level of an assembly tree."""

    assembly: Assembly
    bodies: Mapping[str, Body]
    motion: MotionConfig
    contact: ContactConfig | None
    """None: no contacts are asked for."""
    gripper: str | Gripper
    report: tuple[str | Gripper, ...]
    """Grippers of which each step says whether they can take the part."""
    samples: SampleConfig
    resting: RestingPoses | None
    """Table and resting poses of the top level, from elsewhere."""
    stage: Callable[[str], AbstractContextManager[None]]
    """Entered with "motion" or "contact" while that level works."""

    def plan(
        self,
        found: DisassemblyResult,
        *,
        motion_rng: np.random.Generator,
        contact_rng: np.random.Generator,
        progress: Progress = lambda stage, done, total: None,
    ) -> PlannedLevel:
        """Return steps for what level 1 took apart, insides of subassemblies first.

        A part that cannot be separated from its subassembly still moves with it, and is listed as unsolved.
        """
        names = self.assembly.names
        departures = {names[departure.part]: departure for departure in reversed(found.removals)}
        inside: dict[str, PlannedLevel] = {}
        merged: dict[str, np.random.Generator] = {}
        for name, departure in departures.items():
            if departure.inside is not None:
                # spawned only for a subassembly: other plans draw the same numbers as before
                inner, merged[name] = motion_rng.spawn(2)
                inside[name] = self._bench().plan(
                    departure.inside, motion_rng=inner, contact_rng=contact_rng.spawn(1)[0]
                )
        level, bodies = self._level(found, departures, merged)
        motion = self.motion
        if found.up is not None and motion.table.up is None:
            motion = replace(motion, table=replace(motion.table, up=found.up))
        order = [names[found.base], *departures]
        stuck = [_stuck(self.assembly, part, separation) for part, separation in found.stuck]
        with self.stage("motion"):
            motions = plan_motions(
                level,
                order,
                {name: d.separation.removal for name, d in departures.items() if d.separation.removal is not None},
                config=motion,
                rng=motion_rng,
                in_place=[entry.part for entry in stuck],
                bodies=bodies,
                resting=self.resting,
                progress=lambda done, total: progress("motion", done, total),
            )
        failed = {entry.part: entry for entry in motions.unsolved}
        moved = [name for name in order if name not in failed]
        with self.stage("contact"):
            contacts = self._contacts(level, bodies, moved, motions, contact_rng, progress)
        unsolved = {entry.part: entry for entry in (*stuck, *(e for below in inside.values() for e in below.unsolved))}
        for name, entry in failed.items():
            for member in self._members(departures[name]):
                unsolved.setdefault(member, _carried(member, entry))
        return PlannedLevel(
            steps=self._steps(moved, departures, inside, motions, contacts),
            table=motions.table,
            unsolved=tuple(unsolved.values()),
            refused=frozenset(
                refusal
                for name, entry in failed.items()
                for refusal in self._refusals(departures, order[: order.index(name)], name, entry)
            ).union(*(below.refused for below in inside.values())),
            failed=(*failed.values(), *(entry for below in inside.values() for entry in below.failed)),
        )

    def _bench(self) -> TreePlanner:
        """The planner of what is put together elsewhere: what the user says of table and tray is of the top level."""
        return replace(self, resting=None, motion=replace(self.motion, table=replace(self.motion.table, up=None)))

    def _refusals(
        self, departures: Mapping[str, Departure], before: Sequence[str], name: str, entry: Unsolved
    ) -> list[Refusal]:
        """What level 1 is told of a part without a motion: not that way while any placed part that it met is there.

        Where it met none of them, not that way at all.
        """
        refusal = departures[name].refusal
        met = [
            departures[other].members if other in departures else 1 << self.assembly.index(other)
            for other in entry.blocked_by
            if other in before
        ]
        return [replace(refusal, among=members) for members in met] or [refusal]

    def _members(self, departure: Departure) -> tuple[str, ...]:
        return names_of(self.assembly, bits(departure.members))

    def _level(
        self,
        found: DisassemblyResult,
        departures: Mapping[str, Departure],
        merged: Mapping[str, np.random.Generator],
    ) -> tuple[Assembly, Mapping[str, Body]]:
        """Return the assembly of this level, in which each subassembly is one part, and its bodies."""
        present = {found.base, *(part for part, _ in found.stuck), *(d.part for d in found.removals)}
        if not merged and len(present) == len(self.assembly):
            return self.assembly, self.bodies
        parts, bodies = [], {}
        for k in sorted(present):
            part = self.assembly.parts[k]
            if part.name in merged:
                part = merge_parts(
                    [self.assembly.part(name) for name in self._members(departures[part.name])], part.name
                )
                bodies[part.name] = make_body(part, config=self.samples, rng=merged[part.name])
            else:
                bodies[part.name] = self.bodies[part.name]
            parts.append(part)
        alike = [tuple(n for n in names if n in bodies and n not in merged) for names in self.assembly.identical]
        return Assembly(parts=tuple(parts), identical=tuple(names for names in alike if len(names) > 1)), bodies

    def _contacts(
        self,
        level: Assembly,
        bodies: Mapping[str, Body],
        order: list[str],
        motions: MotionResult,
        rng: np.random.Generator,
        progress: Progress,
    ) -> Mapping[str, ContactChoice]:
        if self.contact is None:
            return {name: ContactChoice(None, "contacts were not asked for") for name in order}
        done = iter(range(1, len(order) + 1))
        return choose_contacts(
            level,
            order,
            motions.motions,
            motions.table,
            gripper=named_gripper(self.gripper),
            config=self.contact,
            rng=rng,
            bodies=bodies,
            report=[real_tool(tool) for tool in self.report],
            progress=lambda name: progress("contact", next(done), len(order)),
        )

    def _steps(
        self,
        order: list[str],
        departures: Mapping[str, Departure],
        inside: Mapping[str, PlannedLevel],
        motions: MotionResult,
        contacts: Mapping[str, ContactChoice],
    ) -> tuple[Step, ...]:
        steps: list[Step] = []
        for name in order:
            below = inside.get(name)
            step = Step(
                part=name,
                fixed=tuple(member for before in steps for member in before.members),
                motion=motions.motions[name],
                contact=contacts[name].contact,
                contact_reason=contacts[name].reason,
                carry=contacts[name].carry,
                grippers=contacts[name].grippers,
                moving=() if below is None else self._members(departures[name]),
                subassembly=None
                if below is None
                else Subassembly(order=below.order, steps=below.steps, table=below.table),
                declared=_declared(self.assembly, departures.get(name), motions.motions[name]),
            )
            steps.append(step)
        return tuple(steps)


def _declared(assembly: Assembly, departure: Departure | None, motion: Motion) -> DeclaredHelix | None:
    """Return the declared thread that the end of a motion follows; None if there is none, or the motion left it."""
    thread = None if departure is None else departure.separation.declared
    if departure is None or thread is None or departure.separation.removal is None:
        return None
    turned = departure.separation.removal.displacements[: thread.stretches + 1]
    poses = motion.T_world_part
    if len(poses) < len(turned) or not np.allclose(poses[-len(turned) :][::-1], turned @ poses[-1], atol=1e-9):
        return None
    return DeclaredHelix(
        axis=-thread.axis,
        point=thread.point,
        pitch=thread.pitch,
        other=assembly.names[thread.other],
        start=len(poses) - len(turned),
        stop=len(poses) - 1,
    )


def _stuck(assembly: Assembly, part: int, separation: Separation) -> Unsolved:
    return Unsolved(
        part=assembly.names[part],
        answer=separation.answer,
        proven_for=separation.proven_for,
        blocked_by=names_of(assembly, separation.blocked_by),
        reason=separation.reason,
    )


def _carried(member: str, entry: Unsolved) -> Unsolved:
    """Return what is said of a member if its subassembly does not move."""
    if member == entry.part:
        return entry
    return Unsolved(
        part=member,
        answer=entry.answer,
        proven_for=entry.proven_for,
        blocked_by=entry.blocked_by,
        reason=f"in one subassembly with {entry.part}: {entry.reason}",
    )

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
from sashimono.disassembly.removal import Removal
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
class _Stretch:
    """What is placed on one table, one after the other."""

    names: list[str]
    placed: list[str]
    """What is in place before, the base aside."""
    up: tuple[float, float, float] | None
    turned: bool = False
    """Whether the product is turned over before."""


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
        order = [names[found.base], *departures]
        stuck = [_stuck(self.assembly, part, separation) for part, separation in found.stuck]
        removals = {name: d.separation.removal for name, d in departures.items() if d.separation.removal is not None}
        mates = {name: self._mates(found, d) for name, d in departures.items() if d.simultaneous}
        count = len(departures) - (0 if found.turn is None else found.turn.count)

        def motions_of(stretch: _Stretch, before: int) -> MotionResult:
            def told(done: int, _: int) -> None:
                progress("motion", before + done, len(departures))

            with self.stage("motion"):
                return self._motions(level, bodies, stretch, order[0], removals, mates, motion_rng, told)

        stretches = [_Stretch(names=[*departures][:count], placed=[entry.part for entry in stuck], up=found.up)]
        results = [motions_of(stretches[0], 0)]
        if found.turn is not None:
            # what has no motion is not there when the product is turned over
            missing = {entry.part for entry in results[0].unsolved}
            placed = [*stretches[0].placed, *(name for name in stretches[0].names if name not in missing)]
            stretches.append(_Stretch(names=[*departures][count:], placed=placed, up=found.turn.up, turned=True))
            results.append(motions_of(stretches[1], count))
        failed = {entry.part: entry for result in results for entry in result.unsolved}
        moved = [name for name in order if name not in failed]
        motions = {name: motion for result in reversed(results) for name, motion in result.motions.items()}
        contacts: dict[str, ContactChoice] = {}
        with self.stage("contact"):
            for stretch, result in zip(stretches, results, strict=True):
                present = [name for name in moved if name in result.motions]
                found_here = self._contacts(level, bodies, present, mates, result, contact_rng, progress, len(moved))
                contacts |= {n: c for n, c in found_here.items() if n in stretch.names or not stretch.turned}
        unsolved = {entry.part: entry for entry in (*stuck, *(e for below in inside.values() for e in below.unsolved))}
        for name, entry in failed.items():
            for member in self._members(departures[name]):
                unsolved.setdefault(member, _carried(member, entry))
        return PlannedLevel(
            steps=self._steps(moved, departures, inside, mates, motions, contacts, _tables(moved, stretches, results)),
            table=results[0].table,
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

    def _mates(self, found: DisassemblyResult, departure: Departure) -> tuple[str, ...]:
        """The names of the departures that happen at the same time, in assembly order."""
        mates = (other for other in reversed(found.removals) if other.members & departure.simultaneous)
        return names_of(self.assembly, [other.part for other in mates])

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

    def _motions(
        self,
        level: Assembly,
        bodies: Mapping[str, Body],
        stretch: _Stretch,
        base: str,
        removals: Mapping[str, Removal],
        mates: Mapping[str, Sequence[str]],
        rng: np.random.Generator,
        progress: Callable[[int, int], None],
    ) -> MotionResult:
        """Level 2 for what is placed on one table. Once turned over, the product stands there as it is."""
        motion, resting = self.motion, self.resting
        if stretch.turned:
            assert stretch.up is not None
            normal = np.array(stretch.up)
            standing = [base, *stretch.placed]
            low = min(bodies[name].lowest(level.part(name).T_world_part, normal) for name in standing)
            resting = RestingPoses(table=Table(normal=normal, offset=low), poses={})
        elif stretch.up is not None and motion.table.up is None:
            motion = replace(motion, table=replace(motion.table, up=stretch.up))
        return plan_motions(
            level,
            [base, *stretch.names],
            {name: removals[name] for name in stretch.names if name in removals},
            config=motion,
            rng=rng,
            in_place=stretch.placed,
            simultaneous={name: mates[name] for name in stretch.names if name in mates},
            bodies=bodies,
            resting=resting,
            progress=progress,
        )

    def _contacts(
        self,
        level: Assembly,
        bodies: Mapping[str, Body],
        order: list[str],
        mates: Mapping[str, Sequence[str]],
        motions: MotionResult,
        rng: np.random.Generator,
        progress: Progress,
        total: int,
    ) -> Mapping[str, ContactChoice]:
        if self.contact is None:
            return {name: ContactChoice(None, "contacts were not asked for") for name in order}
        done = iter(range(1 + total - len(order), total + 1))
        return choose_contacts(
            level,
            order,
            motions.motions,
            motions.table,
            gripper=named_gripper(self.gripper),
            config=self.contact,
            rng=rng,
            bodies=bodies,
            simultaneous=mates,
            report=[real_tool(tool) for tool in self.report],
            progress=lambda name: progress("contact", next(done), total),
        )

    def _steps(
        self,
        order: list[str],
        departures: Mapping[str, Departure],
        inside: Mapping[str, PlannedLevel],
        mates: Mapping[str, tuple[str, ...]],
        motions: Mapping[str, Motion],
        contacts: Mapping[str, ContactChoice],
        turned: Mapping[str, Table],
    ) -> tuple[Step, ...]:
        steps: list[Step] = []
        for name in order:
            below, at_once = inside.get(name), mates.get(name, ())
            step = Step(
                part=name,
                fixed=tuple(member for before in steps if before.part not in at_once for member in before.members),
                motion=motions[name],
                contact=contacts[name].contact,
                contact_reason=contacts[name].reason,
                carry=contacts[name].carry,
                grippers=contacts[name].grippers,
                moving=() if below is None else self._members(departures[name]),
                subassembly=None
                if below is None
                else Subassembly(
                    order=below.order, steps=below.steps, table=below.table, product=departures[name].product
                ),
                simultaneous=at_once,
                declared=_declared(self.assembly, departures.get(name), motions[name]),
                table=turned.get(name),
            )
            steps.append(step)
        return tuple(steps)


def _tables(moved: Sequence[str], stretches: Sequence[_Stretch], results: Sequence[MotionResult]) -> dict[str, Table]:
    """The new table, by the name of the part that comes first after each turn."""
    out = {}
    for stretch, result in zip(stretches, results, strict=True):
        first = next((name for name in moved if name in stretch.names), None)
        if stretch.turned and first is not None:
            out[first] = result.table
    return out


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

"""An old plan put onto new geometry: the same order and motions, for the parts as they are now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan, Contact, DeclaredHelix, Fixture, Motion, Step, Subassembly, Table
from sashimono.revision.parts import PartChange, common_displacement

Pose = Float[np.ndarray, "4 4"]

_SUPPORTS = ("points_part", "forces_part")


class NotCarriedOver(Exception):
    """The plan stands and falls with a part that is gone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Carrier:
    """What every step is changed with."""

    names: Mapping[str, str]
    """New name of each old part that is still there."""
    displacements: Mapping[str, Pose]
    """World motion of each of these, by its old name."""
    whole: Pose
    """World motion of the product as a whole."""
    before: Mapping[str, Pose]
    """Assembled poses in the old plan."""
    assembly: Assembly

    def steps(self, steps: Sequence[Step], table: Table | None) -> tuple[Step, ...]:
        """Steps of one level, those of parts that are gone left out; on the new table."""
        if steps and not any(name in self.names for name in steps[0].members):
            raise NotCarriedOver(f"its base {steps[0].part} is gone")
        out: list[Step] = []
        turned: Table | None = None
        for step in steps:
            turned = step.table or turned
            if not any(name in self.names for name in step.members):
                continue
            new = None if turned is None else self.turned(turned, out)
            table = new or table
            out.append(replace(self.step(step, table), table=new, held_before=self.known(step.held_before)))
            turned = None
        return tuple(out)

    def turned(self, table: Table, placed: Sequence[Step]) -> Table:
        """The table that the product is turned over to, moved with it; right below what is placed by then."""
        normal = self.whole[:3, :3] @ table.normal
        names = [name for step in placed for name in step.members]
        lowest = min(float((self.assembly.part(name).vertices_world @ normal).min()) for name in names)
        return Table(normal=normal, offset=lowest)

    def step(self, step: Step, table: Table | None) -> Step:
        """The same step for the parts as they are now."""
        members = [name for name in step.members if name in self.names]
        leader = step.part if step.part in self.names else members[0]
        if step.moving and len(members) < 2:
            raise NotCarriedOver(f"of its subassembly {', '.join(step.moving)} one part is left")
        old_path = step.member_poses(leader, self.before)
        new_path = self.path(leader, old_path, step)
        if table is not None and step.moves:
            new_path = self.on_the_table(new_path, leader, members, _start(step), table)
        to_new = self.frame(leader, step.part)
        below = step.subassembly
        return replace(
            step,
            part=self.names[leader],
            fixed=self.known(step.fixed),
            moving=tuple(self.names[name] for name in members) if step.moving else (),
            simultaneous=self.known(step.simultaneous),
            held=self.known(step.held),
            motion=Motion(T_world_part=new_path, segments=step.motion.segments, evidence={}, times=step.motion.times),
            contact=None if step.contact is None else _moved_contact(step.contact, to_new),
            carry=None if step.carry is None else _moved_contact(step.carry, to_new),
            declared=None if step.declared is None else self.helix(step.declared),
            subassembly=None if below is None else self.subassembly(below),
        )

    def known(self, names: Sequence[str]) -> tuple[str, ...]:
        return tuple(self.names[name] for name in names if name in self.names)

    def path(self, name: str, old: Float[np.ndarray, "pose 4 4"], step: Step) -> Float[np.ndarray, "pose 4 4"]:
        """The path: from where it rested, along the same insertion, to where it is now.

        Up to the insertion the part is where it was; from there on it undergoes the same displacements. Both after the
        motion of the whole product.
        """
        back = se3.inverse(self.before[name])
        after = self.assembly.part(self.names[name]).T_world_part
        start = _start(step)
        whole, whole_back = self.whole, se3.inverse(self.whole)
        was = se3.inverse(self.displacements[name]) @ after
        poses = [whole @ T @ back @ (was if k < start else whole_back @ after) for k, T in enumerate(old)]
        poses[-1] = after
        return np.array(poses)

    def on_the_table(
        self, path: Float[np.ndarray, "pose 4 4"], leader: str, members: Sequence[str], start: int, table: Table
    ) -> Float[np.ndarray, "pose 4 4"]:
        """The path with its way to the insertion lifted or lowered, so that what has another shape now rests again."""
        shift = path[0] @ se3.inverse(self.assembly.part(self.names[leader]).T_world_part)
        parts = [self.assembly.part(self.names[name]) for name in members]
        lowest = min(float((se3.apply(shift, part.vertices_world) @ table.normal).min()) for part in parts)
        lifted = path.copy()
        lifted[:start, :3, 3] += (table.offset - lowest) * table.normal
        return lifted

    def frame(self, new_leader: str, old_leader: str) -> Pose:
        """Takes points of the old leader's frame to that of the new one, as the material lies now."""
        after = self.assembly.part(self.names[new_leader]).T_world_part
        return se3.inverse(after) @ self.displacements[new_leader] @ self.before[old_leader]

    def helix(self, helix: DeclaredHelix) -> DeclaredHelix:
        R, point = self.whole[:3, :3], se3.apply(self.whole, helix.point[None])[0]
        return replace(helix, axis=R @ helix.axis, point=point, other=self.names.get(helix.other, helix.other))

    def table(self, table: Table | None, steps: Sequence[Step], fixture: Fixture | None) -> Table | None:
        """The table, moved with the product; right below what stands on it from the beginning, unless that is held."""
        if table is None:
            return None
        normal = self.whole[:3, :3] @ table.normal
        standing = [self.names[name] for step in steps if not step.moves for name in step.members if name in self.names]
        if fixture is not None or not standing:
            return Table(normal=normal, offset=float(table.offset + normal @ self.whole[:3, 3]))
        lowest = min(float((self.assembly.part(name).vertices_world @ normal).min()) for name in standing)
        return Table(normal=normal, offset=lowest)

    def subassembly(self, below: Subassembly) -> Subassembly:
        table = self.table(below.table, below.steps, below.fixture)
        steps = self.steps(below.steps, table)
        fixture = self.fixture(below.fixture)
        return replace(below, order=tuple(step.part for step in steps), steps=steps, table=table, fixture=fixture)

    def fixture(self, fixture: Fixture | None) -> Fixture | None:
        return None if fixture is None else replace(fixture, parts=self.known(fixture.parts))


def _start(step: Step) -> int:
    """Pose at which the insertion begins."""
    return max((segment.stop for segment in step.motion.segments if segment.kind == "transit"), default=0)


def _moved_contact(contact: Contact, T: Pose) -> Contact:
    """The same contact in another frame of the part."""
    if np.allclose(T, np.eye(4), atol=1e-12):
        return contact
    R = T[:3, :3]
    details: dict[str, Any] = dict(contact.details)
    if supports := details.get("supports"):
        points, forces = (np.array(supports[key], dtype=np.float64).reshape(-1, 3) for key in _SUPPORTS)
        moved = dict(zip(_SUPPORTS, (se3.apply(T, points).tolist(), (forces @ R.T).tolist()), strict=True))
        details["supports"] = {**supports, **moved}
    if isinstance(wrench := details.get("wrench"), list) and len(wrench) == 6:
        details["wrench"] = [*(R @ np.array(wrench[:3])).tolist(), *(R @ np.array(wrench[3:])).tolist()]
    return replace(
        contact,
        points_part=se3.apply(T, contact.points_part),
        normals_part=contact.normals_part @ R.T,
        force_part=None if contact.force_part is None else contact.force_part @ R.T,
        T_part_gripper=None if contact.T_part_gripper is None else T @ contact.T_part_gripper,
        details=details,
    )


def carry_over(plan: AssemblyPlan, assembly: Assembly, changes: Sequence[PartChange]) -> AssemblyPlan:
    """Return the plan with its order and motions, for the parts as they are now.

    Raises NotCarriedOver if a part that the plan stands on is gone.

    Args:
        plan: The old plan.
        assembly: The new geometry.
        changes: What became of each part.
    """
    kept = [change for change in changes if change.old is not None and change.new is not None]
    names = {str(change.old): str(change.new) for change in kept if change.old in plan.parts}
    displacements = {
        str(change.old): change.displacement
        if change.displacement is not None
        else assembly.part(str(change.new)).T_world_part @ se3.inverse(plan.parts[str(change.old)])
        for change in kept
        if change.old in plan.parts
    }
    whole = common_displacement(kept)
    for change in kept:
        # a mesh in place says nothing of where a part of another shape was: with the product, then
        if change.reshaped and change.old in displacements and change.shift == 0.0:
            displacements[change.old] = whole
    carrier = _Carrier(
        names=names,
        displacements=displacements,
        whole=whole,
        before=plan.parts,
        assembly=assembly,
    )
    table = carrier.table(plan.table, plan.steps, plan.fixture)
    steps = carrier.steps(plan.steps, table)
    assert assembly.source is not None, "read from a file"
    return replace(
        plan,
        source=assembly.source,
        parts={part.name: part.T_world_part for part in assembly.parts},
        order=tuple(step.part for step in steps),
        steps=steps,
        unsolved=tuple(
            replace(entry, part=names[entry.part], blocked_by=carrier.known(entry.blocked_by))
            for entry in plan.unsolved
            if entry.part in names
        ),
        table=table,
        fixture=carrier.fixture(plan.fixture),
        fits=tuple(
            replace(fit, parts=(names[fit.parts[0]], names[fit.parts[1]]))
            for fit in plan.fits
            if all(part in names for part in fit.parts)
        ),
        overlaps=assembly.overlaps,
        identical=assembly.identical,
    )

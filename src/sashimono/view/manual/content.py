"""What the instructions say: chapters of tasks, a bill of materials. No picture and no language yet."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.plan import AssemblyPlan, DeclaredFit, Fixture, Step, Subassembly, Table, Unsolved, simultaneous_steps
from sashimono.view.playback import UP

_ALIKE_DIRECTION = 0.999
"""Least cosine between the ways in of fasteners that one task brings."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BillRow:
    """Parts of one shape: a line of the bill of materials."""

    number: int
    """From 1, in the order in which they are first placed."""
    label: str
    """What the parts are called: their common name without a running number, or the first one's name."""
    names: tuple[str, ...]
    size: Float[np.ndarray, "3"]
    """Edges of the box of the first of them, assembled, longest first [m]."""
    fastener: Fastener | None = None
    """The first of them, if they are fasteners."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """What is done at once: a step of the plan, or several that bring fasteners alike."""

    number: int
    """From 1, through all chapters."""
    steps: tuple[Step, ...]
    labels: tuple[str, ...]
    """Their numbers in the plan: "3", and "3.1" inside the subassembly of step 3."""
    placed: tuple[str, ...]
    """What is there before."""
    row: BillRow
    """Of the part, or of a subassembly's leading part."""
    brings: str
    """Letter of the chapter that it brings; "" for parts."""
    product: str
    """The product of the input's tree that it brings; "" if none."""
    let_go: tuple[str, ...]
    """Parts that were held until here, and stand by themselves now."""
    kept: tuple[str, ...]
    """Parts that were held until here, and must be held on."""
    turned: bool
    """Whether a subassembly has to be turned over before it is brought."""
    up: Float[np.ndarray, "3"]
    """Away from the table of the task, unit, world frame."""
    clamped: tuple[str, ...]
    """What a fixture holds: until the product is turned over."""

    @property
    def step(self) -> Step:
        """The first step."""
        return self.steps[0]

    @property
    def turns_product(self) -> bool:
        """Whether all that is put together is turned over first."""
        return self.step.turned

    @property
    def members(self) -> tuple[str, ...]:
        """All parts that come."""
        return tuple(name for step in self.steps for name in step.members)

    @property
    def simultaneous(self) -> bool:
        """Whether it is several different parts that go in at the same time."""
        return len(self.steps) > 1 and bool(self.step.simultaneous)

    @property
    def held(self) -> tuple[str, ...]:
        """What must be held when all is done."""
        return self.steps[-1].held

    @property
    def hands(self) -> int | None:
        """Most hands at work at once; None where it is not known."""
        counts = [step.hands for step in self.steps if step.hands is not None]
        return max(counts) if counts else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Chapter:
    """How the product, or one subassembly, is put together."""

    letter: str
    """Of a subassembly; "" for the product."""
    product: str
    """The product of the input's tree that it is; "" if none."""
    members: tuple[str, ...]
    tasks: tuple[Task, ...]
    up: Float[np.ndarray, "3"]
    """Away from the table on which it begins, unit, world frame."""
    fixture: Fixture | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Manual:
    """The instructions."""

    title: str
    chapters: tuple[Chapter, ...]
    """Subassemblies first, the product last."""
    bill: tuple[BillRow, ...]
    fasteners: tuple[Fastener, ...]
    unsolved: tuple[Unsolved, ...]
    hands: int
    """How many hands there are."""
    executable: bool | None
    fits: tuple[DeclaredFit, ...] = ()
    """Pairs of which one has to give on the way."""

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All tasks, in order."""
        return tuple(task for chapter in self.chapters for task in chapter.tasks)

    def fastener(self, name: str) -> Fastener | None:
        """Return the fastener with this name; None if the part is none."""
        return next((fastener for fastener in self.fasteners if fastener.part == name), None)


def make_manual(plan: AssemblyPlan, assembly: Assembly) -> Manual:
    """Return what the instructions for a plan say. ``assembly`` holds the geometry of the plan's parts."""
    fasteners = find_fasteners(assembly)
    bill = bill_of_materials(plan, assembly, fasteners)
    writer = _Writer({name: row for row in bill for name in row.names}, {f.part: f for f in fasteners})
    writer.chapter("", plan, assembly.names)
    return Manual(
        title=PurePath(plan.source.path.replace("\\", "/")).stem or "assembly",
        chapters=tuple(writer.chapters),
        bill=bill,
        fasteners=fasteners,
        unsolved=plan.unsolved,
        hands=plan.hands,
        executable=plan.executable,
        fits=plan.fits,
    )


def bill_of_materials(plan: AssemblyPlan, assembly: Assembly, fasteners: Sequence[Fastener]) -> tuple[BillRow, ...]:
    """Return a line for each shape, in the order in which its first part is placed; unsolved parts come last."""
    classes = {name: names for names in assembly.identical for name in names}
    kinds = {fastener.part: fastener for fastener in fasteners}
    order = [*plan.placed, *(name for name in assembly.names if name not in set(plan.placed))]
    rows: list[BillRow] = []
    seen: set[str] = set()
    for name in order:
        if name in seen:
            continue
        names = tuple(other for other in classes.get(name, (name,)) if other not in seen)
        seen.update(names)
        edges = np.sort(np.ptp(assembly.part(name).vertices_part, axis=0))[::-1]
        rows.append(
            BillRow(
                number=len(rows) + 1,
                label=common_name(names),
                names=names,
                size=edges,
                fastener=next((kinds[other] for other in names if other in kinds), None),
            )
        )
    return tuple(rows)


def common_name(names: Sequence[str]) -> str:
    """Return what several parts are called together: "screw_M4" for "screw_M4_1", "screw_M4_2"; else the first name."""
    stems = {re.sub(r"[ _.:-]*\d*$", "", name) for name in names}
    stem = stems.pop()
    return stem if len(names) > 1 and not stems and stem else names[0]


class _Writer:
    """Collects chapters, insides first."""

    def __init__(self, rows: dict[str, BillRow], fasteners: dict[str, Fastener]) -> None:
        self._rows, self._fasteners = rows, fasteners
        self.chapters: list[Chapter] = []
        self._count = 0

    def chapter(self, prefix: str, plan: AssemblyPlan | Subassembly, members: tuple[str, ...]) -> Chapter:
        """Append the chapter of one level after those of its subassemblies, and return it."""
        inside = {
            step.part: self.chapter(f"{prefix}{k}.", step.subassembly, step.members)
            for k, step in enumerate(plan.steps, start=1)
            if step.subassembly is not None
        }
        up = _up(plan.table)
        letter = "" if prefix == "" else _letter(len(self.chapters))
        tasks: list[Task] = []
        held: tuple[str, ...] = ()
        clamped = () if plan.fixture is None else plan.fixture.parts
        for group in self._groups(plan.steps, prefix):
            steps = tuple(step for _, step in group)
            if steps[0].turned:
                up, held, clamped = _up(steps[0].table), steps[0].held_before, ()
            below = inside.get(steps[0].part)
            self._count += 1
            tasks.append(
                Task(
                    number=self._count,
                    steps=steps,
                    labels=tuple(label for label, _ in group),
                    placed=steps[0].fixed,
                    row=self._rows[steps[0].part],
                    brings="" if below is None else below.letter,
                    product="" if below is None else below.product,
                    let_go=tuple(name for name in held if name not in steps[-1].held),
                    kept=tuple(name for name in held if name in steps[-1].held),
                    turned=below is not None and float(below.up @ up) < 0.97,
                    up=up,
                    clamped=clamped,
                )
            )
            held = steps[-1].held
        product = "" if isinstance(plan, AssemblyPlan) else plan.product or ""
        made = Chapter(
            letter=letter,
            product=product,
            members=members,
            tasks=tuple(tasks),
            up=_up(plan.table),
            fixture=plan.fixture,
        )
        self.chapters.append(made)
        return made

    def _groups(self, steps: Sequence[Step], prefix: str) -> list[list[tuple[str, Step]]]:
        groups: list[list[tuple[str, Step]]] = []
        for k, step in enumerate(steps):
            entry = (f"{prefix}{k + 1}", step)
            if groups and (self._alike(groups[-1][-1][1], step) or _in_one_picture(steps, k)):
                groups[-1].append(entry)
            else:
                groups.append([entry])
        return groups

    def _alike(self, a: Step, b: Step) -> bool:
        """Whether both bring fasteners of one shape, along the same way, and nothing is to be held for either."""
        if (
            a.moving
            or b.moving
            or b.turned
            or self._rows[a.part] is not self._rows[b.part]
            or not {a.part, b.part} <= set(self._fasteners)
        ):
            return False
        if a.direction is None or b.direction is None or a.direction @ b.direction < _ALIKE_DIRECTION:
            return False
        same_way = len(a.insertion) == len(b.insertion) and abs(a.turns - b.turns) < 0.25
        same_notes = (a.contact is None) == (b.contact is None) and set(a.held) == set(b.held)
        return same_way and same_notes and abs(a.length - b.length) <= 0.1 * max(a.length, b.length)


def _in_one_picture(steps: Sequence[Step], k: int) -> bool:
    """Whether a step and the one before go in at the same time, and nothing of that was put together before."""
    together = simultaneous_steps(steps, k)
    return steps[k - 1].part in steps[k].simultaneous and not any(each.moving for each in together)


def _up(table: Table | None) -> Float[np.ndarray, "3"]:
    up = np.array(UP) if table is None else table.normal
    return up / np.linalg.norm(up)


def _letter(count: int) -> str:
    """A, B, ..., Z, AA, AB, ..."""
    text = ""
    count += 1
    while count:
        count, rest = divmod(count - 1, 26)
        text = chr(ord("A") + rest) + text
    return text

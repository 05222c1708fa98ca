"""What several commands do: read, plan, write plan, page and animation, and say what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from sashimono.errors import SashimonoError
from sashimono.reporting import event, note, say

if TYPE_CHECKING:
    from sashimono.assembly import Assembly
    from sashimono.contact import Gripper
    from sashimono.io.constraints_file import Wishes
    from sashimono.io.raw import ReadConfig

OK, DIFFERS, BAD_INPUT, NO_PLAN, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit status. `DIFFERS` is also the doctor's, if something stands in the way."""

PLAN_FILES = ("plan.json", "plan.html", "plan.glb", "constraints.toml")
"""What is written for a plan."""

SPLITS = ("auto", "all", "none")
"""What ``--split`` takes."""


def plan_and_write(
    source: Path,
    out: Path,
    *,
    unit: str | None,
    split: str = "auto",
    seed: int,
    method: str = "cascade",
    device: str | None = None,
    gripper: str = "fingertips",
    grippers: str = "none",
    contacts: bool = True,
    motion: str = "removal",
    resting: Path | None = None,
    wishes: Wishes | None = None,
    declare_threads: bool = False,
    declare_fits: bool = True,
    hands: int = 2,
    explain_order: bool = False,
    stand_ins: bool = True,
    copy_input: bool = False,
) -> int:
    """Read an input, plan it, write the results and say what came of it; return the exit status.

    Args:
        source: The file or folder to read.
        out: The folder to write into.
        unit: Unit of the input where its format has none.
        split: Which parts of several solids are taken apart.
        seed: Of every random choice.
        method: How removals are found.
        device: Warp device on which Algorithm 1 simulates; None for the simulation without Warp.
        gripper: What holds the parts: a name, or a .json file.
        grippers: Grippers of which each step says whether they can do it.
        contacts: Whether to choose grasps.
        motion: How parts get there: by their removal reversed, or by RRT-Connect all the way.
        resting: A file with the table and resting poses of parts; None to lay all out.
        wishes: Base, table, precedences and parts left out, as the user wants them; written beside the plan.
        declare_threads: Whether screws drawn without ridges are turned in.
        declare_fits: Whether elastic parts may give on their way, where a plan is otherwise incomplete.
        hands: How many hands there are.
        explain_order: Whether each step says what else could have come, and why it did not.
        stand_ins: Whether parts that are not closed are planned by closed bodies that contain them; else refused.
        copy_input: Whether a copy of the input is written beside the plan.
    """
    from dataclasses import replace

    from sashimono.bought import find_bought
    from sashimono.console import progress_display, summary_lines
    from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config
    from sashimono.disassembly.sequence.constraints import OrderConstraints
    from sashimono.disassembly.sequence.greedy import SequenceConfig
    from sashimono.disassembly.sequence.products import ProductConfig
    from sashimono.disassembly.threads.declared import DeclareConfig
    from sashimono.fits.config import FitConfig
    from sashimono.io.constraints_file import Wishes
    from sashimono.io.read import read_assembly
    from sashimono.io.resting_file import read_resting_poses
    from sashimono.motion import MotionConfig, TableConfig
    from sashimono.pipeline import PipelineConfig, plan_assembly
    from sashimono.replanning import Input, plan_as_suggested
    from sashimono.tasks import write_results

    tool, asked = find_gripper(gripper), find_grippers(grippers)
    waiting = None if resting is None else read_resting_poses(resting)
    wishes = wishes or Wishes()

    def read(split: str) -> Input:
        options = replace(reading_options(split), exclude=wishes.exclude, stand_ins=stand_ins)
        apart = read_assembly(source, unit=unit, config=options)
        return Input(apart=apart, kept=() if wishes.flat else find_bought(apart, keep=wishes.keep))

    given = read(split)
    assembly = given.assembly
    sequence = SequenceConfig(
        constraints=OrderConstraints(base=wishes.base, before=wishes.before, together=wishes.together),
        products=ProductConfig(enabled=not wishes.flat),
    )
    if wishes.up is not None:
        sequence = replace(sequence, up=wishes.up)
    with progress_display() as display:
        progress = _after(partial(_introduce, assembly), display)
        config = PipelineConfig(
            method=cast("Literal['cascade', 'physics', 'past']", method),
            algorithm1=Algorithm1Config(device=device),
            separate=replace(PipelineConfig().separate, declare=DeclareConfig(enabled=declare_threads)),
            fits=FitConfig(enabled=declare_fits),
            gripper=tool,
            grippers=asked,
            contacts=contacts,
            hands=hands,
            explain_order=explain_order,
            sequence=sequence,
            motion=MotionConfig(insertion=cast("Literal['removal', 'rrt']", motion), table=TableConfig(up=wishes.up)),
        )
        plan = partial(plan_assembly, config=config, seed=seed, resting=waiting, progress=progress)
        assembly, found = plan_as_suggested(
            given, plan, split=partial(read, "all") if split == "auto" else None, cages=not wishes.flat, note=note
        )
    written = write_results(found, assembly, out, copied=source if copy_input else None, wishes=wishes)
    for line in summary_lines(found, assembly):
        say(line)
    say(f"written: {', '.join(str(path) for path in written if path.suffix != '.html')}")
    say(f"open in a browser: {(out / 'plan.html').resolve()}")
    event("plan", status=found.status, executable=found.executable, files=[str(path) for path in written])
    return OK if found.status == "complete" else NO_PLAN


def _introduce(assembly: Assembly) -> None:
    """Say what is planned, and what is to be noted of it."""
    from sashimono.assembly import size_words

    for remark in assembly.notes:
        note(remark)
    say(f"{len(assembly)} parts, {size_words(assembly.bounds_world)}, from coordinates in {unit_of(assembly)}")


def _after(introduce: Callable[[], None], progress: Callable[[str, int, int], None]) -> Callable[[str, int, int], None]:
    """Return a progress callback that introduces the work when it begins: once all that was asked for is known good."""
    waiting = [introduce]

    def update(stage: str, done: int, total: int) -> None:
        if waiting:
            waiting.pop()()
        progress(stage, done, total)

    return update


def unit_of(assembly: Assembly) -> str:
    """Return the unit in which an assembly's file was read."""
    return "m" if assembly.source is None else assembly.source.unit


def read_constraints(
    file: Path | None,
    *,
    base: str | None,
    up: str | None,
    before: Sequence[str],
    together: Sequence[str],
    exclude: Sequence[str],
    keep: Sequence[str] = (),
    flat: bool = False,
) -> Wishes:
    """Return what a constraints file and the options beside it say; SashimonoError for what cannot be read.

    Args:
        file: A TOML file, or None.
        base: The part that everything is put on.
        up: Three numbers, separated by commas.
        before: Pairs ``A:B``.
        together: Groups ``A,B``, of two names and more.
        exclude: Names or patterns.
        keep: Names of products, or patterns.
        flat: Whether the product tree is not looked at.
    """
    from sashimono.io.constraints_file import Wishes, read_wishes

    pairs = []
    for text in before:
        first, colon, later = text.partition(":")
        if not (colon and first and later):
            raise SashimonoError(f"--before {text}: not A:B. Give two names with a colon between.")
        pairs.append((first, later))
    direction = None
    if up is not None:
        try:
            x, y, z = (float(number) for number in up.split(","))
        except ValueError:
            raise SashimonoError(f"--up {up}: not X,Y,Z. Give three numbers with commas between.") from None
        direction = (x, y, z)
    groups = []
    for text in together:
        names = tuple(name.strip() for name in text.split(","))
        if not all(names):
            raise SashimonoError(f"--together {text}: not A,B. Give names, or patterns, with commas between.")
        groups.append(names)
    own = Wishes(
        base=base,
        up=direction,
        before=tuple(pairs),
        together=tuple(groups),
        exclude=tuple(exclude),
        keep=tuple(keep),
        flat=flat,
    )
    wishes = own if file is None else read_wishes(file).and_then(own)
    if wishes.flat and wishes.keep:
        raise SashimonoError(f"--keep {wishes.keep[0]} and --flat contradict one another. Take one of them away.")
    return wishes


def find_gripper(name: str) -> str | Gripper:
    """Return a gripper's name, or the gripper that a .json file describes; SashimonoError where there is none."""
    from sashimono.contact import named_gripper
    from sashimono.tasks import read_gripper

    if name.endswith(".json"):
        return read_gripper(name)
    named_gripper(name)
    return name


def find_grippers(names: str) -> tuple[str | Gripper, ...]:
    """Return the tools that ``--grippers`` names: none, all (the real ones), or some, separated by commas."""
    from sashimono.contact import REAL_TOOLS, real_tool
    from sashimono.tasks import read_gripper

    if names == "none":
        return ()
    if names == "all":
        return REAL_TOOLS
    asked = tuple(
        read_gripper(name) if name.endswith(".json") else name for name in (name.strip() for name in names.split(","))
    )
    for tool in asked:
        real_tool(tool)
    return asked


def reading_options(split: str) -> ReadConfig:
    """Return the options of reading; SashimonoError for a value that ``--split`` does not take."""
    from sashimono.io.raw import ReadConfig

    if split not in SPLITS:
        raise SashimonoError(f"--split {split} is not known. Choose one of: {', '.join(SPLITS)}.")
    return ReadConfig(split=cast("Literal['auto', 'all', 'none']", split))

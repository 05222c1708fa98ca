"""What several commands do: read, plan, write plan, page and animation, and say what came of it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import typer

from sashimono.errors import SashimonoError
from sashimono.outputs import replacing_together

if TYPE_CHECKING:
    from sashimono.assembly import Assembly
    from sashimono.contact import Gripper
    from sashimono.io.raw import ReadConfig
    from sashimono.plan import AssemblyPlan

OK, BAD_INPUT, NO_PLAN, INTERRUPTED = 0, 2, 3, 130
"""Exit status."""

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
    declare_threads: bool = False,
    copy_input: bool = False,
) -> int:
    from sashimono.console import progress_display, summary_lines
    from sashimono.disassembly.cascade import SeparateConfig
    from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config
    from sashimono.disassembly.threads.declared import DeclareConfig
    from sashimono.io.read import read_assembly
    from sashimono.motion import MotionConfig
    from sashimono.pipeline import PipelineConfig, plan_assembly

    tool, asked = find_gripper(gripper), find_grippers(grippers)
    assembly = read_assembly(source, unit=unit, config=reading_options(split))
    for note in assembly.notes:
        typer.echo(f"note: {note}", err=True)
    with progress_display() as progress:
        config = PipelineConfig(
            method=cast("Literal['cascade', 'physics', 'past']", method),
            algorithm1=Algorithm1Config(device=device),
            separate=SeparateConfig(declare=DeclareConfig(enabled=declare_threads)),
            gripper=tool,
            grippers=asked,
            contacts=contacts,
            motion=MotionConfig(insertion=cast("Literal['removal', 'rrt']", motion)),
        )
        found = plan_assembly(assembly, config=config, seed=seed, progress=progress)
    _write(found, assembly, out, copied=source if copy_input else None)
    for line in summary_lines(found, assembly):
        typer.echo(line)
    typer.echo(f"written: {', '.join(str(out / name) for name in ('plan.json', 'plan.glb'))}")
    typer.echo(f"open in a browser: {(out / 'plan.html').resolve()}")
    return OK if found.status == "complete" else NO_PLAN


def find_gripper(name: str) -> str | Gripper:
    """Return a gripper's name, or the gripper that a .json file describes; SashimonoError where there is none."""
    from sashimono.contact import gripper_from_fields, named_gripper

    if not name.endswith(".json"):
        named_gripper(name)
        return name
    try:
        fields = json.loads(Path(name).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SashimonoError(f"{name}: cannot be read as a gripper: {error}") from error
    if not isinstance(fields, dict):
        raise SashimonoError(f"{name}: not one JSON object with the fields of a gripper.")
    return gripper_from_fields(fields, name)


def find_grippers(names: str) -> tuple[str | Gripper, ...]:
    """Return the tools that ``--grippers`` names: none, all (the real ones), or some, separated by commas."""
    from sashimono.contact import REAL_TOOLS, real_tool

    if names == "none":
        return ()
    if names == "all":
        return REAL_TOOLS
    asked = tuple(name if name == "vacuum-cup" else find_gripper(name) for name in map(str.strip, names.split(",")))
    for tool in asked:
        real_tool(tool)
    return asked


def reading_options(split: str) -> ReadConfig:
    """Return the options of reading; SashimonoError for a value that ``--split`` does not take."""
    from sashimono.io.raw import ReadConfig

    if split not in SPLITS:
        raise SashimonoError(f"--split {split} is not known. Choose one of: {', '.join(SPLITS)}.")
    return ReadConfig(split=cast("Literal['auto', 'all', 'none']", split))


def _write(found: AssemblyPlan, assembly: Assembly, out: Path, *, copied: Path | None) -> None:
    """Write the plan, the page and the animation, all or none; if asked, with a copy of the input that it names."""
    from dataclasses import replace

    from sashimono.io.plan_json import write_plan
    from sashimono.view import write_glb, write_html

    with replacing_together(out) as folder:
        if copied is not None:
            (folder / copied.name).write_bytes(copied.read_bytes())
        # from the plan's folder, so that the plan finds its input wherever it is read
        path = copied.name if copied is not None else os.path.relpath(found.source.path, out)
        found = replace(found, source=replace(found.source, path=Path(path).as_posix()))
        write_html(found, assembly, folder / "plan.html")
        write_glb(found, assembly, folder / "plan.glb")
        write_plan(found, folder / "plan.json")

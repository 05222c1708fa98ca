"""The command line: ``sashimono demo | plan | verify | conditions``.

Exit status: 0 complete and verified; 2 bad usage or bad input, with one line on standard error;
3 no complete plan (a partial one is written, with reasons); 130 interrupted. The planner is imported
inside the commands, so that help and usage errors come at once.
"""

from __future__ import annotations

import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn, cast

import typer

from sashimono import __version__
from sashimono.errors import SashimonoError

if TYPE_CHECKING:
    from sashimono.assembly import Assembly
    from sashimono.plan import AssemblyPlan

OK, BAD_INPUT, NO_PLAN, INTERRUPTED = 0, 2, 3, 130
"""Exit status."""

METHODS = ("cascade", "physics")
"""What ``--method`` takes in this version."""

app = typer.Typer(
    name="sashimono",
    help="Plan how a robot assembles a product: sequence, motion and contact.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

InputPath = Annotated[
    Path, typer.Argument(metavar="INPUT", help=".step/.stp, a folder of .obj/.stl/.ply in place, .glb/.gltf or .3mf")
]
Unit = Annotated[str | None, typer.Option(metavar="UNIT", help="unit of INPUT where its format has none: mm, m, ...")]
Seed = Annotated[int, typer.Option(min=0, help="seed of every random choice")]


def main() -> None:
    """Run the command line and exit with its status."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: Sequence[str]) -> int:
    """Run the command line on these arguments and return the exit status."""
    try:
        status = app(list(arguments), prog_name="sashimono", standalone_mode=False)
    except SashimonoError as error:
        return _complain(str(error))
    except typer.TyperException as error:  # wrong command, option or value
        message = getattr(error, "format_message", error.__str__)()
        return _complain(f"{message.rstrip('.')}. Try 'sashimono --help'.")
    if status == INTERRUPTED:
        typer.echo("interrupted, nothing written", err=True)
    return status or OK


def _complain(message: str) -> int:
    typer.echo(f"sashimono: {' '.join(message.split())}", err=True)
    return BAD_INPUT


def _print_version(asked: bool) -> bool:
    if asked:
        typer.echo(f"sashimono {__version__}")
        raise typer.Exit
    return asked


@app.callback()
def _options(
    verbose: Annotated[int, typer.Option("-v", "--verbose", count=True, help="say more; twice for everything")] = 0,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    logging.basicConfig(stream=sys.stderr, format="%(name)s: %(message)s", level=logging.WARNING)
    logging.getLogger("sashimono").setLevel(level)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder to write into")] = Path("sashimono_demo"),
    seed: Seed = 0,
) -> int:
    """Plan the shipped example, a gearbox of 16 parts, and name the HTML page that shows it."""
    _refuse_unwritable(out)
    with as_file(files("sashimono") / "examples" / "gearbox.step") as example:
        return _plan_and_write(example, out, unit=None, seed=seed, copy_input=True)


@app.command()
def plan(
    source: InputPath,
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder for plan.json, plan.html and plan.glb")],
    unit: Unit = None,
    seed: Seed = 0,
    method: Annotated[str, typer.Option(help="how removals are found: cascade, or physics (Algorithm 1)")] = "cascade",
    gripper: Annotated[str, typer.Option(metavar="NAME", help="a gripper's name, or auto: in proportion")] = "auto",
    contacts: Annotated[bool, typer.Option("--contacts/--no-contacts", help="whether to choose grasps")] = True,
) -> int:
    """Plan the assembly of INPUT and verify it; write DIR/plan.json, DIR/plan.html and DIR/plan.glb."""
    if method not in METHODS:
        raise SashimonoError(f"--method {method} is not in this version. Choose one of: {', '.join(METHODS)}.")
    _refuse_unwritable(out)
    return _plan_and_write(source, out, unit=unit, seed=seed, method=method, gripper=gripper, contacts=contacts)


@app.command()
def verify(
    path: Annotated[Path, typer.Argument(metavar="PLAN", help="a plan.json")],
    source: Annotated[
        Path | None, typer.Option("--input", metavar="INPUT", help="the plan's input, where it has moved")
    ] = None,
) -> int:
    """Check a plan against its input, with none of the code that made it; print a line a step."""
    from sashimono.io.plan_json import read_plan
    from sashimono.verify import verify_file

    status = read_plan(path).status
    report = verify_file(path, source)
    for line in report.lines():
        typer.echo(line)
    if report.ok and status != "complete":
        typer.echo("the plan is partial: not every part has a step")
    return OK if report.ok and status == "complete" else NO_PLAN


@app.command()
def conditions(
    source: InputPath,
    json_file: Annotated[Path, typer.Option("--json", metavar="FILE", help="file to write")],
    unit: Unit = None,
    seed: Seed = 0,
) -> int:
    """Find what must be gone before each part can leave, and how many orders that allows."""
    import json

    import numpy as np

    from sashimono.bodies import make_bodies
    from sashimono.disassembly.separate import Cascade, SeparateConfig
    from sashimono.io.read import read_assembly

    if json_file.is_dir():
        raise SashimonoError(f"--json {json_file} is a folder. Name a file.")
    _refuse_unwritable(json_file.parent, option="--json")
    assembly = read_assembly(source, unit=unit)
    cascade = Cascade(assembly, make_bodies(assembly, rng=np.random.default_rng(seed)), config=SeparateConfig())
    found = cascade.conditions().as_dict()
    with _replacing_together(json_file.parent) as folder:
        (folder / json_file.name).write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    orders = "too many to count" if found["orders"] is None else found["orders"]
    typer.echo(f"{len(assembly)} parts, orders: {orders}; written: {json_file}")
    return OK


def _plan_and_write(
    source: Path,
    out: Path,
    *,
    unit: str | None,
    seed: int,
    method: str = "cascade",
    gripper: str = "auto",
    contacts: bool = True,
    copy_input: bool = False,
) -> int:
    from sashimono.console import progress_display, summary_lines
    from sashimono.contact.gripper import named_gripper
    from sashimono.io.read import read_assembly
    from sashimono.pipeline import PipelineConfig, plan_assembly

    named_gripper(gripper)
    assembly = read_assembly(source, unit=unit)
    for note in assembly.notes:
        typer.echo(f"note: {note}", err=True)
    with progress_display() as progress:
        config = PipelineConfig(
            method=cast("Literal['cascade', 'physics']", method), gripper=gripper, contacts=contacts
        )
        found = plan_assembly(assembly, config=config, seed=seed, progress=progress)
    _write(found, assembly, out, copied=source if copy_input else None)
    for line in summary_lines(found, assembly):
        typer.echo(line)
    typer.echo(f"written: {', '.join(str(out / name) for name in ('plan.json', 'plan.glb'))}")
    typer.echo(f"open in a browser: {(out / 'plan.html').resolve()}")
    return OK if found.status == "complete" else NO_PLAN


def _write(found: AssemblyPlan, assembly: Assembly, out: Path, *, copied: Path | None) -> None:
    """Write the plan, the page and the animation, all or none; if asked, with a copy of the input that it names."""
    from dataclasses import replace

    from sashimono.io.plan_json import write_plan
    from sashimono.view import write_glb, write_html

    with _replacing_together(out) as folder:
        if copied is not None:
            (folder / copied.name).write_bytes(copied.read_bytes())
            found = replace(found, source=replace(found.source, path=copied.name))
        write_html(found, assembly, folder / "plan.html")
        write_glb(found, assembly, folder / "plan.glb")
        write_plan(found, folder / "plan.json")


@contextmanager
def _replacing_together(out: Path) -> Iterator[Path]:
    """Yield a temporary folder within ``out``; move its files into ``out`` at the end, unless an error cut in."""
    made = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        try:
            with tempfile.TemporaryDirectory(dir=out, prefix=".sashimono-") as temporary:
                yield Path(temporary)
                for file in sorted(Path(temporary).iterdir()):
                    os.replace(file, out / file.name)
        except BaseException:
            if made:
                with suppress(OSError):  # not empty: some file had been moved already
                    out.rmdir()
            raise
    except OSError as error:
        _fail_to_write(error)


def _fail_to_write(error: OSError) -> NoReturn:
    raise SashimonoError(f"cannot write {error.filename}: {error.strerror}. Choose another folder.") from error


def _refuse_unwritable(out: Path, option: str = "--out") -> None:
    """Raise SashimonoError before any work if the folder cannot be made or written."""
    if out.exists() and not out.is_dir():
        raise SashimonoError(f"{option} {out} is a file. Name a folder.")
    existing = next(parent for parent in (out.absolute(), *out.absolute().parents) if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        raise SashimonoError(f"{option} {out}: {existing} is not a folder that can be written to. Choose another.")

"""The command line: ``sashimono demo | plan | verify | conditions | fasteners | explain | doctor | diff``.

Exit status: 0 complete and verified; 1 differs, or something stands in the way (diff, doctor); 2 bad usage or bad
input, with one line on standard error; 3 no complete plan (a partial one is written, with reasons); 130 interrupted.
The planner is imported inside the commands, so that help and usage errors come at once.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from sashimono import __version__
from sashimono.cli_common import (
    GRIPPERS,
    METHODS,
    UNITS,
    JsonLines,
    Quiet,
    Verbose,
    choices,
    command,
    listen,
    make_app,
)
from sashimono.cli_dataset import dataset_app
from sashimono.cli_learning import learning_app
from sashimono.cli_serve import serve_app
from sashimono.commands import (
    BAD_INPUT,
    DIFFERS,
    INTERRUPTED,
    NO_PLAN,
    OK,
    PLAN_FILES,
    SPLITS,
    plan_and_write,
    read_constraints,
    reading_options,
)
from sashimono.errors import SashimonoError
from sashimono.outputs import refuse_bad_files, refuse_unwritable, replacing_together, write_json
from sashimono.reporting import event, fresh_reporting, say

if TYPE_CHECKING:
    from sashimono.assembly import Assembly

app = make_app(name="sashimono", help="Plan how a robot assembles a product: sequence, motion and contact.")

app.add_typer(dataset_app, name="dataset")
app.add_typer(learning_app)
app.add_typer(serve_app)

_NAMED = ", ".join(GRIPPERS)

InputPath = Annotated[
    Path, typer.Argument(metavar="INPUT", help=".step/.stp, a folder of .obj/.stl/.ply in place, .glb/.gltf or .3mf")
]
OutFolder = Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for plan.json, .html and .glb")]
Unit = Annotated[
    str | None,
    typer.Option(
        metavar="UNIT",
        autocompletion=choices(*UNITS),
        help=f"unit of INPUT where its format has none: {', '.join(UNITS)}",
    ),
]
Split = Annotated[
    str,
    typer.Option(
        autocompletion=choices(*SPLITS),
        help="parts of several solids: apart where solids lie apart (auto), all apart (all), or none",
    ),
]
JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="write it as JSON too")]
PlanPath = Annotated[Path, typer.Argument(metavar="PLAN", help="a plan.json")]
PlanInput = Annotated[
    Path | None, typer.Option("--input", metavar="INPUT", help="the plan's input, where it has moved")
]
Seed = Annotated[int, typer.Option(min=0, help="seed of every random choice")]


def main() -> None:
    """Run the command line and exit with its status."""
    # modules and meshes live until the end: looking for garbage among them at every 700 objects costs a twelfth
    gc.set_threshold(50_000)
    # matrices are small: more threads of NumPy's would only wait for one another. It reads this when it is imported
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        status = run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough: not our failure, and nothing to say it to
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = OK
    except OSError as error:
        status = _complain(f"standard output cannot be written: {error.strerror}. Choose another place.")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(status)


def run(arguments: Sequence[str]) -> int:
    """Run the command line on these arguments and return the exit status. Bare, it shows its help."""
    with fresh_reporting():
        status = _status_of(list(arguments) or ["--help"])
        event("exit", status=status)
    return status


def _status_of(arguments: list[str]) -> int:
    try:
        status = app(arguments, prog_name="sashimono", standalone_mode=False)
    except SashimonoError as error:
        return _complain(str(error))
    except typer.TyperException as error:  # wrong command, option or value
        message = getattr(error, "format_message", error.__str__)()
        context = getattr(error, "ctx", None)
        if context is not None and message.startswith("Missing command"):
            say(context.get_help())
            return OK
        asked = "sashimono" if context is None else context.command_path
        return _complain(
            f"{message.replace('?.', '?').rstrip('.')}{'' if '?' in message else '.'} Try '{asked} --help'."
        )
    except MemoryError:
        return _complain("the input needs more memory than there is. Leave parts out, or make their meshes coarser.")
    if status == INTERRUPTED:
        typer.echo("interrupted, nothing written", err=True)
    return status or OK


def _complain(message: str) -> int:
    line = " ".join(message.split())
    typer.echo(f"sashimono: {line}", err=True)
    event("error", text=line)
    return BAD_INPUT


def _print_version(asked: bool) -> bool:
    if asked:
        typer.echo(f"sashimono {__version__}")
        raise typer.Exit
    return asked


@app.callback()
def _options(
    verbose: Verbose = 0,
    quiet: Quiet = False,
    json_lines: JsonLines = False,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    listen(verbose=verbose, quiet=quiet, json_lines=json_lines)


@command(app)
def demo(
    out: OutFolder = Path("sashimono_demo"),
    seed: Seed = 0,
) -> int:
    """Plan the shipped example, a gearbox of 16 parts, and name the HTML page that shows it."""
    refuse_unwritable(out, files=PLAN_FILES)
    with as_file(files("sashimono") / "examples" / "gearbox.step") as example:
        return plan_and_write(example, out, unit=None, seed=seed, copy_input=True)


@command(app)
def plan(
    source: InputPath,
    out: OutFolder,
    unit: Unit = None,
    split: Split = "auto",
    seed: Seed = 0,
    method: Annotated[
        str,
        typer.Option(
            autocompletion=choices(*METHODS),
            help="how removals are found: cascade, physics (Algorithm 1), or past (learned)",
        ),
    ] = "cascade",
    device: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="with --method physics: simulate on this Warp device (cuda:0, cpu)"),
    ] = None,
    gripper: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            autocompletion=choices("fingertips", "auto", *GRIPPERS),
            help=f"what holds the parts: fingertips, a gripper ({_NAMED}), a .json file, or auto: jaws in proportion",
        ),
    ] = "fingertips",
    grippers: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            autocompletion=choices("all", "none", *GRIPPERS, "vacuum-cup"),
            help=f"say of each step which of these can do it: all, none, or some ({_NAMED}, vacuum-cup)",
        ),
    ] = "none",
    contacts: Annotated[bool, typer.Option("--contacts/--no-contacts", help="whether to choose grasps")] = True,
    motion: Annotated[
        str, typer.Option(help="how parts get there: transit and the removal reversed, or rrt: RRT-Connect all the way")
    ] = "removal",
    base: Annotated[str | None, typer.Option(metavar="NAME", help="the part that everything is put on")] = None,
    up: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="away from the table, in the frame of INPUT")] = None,
    before: Annotated[
        list[str] | None,
        typer.Option(metavar="A:B", help="A is placed before B; repeatable; patterns (bolt*) stand for all that match"),
    ] = None,
    together: Annotated[
        list[str] | None,
        typer.Option(metavar="A,B", help="A and B, or more, are placed one after the other; repeatable; patterns too"),
    ] = None,
    exclude: Annotated[
        list[str] | None, typer.Option(metavar="PART", help="leave a part out; repeatable; a name or a pattern")
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="a product of INPUT's tree stays one part; repeatable; a name or a pattern"),
    ] = None,
    flat: Annotated[
        bool,
        typer.Option(
            "--flat", help="plan all parts side by side, bearings and all, whatever INPUT's product tree says"
        ),
    ] = False,
    stand_ins: Annotated[
        bool,
        typer.Option(
            "--stand-ins/--no-stand-ins",
            help="whether a part that is not closed is planned by a closed body that contains it, and flagged",
        ),
    ] = True,
    constraints: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="a .toml file with base, up, before, together, ...: the one beside a plan"),
    ] = None,
    resting: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="where parts wait: a .json file with a table and poses, or a plan.json"),
    ] = None,
    declare_threads: Annotated[
        bool,
        typer.Option(
            "--declare-threads/--no-declare-threads",
            help="whether screws drawn without ridges are turned in, at the standard pitch of their diameter",
        ),
    ] = False,
    declare_fits: Annotated[
        bool,
        typer.Option(
            "--declare-fits/--no-declare-fits",
            help="whether circlips, clips, snap arms and other elastic parts may give on their way, and are flagged",
        ),
    ] = True,
    hands: Annotated[int, typer.Option(min=1, metavar="N", help="hands there are to bring parts and to hold them")] = 2,
    explain_order: Annotated[
        bool, typer.Option("--explain-order", help="say of each step what else could have come, and why it did not")
    ] = False,
) -> int:
    """Plan the assembly of INPUT and verify it; write DIR/plan.json, DIR/plan.html and DIR/plan.glb."""
    if method not in METHODS:
        raise SashimonoError(f"--method {method} is not in this version. Choose one of: {', '.join(METHODS)}.")
    if motion not in ("removal", "rrt"):
        raise SashimonoError(f"--motion {motion} is not in this version. Choose one of: removal, rrt.")
    if device is not None and method != "physics":
        raise SashimonoError(f"--device {device} is for --method physics. Leave it out, or choose that method.")
    if device is not None:
        from sashimono.disassembly.physics.batch import find_device

        find_device(device)
    wishes = read_constraints(
        constraints,
        base=base,
        up=up,
        before=before or (),
        together=together or (),
        exclude=exclude or (),
        keep=keep or (),
        flat=flat,
    )
    if method == "physics" and (wishes.base is not None or wishes.before):
        raise SashimonoError("--base and --before are for --method cascade and past: Algorithm 1 takes its own order.")
    if method != "cascade" and wishes.together:
        raise SashimonoError(f"--together is for --method cascade: with {method}, no orders are compared.")
    if method != "cascade" and explain_order:
        raise SashimonoError(f"--explain-order is for --method cascade: with {method}, no orders are compared.")
    refuse_unwritable(out, files=PLAN_FILES)
    options = {
        "method": method,
        "device": device,
        "gripper": gripper,
        "grippers": grippers,
        "contacts": contacts,
    }
    options |= {
        "motion": motion,
        "resting": resting,
        "declare_threads": declare_threads,
        "declare_fits": declare_fits,
        "wishes": wishes,
        "hands": hands,
        "explain_order": explain_order,
    }
    options |= {"unit": unit, "split": split, "seed": seed, "stand_ins": stand_ins}
    return plan_and_write(source, out, **options)


@command(app)
def verify(
    path: PlanPath,
    source: PlanInput = None,
) -> int:
    """Check a plan against its input, with none of the code that made it; print a line a step."""
    from sashimono.verify import verify_file

    report = verify_file(path, source)
    for line in report.lines():
        say(line)
    return OK if report.ok and report.complete else NO_PLAN


@command(app)
def manual(
    path: PlanPath,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for manual.html and manual.pdf")],
    language: Annotated[str, typer.Option(metavar="CODE", help="en, de or ja")] = "en",
    pdf: Annotated[
        bool | None,
        typer.Option("--pdf/--no-pdf", help="whether to print the page with an installed Chromium; if there is one"),
    ] = None,
    source: PlanInput = None,
) -> int:
    """Write work instructions for a plan: a picture a step with its way in words, parts, tools, holds, warnings."""
    from sashimono.console import progress_display
    from sashimono.exports import write_instructions

    refuse_unwritable(out)
    with progress_display() as progress:
        written = write_instructions(path, out, language=language, pdf=pdf, source=source, progress=progress)
    for file in written:
        say(f"written: {file}" if file.suffix == ".pdf" else f"open in a browser: {file.resolve()}")
    return OK


@command(app)
def export(
    path: PlanPath,
    bom: Annotated[Path | None, typer.Option(metavar="FILE", help="the bill of materials, as .csv or .xlsx")] = None,
    steps: Annotated[Path | None, typer.Option(metavar="FILE", help="a line a step, as .csv or .xlsx")] = None,
    mjcf: Annotated[
        Path | None, typer.Option(metavar="DIR", help="a scene for MuJoCo, scene.xml, with a keyframe a step")
    ] = None,
    mtc: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="a script for the MoveIt Task Constructor, assemble.py, and its data"),
    ] = None,
    clip: Annotated[
        Path | None, typer.Option(metavar="FILE", help="a moving picture of the ways in, as .webp (the render extra)")
    ] = None,
    step: Annotated[
        str | None, typer.Option(metavar="N", help="with --clip: of this step only; inside a subassembly 3.1")
    ] = None,
    source: PlanInput = None,
) -> int:
    """Write tables of a plan [mm], a scene for a simulator, a task for MoveIt, or a moving picture of a step."""
    from sashimono.console import progress_display
    from sashimono.exports import write_clip, write_scene, write_tables, write_task

    files = {"--bom": bom, "--steps": steps}
    refuse_bad_files({**files, "--clip": clip})
    folders = {"--mjcf": (mjcf, write_scene), "--mtc": (mtc, write_task)}
    for option, (folder, _) in folders.items():
        if folder is not None:
            refuse_unwritable(folder, option=option)
    if step is not None and clip is None:
        raise SashimonoError("--step is for --clip. Give --clip FILE too.")
    if not any((*files.values(), mjcf, mtc, clip)):
        raise SashimonoError("nothing to write. Give one of: --bom, --steps, --mjcf, --mtc, --clip.")
    written: tuple[Path, ...] = ()
    for folder, write in folders.values():
        if folder is not None:
            written += write(path, folder, source=source)[:1]
    if clip is not None:
        with progress_display() as progress:
            written += (write_clip(path, clip, step=step, source=source, progress=progress),)
    if any(files.values()):
        written += write_tables(path, files, source=source)
    for file in written:
        say(f"written: {file}")
    return OK


@command(app)
def conditions(
    source: InputPath,
    json_file: JsonFile = None,
    graph_file: Annotated[
        Path | None, typer.Option("--graph", metavar="FILE", help="also write the AND/OR graph of subassemblies")
    ] = None,
    thorough: Annotated[
        int, typer.Option(min=0, metavar="N", help="sets a part for which more than one translation is searched")
    ] = 64,
    unit: Unit = None,
    split: Split = "auto",
    seed: Seed = 0,
) -> int:
    """Find what must be gone before each part can leave, how many orders that allows, and how many fasteners leave."""
    from sashimono.disassembly.conditions.added import added_as_dict
    from sashimono.disassembly.conditions.and_or import and_or_graph
    from sashimono.disassembly.conditions.orders import conditions_as_dict
    from sashimono.fasteners.precedence import precedence
    from sashimono.fasteners.recognise import find_fasteners
    from sashimono.io.read import read_assembly
    from sashimono.tasks import find_conditions

    targets = {"--json": json_file, "--graph": graph_file}
    refuse_bad_files(targets)
    assembly = read_assembly(source, unit=unit, config=reading_options(split))
    found = find_conditions(assembly, thorough=thorough, seed=seed)
    written = conditions_as_dict(found)
    added = added_as_dict(found, precedence(assembly, find_fasteners(assembly)))
    if added["precedence"]:
        written["fasteners"] = added
    if json_file is not None:
        write_json(json_file, written)
    if graph_file is not None:
        write_json(graph_file, and_or_graph(found).as_dict())
    names = ", ".join(str(path) for path in targets.values() if path is not None)
    say(f"{len(assembly)} parts, orders: {_orders_in_words(written)}{f'; written: {names}' if names else ''}")
    for before, after in cast("list[list[str]]", written["precedence"]):
        say(f"  {before} before {after}")
    if stuck := cast("list[str]", written["stuck"]):
        say(f"never come apart: {', '.join(stuck)}")
    pairs = cast("list[list[str]]", added["precedence"])
    if pairs:
        say(f"with fasteners, {len(pairs)} precedences more: orders: {_orders_in_words(written | added)}")
        for before, after in pairs:
            say(f"  {before} before {after}")
    return OK


@command(app)
def fasteners(
    source: InputPath,
    json_file: JsonFile = None,
    unit: Unit = None,
    split: Split = "auto",
) -> int:
    """List screws, bolts, nuts, washers, pins, standoffs and circlips, recognised by shape and place."""
    from sashimono.fasteners.recognise import find_fasteners
    from sashimono.fasteners.report import fastener_lines, fasteners_as_dict
    from sashimono.io.read import read_assembly

    refuse_bad_files({"--json": json_file})
    assembly = read_assembly(source, unit=unit, config=reading_options(split))
    found = find_fasteners(assembly)
    for line in fastener_lines(found):
        say(line)
    say(f"{len(assembly)} parts, {len(found)} fasteners")
    if json_file is not None:
        write_json(json_file, fasteners_as_dict(found))
    return OK


def _orders_in_words(written: Mapping[str, object]) -> str:
    if written["orders"] is None:
        return f"unknown ({written['orders_reason']})"
    if not written["cut_short"]:
        return str(written["orders"])
    return f"at least {written['orders']}" if written["orders"] else "none found"


@command(app)
def doctor(
    source: InputPath,
    json_file: JsonFile = None,
    html_file: Annotated[Path | None, typer.Option("--html", metavar="FILE", help="show it in 3D, in one page")] = None,
    unit: Unit = None,
    split: Split = "auto",
    exclude: Annotated[
        list[str] | None, typer.Option(metavar="PART", help="leave a part out; repeatable; a name or a pattern")
    ] = None,
) -> int:
    """Look at INPUT before it is planned: size and unit, open parts, overlaps, what floats, hides, is there twice.

    Exit status 0 if nothing stands in the way of a plan, 1 if something does.
    """
    from dataclasses import replace

    from sashimono.examination import diagnosis_as_dict, diagnosis_lines, examine
    from sashimono.io.read import inspect_assembly

    refuse_bad_files({"--json": json_file, "--html": html_file})
    options = replace(reading_options(split), exclude=tuple(exclude or ()))
    found = examine(inspect_assembly(source, unit=unit, config=options))
    for line in diagnosis_lines(found):
        say(line)
    if json_file is not None:
        write_json(json_file, diagnosis_as_dict(found))
    if html_file is not None:
        from sashimono.view import write_diagnosis

        with replacing_together(html_file.parent) as folder:
            write_diagnosis(found, folder / html_file.name)
        say(f"open in a browser: {html_file.resolve()}")
    return OK if found.ok else DIFFERS


@command(app)
def diff(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="before: a plan.json, or what 'plan' takes")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="after: likewise")],
    json_file: JsonFile = None,
    unit: Unit = None,
) -> int:
    """Say what changed between two revisions or plans, and whether the old plan still works.

    Exit status 0 if nothing changed, 1 if something did, 3 if the old plan does not work any more.
    """
    from sashimono.revision import compare, read_side, revision_as_dict, revision_lines

    refuse_bad_files({"--json": json_file})
    before = read_side(old, unit=unit)
    found = compare(before, read_side(new, unit=unit, like=before))
    for line in revision_lines(found):
        say(line)
    if json_file is not None:
        write_json(json_file, revision_as_dict(found))
    if found.holds is False:
        return NO_PLAN
    return OK if found.same else DIFFERS


@command(app)
def explain(
    source: InputPath,
    part: Annotated[str | None, typer.Option(metavar="NAME", help="the part; if not given, all that are stuck")] = None,
    fixed: Annotated[
        str | None, typer.Option(metavar="NAMES", help="the parts that stay, separated by commas; else all others")
    ] = None,
    json_file: JsonFile = None,
    html_file: Annotated[Path | None, typer.Option("--html", metavar="FILE", help="show it in 3D, in one page")] = None,
    unit: Unit = None,
    split: Split = "auto",
    seed: Seed = 0,
) -> int:
    """Say why a part cannot leave: what stops it where, what must go first, what change would free it.

    Exit status 0 if it can leave, 3 if not.
    """
    from sashimono import tasks
    from sashimono.disassembly.explanation.report import explanation_lines, explanations_as_dict
    from sashimono.io.read import read_assembly
    from sashimono.plan import Answer
    from sashimono.view import write_explanation

    refuse_bad_files({"--json": json_file, "--html": html_file})
    assembly = read_assembly(source, unit=unit, config=reading_options(split))
    staying = None if fixed is None else _names_in(fixed, assembly, option="--fixed")
    if part is not None and part not in assembly.names:
        raise SashimonoError(f"--part: {tasks.no_such_part(part, assembly)}")
    found = tasks.explain(assembly, part, staying, seed=seed)
    for line in (line for entry in found for line in explanation_lines(entry)):
        say(line)
    if not found:
        say("every part can leave" + ("" if staying is None else " these fixed ones"))
    if json_file is not None:
        write_json(json_file, explanations_as_dict(found))
    if html_file is not None:
        with replacing_together(html_file.parent) as folder:
            write_explanation(found, assembly, folder / html_file.name)
        say(f"open in a browser: {html_file.resolve()}")
    return OK if all(entry.answer is Answer.FREE for entry in found) else NO_PLAN


def _names_in(text: str, assembly: Assembly, *, option: str) -> list[str]:
    """Split names at commas, unless the whole is one name; SashimonoError for those that the assembly has not."""
    from sashimono.tasks import no_such_part

    names = [text] if text in assembly.names else [name.strip() for name in text.split(",") if name.strip()]
    for name in names or [text]:
        if name not in assembly.names:
            raise SashimonoError(f"{option}: {no_such_part(name, assembly)}")
    return names

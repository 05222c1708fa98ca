"""What is made of a finished plan: work instructions, tables, a scene. One call each, from plan.json to files."""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.errors import SashimonoError
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.io.plan_input import read_plan_input
from sashimono.io.plan_json import read_plan
from sashimono.outputs import replacing_together
from sashimono.plan import AssemblyPlan, Step
from sashimono.view.clip import clip_steps, render_clip
from sashimono.view.manual import LANGUAGES, bill_of_materials, find_browser, print_page, write_manual
from sashimono.view.manual.pdf import no_browser_words
from sashimono.view.mjcf import write_mjcf
from sashimono.view.mtc import write_mtc

_log = logging.getLogger(__name__)

Cell = str | int | float
"""What stands in a table."""
FORMATS = (".csv", ".xlsx")
"""What tables are written as, by the ends of their names."""


def read_plan_and_input(path: Path, source: Path | None = None) -> tuple[AssemblyPlan, Assembly]:
    """Return a plan and the geometry of its parts.

    Raises PlanFormatError for a broken plan, InputError where its input is missing, and SashimonoError where the input
    lacks one of the plan's parts.
    """
    plan = read_plan(path)
    assembly = read_plan_input(plan, path, source)
    if missing := [name for name in plan.parts if name not in assembly.names]:
        raise SashimonoError(f"{path}: the input has no part {missing[0]!r}. Name the right one with --input.")
    if absent := [name for name in assembly.names if name not in plan.parts]:
        raise SashimonoError(f"{path}: the plan has no part {absent[0]!r}, but its input has. Plan again.")
    return plan, assembly


def write_instructions(
    path: Path,
    out: Path,
    *,
    language: str = "en",
    pdf: bool | None = None,
    source: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Path, ...]:
    """Write the work instructions of a plan, and return the files: manual.html, and manual.pdf if it was printed.

    Args:
        path: The plan.json.
        out: The folder to write into.
        language: A code of `LANGUAGES`.
        pdf: Whether the page is printed too; None: if a browser is installed.
        source: The plan's input, where it has moved.
        progress: Called with "pictures", how many are done, and of how many.

    Raises SashimonoError for what cannot be read, an unknown language, or a PDF that is wanted where none can be made.
    """
    if language not in LANGUAGES:
        raise SashimonoError(f"--language {language} is not known. Choose one of: {', '.join(LANGUAGES)}.")
    if pdf is None and find_browser() is None:
        _log.warning("%s", no_browser_words(out / "manual.html"))
    if pdf and find_browser() is None:
        raise SashimonoError(f"--pdf: {no_browser_words('manual.html')}.")
    plan, assembly = read_plan_and_input(path, source)
    names = ["manual.html"]
    drawn = None if progress is None else partial(progress, "pictures")
    with replacing_together(out) as folder:
        write_manual(plan, assembly, folder / "manual.html", language=language, progress=drawn)
        if pdf or (pdf is None and find_browser() is not None):
            names.append(print_page(folder / "manual.html", folder / "manual.pdf").name)
    return tuple(out / name for name in names)


def write_tables(path: Path, wanted: Mapping[str, Path | None], *, source: Path | None = None) -> tuple[Path, ...]:
    """Write tables of a plan as CSV or XLSX, and return the files.

    Args:
        path: The plan.json.
        wanted: The files by option: ``--bom`` for the bill of materials, ``--steps`` for the steps; None for none.
        source: The plan's input, where it has moved.

    Raises SashimonoError where nothing is wanted, for an unknown ending, and for what cannot be read or written.
    """
    files = {option: file for option, file in wanted.items() if file is not None}
    if not files:
        raise SashimonoError(f"nothing to write. Give one of: {', '.join(wanted)}.")
    for option, file in files.items():
        if file.suffix.lower() not in FORMATS:
            raise SashimonoError(f"{option} {file}: not a table that can be written. End it in {' or '.join(FORMATS)}.")
    if any(file.suffix.lower() == ".xlsx" for file in files.values()) and find_spec("xlsxwriter") is None:
        raise SashimonoError(
            "writing .xlsx needs XlsxWriter. Install it: pip install 'sashimono[tables]', or end in .csv."
        )
    plan, assembly = read_plan_and_input(path, source)
    fasteners = find_fasteners(assembly)
    tables = {"--bom": bill_table, "--steps": step_table}
    for option, file in files.items():
        rows = tables[option](plan, assembly, fasteners)
        content = _xlsx_bytes(rows) if file.suffix.lower() == ".xlsx" else _csv_bytes(rows)
        with replacing_together(file.parent) as folder:
            (folder / file.name).write_bytes(content)
    return tuple(files.values())


def write_scene(path: Path, out: Path, *, source: Path | None = None) -> tuple[Path, ...]:
    """Write a plan as an MJCF scene with a keyframe a step, scene.xml and an OBJ a part, and return the files.

    Args:
        path: The plan.json.
        out: The folder to write into.
        source: The plan's input, where it has moved.

    Raises SashimonoError for what cannot be read or written.
    """
    return _write_folder(write_mjcf, path, out, source)


def write_task(path: Path, out: Path, *, source: Path | None = None) -> tuple[Path, ...]:
    """Write a plan for the MoveIt Task Constructor: assemble.py, steps.json and an OBJ a part; return the files.

    Args:
        path: The plan.json.
        out: The folder to write into.
        source: The plan's input, where it has moved.

    Raises SashimonoError for what cannot be read or written.
    """
    return _write_folder(write_mtc, path, out, source)


def _write_folder(
    write: Callable[[AssemblyPlan, Assembly, Path], Sequence[str]], path: Path, out: Path, source: Path | None
) -> tuple[Path, ...]:
    """Write a plan's files into a folder, all or none, and return them."""
    plan, assembly = read_plan_and_input(path, source)
    with replacing_together(out) as folder:
        names = write(plan, assembly, folder)
    return tuple(out / name for name in names)


def write_clip(
    path: Path,
    file: Path,
    *,
    step: str | None = None,
    source: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Path:
    """Write an animated WebP of the way in of a step, or of all, and return the file.

    Args:
        path: The plan.json.
        file: Ends in .webp.
        step: The step's number ("3", or "3.1" inside a subassembly); None for all steps.
        source: The plan's input, where it has moved.
        progress: Called with "pictures", how many are done, and of how many.

    Raises SashimonoError for another ending, a step that there is not, where Pillow is missing, and for what cannot be
    read or written.
    """
    if file.suffix.lower() != ".webp":
        raise SashimonoError(f"--clip {file}: not a clip that can be written. End it in .webp.")
    if find_spec("PIL") is None:
        raise SashimonoError("clips need Pillow. Install it: pip install 'sashimono[render]'.")
    plan, assembly = read_plan_and_input(path, source)
    drawn = None if progress is None else partial(progress, "pictures")
    content = render_clip(plan, assembly, clip_steps(plan, assembly, step), progress=drawn)
    with replacing_together(file.parent) as folder:
        (folder / file.name).write_bytes(content)
    return file


def bill_table(plan: AssemblyPlan, assembly: Assembly, fasteners: Sequence[Fastener]) -> list[list[Cell]]:
    """Return the bill of materials, its head first; sizes are edges of the part's box [mm], longest first.

    ``products`` are those of the input's tree that the parts are in, from the outer to the inner ("drive / motor").
    """
    head: list[Cell] = [
        "number", "part", "quantity", "names", "products", "kind", "size", "tool", "length_mm", "width_mm", "height_mm",
    ]  # fmt: skip
    rows = [head]
    kept = {entry.product: entry.reason for entry in plan.source.kept}
    for row in bill_of_materials(plan, assembly, fasteners):
        own = row.fastener
        rows.append(
            [
                row.number, row.label, len(row.names), " ".join(row.names), _products_of(row.names, assembly),
                kept.get(row.names[0], "") if own is None else own.kind,
                "" if own is None else own.size, _tool(own), *(round(1e3 * float(edge), 3) for edge in row.size),
            ]
        )  # fmt: skip
    return rows


def step_table(plan: AssemblyPlan, assembly: Assembly, fasteners: Sequence[Fastener]) -> list[list[Cell]]:
    """Return a line for each step, its head first; those inside a subassembly stand before its own step."""
    kinds = {fastener.part: fastener for fastener in fasteners}
    head: list[Cell] = [
        "step", "part", "product", "parts", "direction_x", "direction_y", "direction_z", "length_mm", "turns",
        "contact", "tool", "held", "hands", "note",
    ]  # fmt: skip
    return [head, *_step_rows(plan.steps, "", kinds)]


def _step_rows(steps: Sequence[Step], prefix: str, kinds: Mapping[str, Fastener]) -> list[list[Cell]]:
    rows: list[list[Cell]] = []
    for k, step in enumerate(steps, start=1):
        if step.subassembly is not None:
            rows += _step_rows(step.subassembly.steps, f"{prefix}{k}.", kinds)
        way: list[Cell] = ["", "", "", "", ""]
        if step.direction is not None:
            way = [round(float(x), 6) + 0.0 for x in step.direction]
            way += [round(1e3 * step.length, 4), round(step.turns, 4) + 0.0]
        rows.append(
            [
                f"{prefix}{k}", step.part, step.product or "", " ".join(step.members), *way,
                step.moved_by if step.moves else "base",
                "" if step.moving else _tool(kinds.get(step.part)), " ".join(step.held),
                "" if step.hands is None else step.hands, _note(step),
            ]
        )  # fmt: skip
    return rows


def _note(step: Step) -> str:
    said = ["the product is turned over before"] if step.turned else []
    said += [f"then held: {' '.join(step.held_before)}"] if step.held_before else []
    said += [f"at the same time as {' '.join(step.simultaneous)}"] if step.simultaneous else []
    said += (
        [f"close fit with {' '.join(dict.fromkeys(fit.other for fit in step.close_fits))}"] if step.close_fits else []
    )
    reasons = (step.contact_reason, step.tool and step.tool.reason)
    return "; ".join([*said, *(reason for reason in reasons if reason)])


def _products_of(names: Sequence[str], assembly: Assembly) -> str:
    """The products around these parts, each once."""
    around = (" / ".join(p.name for p in assembly.products if name in p.parts) for name in names)
    return "; ".join(dict.fromkeys(path for path in around if path))


def _tool(fastener: Fastener | None) -> str:
    return "" if fastener is None or fastener.tool == "none" else fastener.tool


def _csv_bytes(rows: Sequence[Sequence[Cell]]) -> bytes:
    """Return CSV (RFC 4180) as UTF-8, marked as such: spreadsheets guess otherwise."""
    text = io.StringIO()
    csv.writer(text).writerows([[_safe(cell) for cell in row] for row in rows])
    return text.getvalue().encode("utf-8-sig")


def _xlsx_bytes(rows: Sequence[Sequence[Cell]]) -> bytes:
    """Return a workbook of one sheet, its head bold and always in view."""
    import xlsxwriter

    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, {"in_memory": True}) as book:
        book.set_properties({"created": datetime(2000, 1, 1)})  # the same rows give the same bytes
        sheet, bold = book.add_worksheet("plan"), book.add_format({"bold": True})
        for r, row in enumerate(rows):
            for c, cell in enumerate(row):
                look = bold if r == 0 else None
                if isinstance(cell, str):
                    sheet.write_string(r, c, cell, look)
                else:
                    sheet.write_number(r, c, cell, look)
        sheet.freeze_panes(1, 0)
        sheet.autofit()
    return buffer.getvalue()


def _safe(cell: Cell) -> Cell:
    """Text that a spreadsheet would run as a formula, quoted; part names come from anybody's CAD."""
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@", "\t", "\r") else cell

"""``sashimono dataset make | stats | show | export | check``: D4PAS from the command line."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from sashimono.cli_common import command, make_app
from sashimono.commands import INTERRUPTED, NO_PLAN, OK, plan_and_write
from sashimono.errors import SashimonoError
from sashimono.outputs import refuse_bad_files, refuse_unwritable, write_json
from sashimono.reporting import event, reporting, say

dataset_app = make_app(help="Make and look at D4PAS, the dataset of assemblies with exact labels.")

DatasetPath = Annotated[
    str, typer.Option("--from", metavar="DATASET", help="a dataset's folder, or v1: the shipped one")
]


@command(dataset_app)
def make(
    recipe: Annotated[str, typer.Argument(metavar="RECIPE", help="v1, tiny, a TOML file, or a folder of assemblies")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder to write into")],
    workers: Annotated[int | None, typer.Option(min=1, metavar="N", help="processes; 1 if not given")] = None,
    limit: Annotated[int | None, typer.Option(min=1, metavar="N", help="only the first N blueprints")] = None,
    ray: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="spread over the Ray cluster at this address (auto: the local one)"),
    ] = None,
) -> int:
    """Make a dataset; run the same command again to go on where it was stopped. Exit status 3 if nothing was made."""
    from sashimono.d4pas.make import make_dataset

    refuse_unwritable(out)
    run = None
    if ray is not None:
        if workers is not None:
            raise SashimonoError("--workers and --ray exclude one another: the cluster has its own. Give one of them.")
        from sashimono.d4pas.ray_workers import ray_runner

        run = ray_runner(ray)
    try:
        with _progress("blueprints") as progress:
            made = make_dataset(recipe, out, workers=workers or 1, limit=limit, run=run, progress=progress)
    except KeyboardInterrupt:
        typer.echo("interrupted; the same command goes on from here", err=True)
        return INTERRUPTED
    say(
        f"{made.blueprints} blueprints, {made.sequences} sequences, {made.failures} failed (failures.parquet);"
        f" content hash {made.content_hash[:16]}"
    )
    say(f"written: {out}")
    return OK if made.blueprints else NO_PLAN


@command(dataset_app)
def stats(
    dataset: Annotated[
        str, typer.Argument(metavar="DATASET", help="a dataset's folder, or v1: the shipped one")
    ] = "v1",
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="write it as JSON too")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="counts only: no geometry is made, no order tried")] = False,
    most: Annotated[
        int | None, typer.Option("--most", min=1, metavar="N", help="measure only so many blueprints of each family")
    ] = None,
) -> int:
    """Print what a dataset holds, how its orders are structured, and what needs no learning."""
    from sashimono.d4pas import load
    from sashimono.d4pas.stats import by_family, family_lines, nearest_neighbours, summary, summary_lines

    refuse_bad_files({"--json": json_file})
    data = load(dataset)
    found = summary(data)
    for line in summary_lines(found):
        say(line)
    gaps = nearest_neighbours(data)
    for split, values in gaps.items():
        words = ", ".join(f"{name} {value:.3f}" for name, value in values.items())
        say(f"distance to the nearest training blueprint, {split}: {words}")
    written = {"summary": found, "nearest_neighbours": gaps}
    if not quick:
        with _progress("blueprints measured") as progress:
            rows = by_family(data, most=most, progress=lambda done, total: progress(done, total, 0))
        for line in family_lines(rows):
            say(line)
        written["families"] = rows
    if json_file is not None:
        write_json(json_file, written)
    return OK


@command(dataset_app)
def show(
    blueprint: Annotated[str, typer.Argument(metavar="ID", help="a blueprint's id")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for the plan and its page")] = Path(
        "sashimono_blueprint"
    ),
    dataset: DatasetPath = "v1",
    seed: Annotated[int, typer.Option(min=0, help="seed of the plan")] = 0,
) -> int:
    """Plan a blueprint and write the page that plays it, with its labels in words."""
    import tempfile

    from sashimono.d4pas import load
    from sashimono.d4pas.export import export_obj

    refuse_unwritable(out)
    found = load(dataset)[blueprint]
    orders = "not counted" if found.orders is None else f"{found.orders} orders"
    proven = "proven complete" if found.complete else "maybe not all"
    say(f"{found.id}: {len(found)} parts, {orders}, conditions {proven}, split {found.split}")
    for name, clauses in zip(found.parts, found.masks, strict=True):
        words = [", ".join(n for k, n in enumerate(found.parts) if clause >> k & 1) for clause in clauses]
        say(f"  {name} {'can leave at once' if '' in words else 'leaves after ' + ', or after '.join(words)}")
    parts = out / "parts"
    if parts.is_dir() and any(parts.iterdir()):
        with tempfile.TemporaryDirectory() as folder:
            fresh = {path.name: path.read_bytes() for path in export_obj(found.assembly(), Path(folder))}
        if {path.name: path.read_bytes() for path in parts.iterdir()} != fresh:
            raise SashimonoError(f"--out {out}: {parts} holds another product; name another folder")
    else:
        export_obj(found.assembly(), parts)
    return plan_and_write(parts, out, unit="mm", seed=seed)


@command(dataset_app)
def export(
    blueprint: Annotated[str, typer.Argument(metavar="ID", help="a blueprint's id")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder to write into")],
    dataset: DatasetPath = "v1",
) -> int:
    """Write a blueprint's parts, one OBJ each, in place, in millimetres."""
    from sashimono.d4pas import load
    from sashimono.d4pas.export import export_obj

    refuse_unwritable(out)
    files = export_obj(load(dataset)[blueprint].assembly(), out)
    say(f"written: {len(files)} files in {out}")
    return OK


@command(dataset_app)
def check(
    dataset: Annotated[
        str, typer.Argument(metavar="DATASET", help="a dataset's folder, or v1: the shipped one")
    ] = "v1",
    sample: Annotated[int, typer.Option(min=0, metavar="N", help="blueprints drawn at random; 0: all")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="seed of the draw")] = 0,
) -> int:
    """Make blueprints again and check their labels, motions and contacts independently. Exit status 3 for any fault."""
    from sashimono.d4pas import load
    from sashimono.d4pas.check import check_dataset

    data = load(dataset)
    with _progress("blueprints checked") as progress:
        done = check_dataset(
            data, sample=sample or None, seed=seed, progress=lambda count, total: progress(count, total, 0)
        )
    for problem in done.problems:
        say(problem)
    say(
        f"{done.blueprints} blueprints, {done.motions} motions, {done.contacts} contacts:"
        f" {len(done.problems) or 'no'} problem{'s' if len(done.problems) != 1 else ''}"
    )
    return NO_PLAN if done.problems else OK


@contextmanager
def _progress(what: str) -> Iterator[Callable[[int, int, int], None]]:
    """Yield a callback for (done, total, failed): a bar on a terminal, else a line every half minute, or JSON."""
    start, first, last = time.monotonic(), [-1], [time.monotonic()]
    wanted = reporting()
    show_bar = sys.stderr.isatty() and not (wanted.quiet or wanted.json_lines)

    def update(done: int, total: int, failed: int) -> None:
        event("progress", stage=what, done=done, total=total, failed=failed)
        if wanted.quiet or wanted.json_lines:
            return
        now = time.monotonic()
        if first[0] < 0:
            first[0] = done
        if done != total and now - last[0] < (0.2 if show_bar else 30.0):
            return
        last[0] = now
        rate = (done - first[0]) / max(now - start, 1e-9)
        left = f", {_clock((total - done) / rate)} left" if rate > 0.0 and done < total else ""
        line = f"{done} of {total} {what}, {failed} failed, {rate:.2f} a second{left}"
        sys.stderr.write(f"\r{line:<90}" if show_bar else line + "\n")
        sys.stderr.flush()

    try:
        yield update
    finally:
        if show_bar:
            sys.stderr.write("\n")


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"

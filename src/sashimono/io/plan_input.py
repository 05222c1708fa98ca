"""The input that a plan was made from, found and read again."""

from __future__ import annotations

import glob
from collections.abc import Iterator
from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.errors import InputError
from sashimono.io.raw import ReadConfig
from sashimono.io.read import read_assembly
from sashimono.plan import AssemblyPlan


def read_plan_input(plan: AssemblyPlan, plan_path: str | Path, input_path: str | Path | None = None) -> Assembly:
    """Return the assembly that a plan speaks of, read with the plan's own options.

    The input is ``input_path``, or the plan's ``source.path``, relative to the plan's folder or to the current one:
    whichever has the right hash; if none has, the first that is there.
    Raises InputError where the input is missing or unusable.
    """
    stated = Path(input_path if input_path is not None else plan.source.path)
    candidates = [stated] if input_path is not None else [Path(plan_path).parent / stated, stated]
    found = [path for path in candidates if path.exists()]
    if not found:
        raise InputError(f"{plan_path}: its input {stated} is not there. Name it with --input.")
    options = ReadConfig(
        split=plan.source.split,
        exclude=tuple(map(glob.escape, plan.source.excluded)),
        kept=plan.source.kept,
        stand_ins=bool(plan.source.stand_ins),
    )
    assemblies = (read_assembly(path, unit=plan.source.unit, config=options) for path in found)
    return _matching(assemblies, plan.source.sha256)


def _matching(assemblies: Iterator[Assembly], sha256: str) -> Assembly:
    """Return the first assembly with this hash, else the first; reads no more than it must."""
    first = next(assemblies)
    if first.source is not None and first.source.sha256 == sha256:
        return first
    others = (other for other in assemblies if other.source is not None and other.source.sha256 == sha256)
    return next(others, first)

"""Either side of a comparison: a CAD file or folder, or a plan with the input that it was made for."""

from __future__ import annotations

import glob
from dataclasses import dataclass
from pathlib import Path

from sashimono.assembly import Assembly, Source
from sashimono.errors import InputError
from sashimono.io.plan_json import read_plan
from sashimono.io.raw import ReadConfig
from sashimono.io.read import read_assembly
from sashimono.plan import AssemblyPlan


@dataclass(frozen=True, kw_only=True, eq=False)
class Side:
    """One of the two things that are compared."""

    path: str
    plan: AssemblyPlan | None
    """None if it is no plan."""
    assembly: Assembly | None
    """The geometry; None if it is a plan whose input is not there any more, or is another by now."""
    note: str = ""
    """Why the geometry is not there."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its parts."""
        return self.assembly.names if self.assembly is not None else tuple(self.plan.parts if self.plan else ())


def read_side(path: str | Path, *, unit: str | None = None, like: Side | None = None) -> Side:
    """Return one side of a comparison.

    Raises InputError or PlanFormatError for what cannot be used.

    Args:
        path: A plan (``.json``), or what `sashimono.io.read.read_assembly` takes.
        unit: Of mesh files.
        like: The other side: if it is a plan, a CAD file is read as the plan's input was.
    """
    path = Path(path)
    if path.suffix.lower() == ".json" and not path.is_dir():
        return _read_plan_side(path)
    asked = like.plan.source if like is not None and like.plan is not None else None
    options = ReadConfig() if asked is None else _options(asked, leave_out=False)
    stated = unit if unit is not None or asked is None else asked.unit
    assembly = read_assembly(path, unit=stated, config=options)
    if asked is not None and asked.excluded:
        present = tuple(glob.escape(name) for name in asked.excluded if name in assembly.names)
        assembly = read_assembly(path, unit=stated, config=ReadConfig(split=asked.split, exclude=present))
    return Side(path=str(path), plan=None, assembly=assembly)


def _options(source: Source, *, leave_out: bool = True) -> ReadConfig:
    excluded = tuple(map(glob.escape, source.excluded)) if leave_out else ()
    return ReadConfig(split=source.split, exclude=excluded)


def _read_plan_side(path: Path) -> Side:
    plan = read_plan(path)
    stated = Path(plan.source.path)
    found = [each for each in (path.parent / stated, stated) if plan.source.path and each.exists()]
    note = f"its input {plan.source.path or '(unnamed)'} is not there"
    for candidate in found:
        try:
            assembly = read_assembly(candidate, unit=plan.source.unit, config=_options(plan.source))
        except InputError as error:
            note = f"its input cannot be read: {error}"
            continue
        if assembly.source is not None and assembly.source.sha256 == plan.source.sha256:
            return Side(path=str(path), plan=plan, assembly=assembly)
        note = f"its input {candidate} is not the one that was planned"
    return Side(path=str(path), plan=plan, assembly=None, note=note)

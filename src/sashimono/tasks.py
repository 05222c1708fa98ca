"""What the commands do, as functions: each of them one call from an assembly to an answer or to files."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.contact import Gripper, gripper_from_fields
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.explanation.explain import ExplainConfig, Explanation, explain_part, explain_stuck
from sashimono.errors import SashimonoError
from sashimono.examination import Diagnosis, DoctorConfig, examine
from sashimono.io.constraints_file import Wishes, wishes_to_toml
from sashimono.io.raw import ReadConfig
from sashimono.io.read import inspect_assembly
from sashimono.outputs import replacing_together
from sashimono.plan import AssemblyPlan
from sashimono.revision import Revision, compare, read_side

THOROUGH = 64
"""Sets of obstacles a part for which more than one translation is searched, unless a number is given."""


def make_cascade(assembly: Assembly, *, config: SeparateConfig | None = None, seed: int = 0) -> Cascade:
    """Return what answers separation questions about an assembly: can this part leave these others, and how?

    `Cascade.separate` answers one question; see `find_conditions` for all of them, and `explain` for reasons.
    """
    bodies = make_bodies(assembly, rng=np.random.default_rng(seed))
    return Cascade(assembly, bodies, config=config or SeparateConfig())


def find_conditions(
    assembly: Assembly, *, thorough: int = THOROUGH, reachable_only: bool = False, seed: int = 0
) -> RemovalConditions:
    """Return what must be gone before each part can leave: for each part, minimal sets of parts, with a motion each.

    The conditions are exact for single translations. ``cut_short`` names the parts that may have more clauses.

    Args:
        assembly: Parts in their assembled poses.
        thorough: Sets of obstacles a part for which more than one translation is searched.
        reachable_only: Leave out sets of parts that taking the whole apart never leaves.
        seed: Of the surface points.
    """
    config = SeparateConfig(max_queries=thorough)
    return make_cascade(assembly, config=config, seed=seed).conditions(reachable_only=reachable_only)


def doctor(
    source: str | Path, *, unit: str | None = None, config: ReadConfig | None = None, limits: DoctorConfig | None = None
) -> Diagnosis:
    """Return what an input is like before it is planned; no motion is planned.

    Size and unit, open and folded surfaces, overlaps with a guess at each, tiny clearances, parts that are hidden or
    that nothing touches, and what planning will do with each part. `write_diagnosis` shows it in 3D. Raises InputError
    where there is nothing to look at.

    Args:
        source: What `read_assembly` takes. Parts that cannot be closed are no error here.
        unit: Of mesh files.
        config: How parts are taken apart, and which are left out.
        limits: When something is worth saying.
    """
    return examine(inspect_assembly(source, unit=unit, config=config), config=limits)


def diff(old: str | Path, new: str | Path, *, unit: str | None = None) -> Revision:
    """Return what changed between two revisions or plans, and whether the old plan still works.

    Either is a plan.json or what `read_assembly` takes. Raises InputError or PlanFormatError for what cannot be read.

    Args:
        old: Before.
        new: After.
        unit: Of mesh files.
    """
    before = read_side(old, unit=unit)
    return compare(before, read_side(new, unit=unit, like=before))


def explain(
    assembly: Assembly,
    part: str | None = None,
    fixed: Sequence[str] | None = None,
    *,
    config: ExplainConfig | None = None,
    seed: int = 0,
) -> tuple[Explanation, ...]:
    """Return why a part cannot leave: what stops it where, what must go first, what change would free it.

    With a part, there is one explanation, which may also say that the part can leave. Without, there is one for each
    part that is stuck; `explanation_lines` puts them in words. Raises SashimonoError for a name that the assembly has
    not.

    Args:
        assembly: Parts in their assembled poses.
        part: Name of the part; all that are stuck if None.
        fixed: Names of the parts that stay; all others if None.
        config: How much is said.
        seed: Of the surface points.
    """
    for name in (*(fixed or ()), *(() if part is None else (part,))):
        if name not in assembly.names:
            raise SashimonoError(no_such_part(name, assembly))
    cascade = make_cascade(assembly, config=SeparateConfig(max_queries=1), seed=seed)
    if part is None:
        return explain_stuck(cascade, fixed, config=config)
    return (explain_part(cascade, part, fixed, config=config),)


def no_such_part(name: str, assembly: Assembly) -> str:
    """Return a line that says that there is no such part, and which there are."""
    from difflib import get_close_matches

    near = get_close_matches(name, assembly.names, n=3) or assembly.names[:8]
    return f"there is no part {name!r}. There is: {', '.join(near)}{', ...' if len(near) < len(assembly) else ''}"


def read_gripper(path: str | Path) -> Gripper:
    """Return the gripper that a JSON file describes; SashimonoError if the file is broken or describes none."""
    try:
        fields = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SashimonoError(f"{path}: cannot be read as a gripper: {error}") from error
    if not isinstance(fields, dict):
        raise SashimonoError(f"{path}: not one JSON object with the fields of a gripper.")
    return gripper_from_fields(fields, str(path))


def write_results(
    plan: AssemblyPlan,
    assembly: Assembly,
    folder: str | Path,
    *,
    copied: Path | None = None,
    wishes: Wishes | None = None,
) -> tuple[Path, ...]:
    """Write a plan as ``plan.json``, ``plan.html`` and ``plan.glb`` into a folder, all or none; return their paths.

    With wishes there is a ``constraints.toml`` as well, to be changed and planned again. The folder is made if it is
    absent. Raises SashimonoError if it cannot be written.

    Args:
        plan: What is written.
        assembly: What it was made for.
        folder: Where to.
        copied: Input file to copy beside the plan, which then names the copy as its source.
        wishes: What the user decided.
    """
    from sashimono.io.plan_json import write_plan
    from sashimono.view import write_glb, write_html

    folder = Path(folder)
    with replacing_together(folder) as scratch:
        if copied is not None:
            (scratch / copied.name).write_bytes(copied.read_bytes())
        plan = replace(plan, source=replace(plan.source, path=_seen_from(folder, plan.source.path, copied)))
        write_html(plan, assembly, scratch / "plan.html")
        write_glb(plan, assembly, scratch / "plan.glb")
        write_plan(plan, scratch / "plan.json")
        names = ["plan.json", "plan.html", "plan.glb"]
        if wishes is not None and wishes != Wishes():
            (scratch / "constraints.toml").write_text(wishes_to_toml(wishes), encoding="utf-8")
            names.append("constraints.toml")
    return tuple(folder / name for name in names)


def _seen_from(folder: Path, source: str, copied: Path | None) -> str:
    """Return the path of the input from the plan's folder, so that the plan finds it wherever it is read."""
    if copied is not None:
        return copied.name
    return Path(os.path.relpath(source, folder)).as_posix() if source else ""

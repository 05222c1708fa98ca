"""One blueprint's rows: a recipe in, everything that the tables hold of it out, as plain JSON values."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.contact import ContactConfig
from sashimono.d4pas.contacts import ContactFinder
from sashimono.d4pas.descriptor import describe
from sashimono.d4pas.labels import TRANSLATIONS, Label, LabelConfig, label_assembly
from sashimono.d4pas.recipe import Recipe, assembly_of, build_product, content_hash, find_faults
from sashimono.disassembly.masks import bits


@dataclass(frozen=True, kw_only=True)
class RowConfig:
    """How a blueprint becomes rows."""

    labels: LabelConfig = field(default_factory=LabelConfig)
    contacts: ContactConfig = field(default_factory=ContactConfig)
    """Level 3's options."""
    max_steps: int = 1
    """Sequences of each blueprint that get motions and contacts."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one recipe: rows, or the reason why there are none."""

    rows: Mapping[str, Any] | None
    """``blueprint``, ``sequences``, ``steps``: see `sashimono.d4pas.tables`."""
    reason: str
    """Empty where there are rows."""
    seconds: Mapping[str, float]
    """Processor time by stage; not part of the dataset."""


def make_rows(recipe: Recipe, *, config: RowConfig) -> Outcome:
    """Return the rows of a recipe, or why it has none: faults of the product, or parts that never leave alone."""
    clock = [time.process_time()]
    product = build_product(recipe)
    faults = find_faults(product)
    if faults:
        return Outcome(rows=None, reason=f"not valid: {'; '.join(faults)}", seconds={})
    assembly = assembly_of(product, recipe)
    clock.append(time.process_time())
    return rows_of(assembly, recipe, config=config, clock=clock)


def rows_of(assembly: Assembly, recipe: Recipe, *, config: RowConfig, clock: list[float]) -> Outcome:
    """Return the rows of an assembly that a recipe made or that was read from elsewhere."""
    label = label_assembly(assembly, config=config.labels, seed=recipe.seed)
    clock.append(time.process_time())
    if not label.is_solved:
        names = ", ".join(assembly.names[k] for k in label.stuck)
        return Outcome(rows=None, reason=f"not solved one part at a time: {names}", seconds=_seconds(clock))
    rng_bodies, rng_contacts = np.random.default_rng([recipe.seed, 3]).spawn(2)
    bodies = make_bodies(assembly, rng=rng_bodies)
    finder = ContactFinder(assembly, bodies, config=config.contacts, rng=rng_contacts)
    executable = [finder.executable(part, clauses) for part, clauses in enumerate(label.conditions.clauses)]
    clock.append(time.process_time())
    steps = _steps(assembly, label, finder, config)
    clock.append(time.process_time())
    conditions = label.conditions
    index = {name: k for k, name in enumerate(assembly.names)}
    blueprint = {
        "id": recipe.id,
        "family": recipe.family,
        "version": recipe.version,
        "params": json.dumps(recipe.params, sort_keys=True),
        "seed": recipe.seed,
        "n_parts": len(assembly),
        "parts": list(assembly.names),
        "clauses": [[bits(clause.blockers) for clause in clauses] for clauses in conditions.clauses],
        "executable": [[bits(mask) for mask in masks] for masks in executable],
        "stages": [[clause.stage for clause in clauses] for clauses in conditions.clauses],
        "complete": label.is_complete,
        "cut_short": list(conditions.cut_short),
        "motion_class": TRANSLATIONS,
        "orders": "" if label.orders is None else str(label.orders),
        "identical": [[index[name] for name in names] for names in assembly.identical],
        "geometry_hash": content_hash(assembly)[:16],
        "descriptor": [round(float(x), 3) for x in describe(assembly)],
    }
    rows = {"blueprint": blueprint, "sequences": [list(order) for order in label.sequences], "steps": steps}
    return Outcome(rows=rows, reason="", seconds=_seconds(clock))


def canonical(rows: Mapping[str, Any]) -> str:
    """Return rows as the one JSON text that stands for them."""
    return json.dumps(rows, sort_keys=True, separators=(",", ":"))


def digest(texts: list[str]) -> str:
    """Return the SHA-256 of canonical rows, in this order."""
    out = hashlib.sha256()
    for text in texts:
        out.update(text.encode() + b"\n")
    return out.hexdigest()


def _seconds(clock: list[float]) -> dict[str, float]:
    names = ("build", "label", "executable", "steps")
    return {name: b - a for name, a, b in zip(names, clock[:-1], clock[1:], strict=False)}


def _steps(assembly: Assembly, label: Label, finder: ContactFinder, config: RowConfig) -> list[dict[str, Any]]:
    out = []
    for order_index, order in enumerate(label.sequences[: config.max_steps]):
        placed = 0
        for part in order:
            pose = assembly.parts[part].T_world_part
            row: dict[str, Any] = {"order_index": order_index, "part": part, "waypoints": [_seven(pose)]}
            row |= {"contact": None, "points": [], "normals": [], "radius": None, "begins": None}
            if placed:
                clause = label.conditions.clause(part, placed | 1 << part)
                assert clause is not None, "a sequence follows the conditions"
                poses = clause.removal.displacements[::-1] @ pose
                row["waypoints"] = [_seven(T) for T in poses]
                contact = finder.find(part, placed, clause)
                if contact is not None:
                    row |= {"contact": contact.kind, "points": _rounded(contact.points)}
                    row |= {"normals": _rounded(contact.normals), "radius": round(contact.radius, 8)}
                    row["begins"] = round(contact.begins, 6)
            out.append(row)
            placed |= 1 << part
    return out


def _seven(T: Float[np.ndarray, "4 4"]) -> list[float]:
    """A pose as x, y, z [m], then the quaternion w, x, y, z with w >= 0."""
    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True)
    return [round(float(x), 8) + 0.0 for x in (*T[:3, 3], *quaternion)]


def _rounded(values: Float[np.ndarray, "n 3"]) -> list[list[float]]:
    return [[round(float(x), 8) + 0.0 for x in row] for row in values]

"""The truth set of this repository: small assemblies whose removal conditions follow from how they are drawn.

Each file in ``tests/truth`` holds a recipe: solids as unions of boxes and cylinders, less others, in millimetres;
the exact removal conditions (for each part, the minimal sets of parts that must be gone); and why they hold. They
are drawn for this project and carry its licence.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from solids import Manifold, part

from sashimono.assembly import Assembly

FOLDER = Path(__file__).resolve().parent / "truth"
NAMES = tuple(sorted(path.stem for path in FOLDER.glob("*.json")))
SEGMENTS = 48
"""Sides of a cylinder: the same for pegs and holes, so that they fit without a gap."""
TURNS = {"x": (0.0, 90.0, 0.0), "y": (-90.0, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}
"""Takes a cylinder along z to each axis [degrees]."""


@dataclass(frozen=True)
class Truth:
    """One assembly of the set."""

    name: str
    parts: Assembly
    removable: dict[str, frozenset[frozenset[str]]]
    """For each part, the minimal sets of parts of which one must be gone."""

    def frees(self, name: str, others: frozenset[str]) -> bool:
        """Return whether a part leaves while these others are there."""
        return any(not clause & others for clause in self.removable[name])

    def count_orders(self) -> int:
        """Count the complete orders of disassembly by trying each of them."""
        names = self.parts.names
        return sum(
            all(self.frees(name, frozenset(order[k + 1 :])) for k, name in enumerate(order))
            for order in permutations(names)
        )


def read_truth(name: str) -> Truth:
    """Return one assembly of the set by its name."""
    recipe = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert recipe["name"] == name
    assert recipe["unit"] == "mm"
    assert set(recipe["removable"]) == set(recipe["parts"])
    return Truth(
        name=name,
        parts=Assembly(parts=tuple(part(key, _solid(value)) for key, value in recipe["parts"].items())),
        removable={
            key: frozenset(frozenset(clause) for clause in clauses) for key, clauses in recipe["removable"].items()
        },
    )


def _solid(recipe: dict[str, list[dict[str, Any]]]) -> Manifold:
    solid = Manifold()
    for shape in recipe["add"]:
        solid += _shape(shape)
    for shape in recipe["cut"]:
        solid -= _shape(shape)
    return solid.scale((1e-3, 1e-3, 1e-3))


def _shape(recipe: dict[str, Any]) -> Manifold:
    if "box" in recipe:
        return Manifold.cube(recipe["box"], center=True).translate(recipe["at"])
    radius, length = recipe["cylinder"]
    upright = Manifold.cylinder(length, radius, radius, SEGMENTS, center=True)
    return upright.rotate(TURNS[recipe["axis"]]).translate(np.asarray(recipe["at"], dtype=float))

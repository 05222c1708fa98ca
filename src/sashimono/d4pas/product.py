"""A product as a family draws it: named solids in place, in millimetres."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from manifold3d import Manifold


@dataclass(kw_only=True)
class Product:
    """Solids by part name; grows while a family draws it."""

    solids: dict[str, Manifold] = field(default_factory=dict)
    """Closed solids in their assembled poses [mm]."""
    fits: set[frozenset[str]] = field(default_factory=set)
    """Pairs that are meant to overlap: press fits."""

    def add(self, name: str, solid: Manifold) -> str:
        """Add a part and return its name, made unique by a number: ``bolt``, ``bolt_2``, ..."""
        unique, number = name, 1
        while unique in self.solids:
            number += 1
            unique = f"{name}_{number}"
        self.solids[unique] = _evaluated(solid)
        return unique

    def cut(self, names: Iterable[str], tool: Manifold) -> None:
        """Subtract a tool from these parts."""
        for name in names:
            self.solids[name] = _evaluated(self.solids[name] - tool)

    def join(self, name: str, solid: Manifold) -> None:
        """Add material to a part."""
        self.solids[name] = _evaluated(self.solids[name] + solid)

    def declare_fit(self, first: str, second: str) -> None:
        """Say that two parts are meant to overlap."""
        self.fits.add(frozenset((first, second)))


@dataclass(frozen=True, kw_only=True)
class Family:
    """A parametric family of products.

    ``draw`` returns parameters that JSON can hold: everything that distinguishes one member from another. ``build``
    is a pure function of them, so that the same parameters give the same solids on every machine.
    """

    name: str
    version: int
    """Raised whenever the same parameters would give another product."""
    summary: str
    """One line: what it is, and what makes its orders interesting."""
    draw: Callable[[np.random.Generator], dict[str, Any]]
    build: Callable[[Mapping[str, Any]], Product]


def _evaluated(solid: Manifold) -> Manifold:
    """Return a solid, evaluated now: later, the triangles would depend on which operands Python still holds."""
    solid.status()
    return solid

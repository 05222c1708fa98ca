"""The values that go in: parts in their assembled poses."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry import se3


def frozen_array(values: object, dtype: type) -> np.ndarray:
    """Return a contiguous, read-only copy: ``frozen=True`` alone would still let elements be changed."""
    array = np.array(values, dtype=dtype, order="C", copy=True)
    array.setflags(write=False)
    return array


def size_words(bounds: np.ndarray) -> str:
    """Return the edges of a box given by two corners [m], in millimetres."""
    return f"{' × '.join(f'{1e3 * edge:.4g}' for edge in bounds[1] - bounds[0])} mm"


def few_words(names: Sequence[str], most: int = 4) -> str:
    """Return names separated by commas, the first ones if there are many."""
    return ", ".join(names[:most]) + (", ..." if len(names) > most else "")


def millimetres(length: float) -> str:
    """Return a length [m] in words: millimetres, three digits."""
    return f"{1e3 * length:.3g} mm"


def html_table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML; what is in it may be any text."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in row)

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><caption>{html.escape(caption)}</caption><tr>{cells('th', head)}</tr>{body}</table>"


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A rigid body, meshed in its own frame: a closed surface, counter-clockwise from outside."""

    name: str
    vertices_part: Float[np.ndarray, "vertex 3"]
    """Surface points [m]."""
    faces: Int[np.ndarray, "face 3"]
    """Vertex indices, counter-clockwise from outside."""
    T_world_part: Float[np.ndarray, "4 4"]
    """Assembled pose: part frame to world."""
    color: tuple[float, float, float] | None = None
    """Colour in the source file, linear RGB in [0, 1], if it had one."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices_part", frozen_array(self.vertices_part, np.float64))
        object.__setattr__(self, "faces", frozen_array(self.faces, np.int32))
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part, np.float64))

    def __repr__(self) -> str:
        return f"Part({self.name!r}, {len(self.faces)} triangles, {size_words(self.bounds_world)})"

    @cached_property
    def vertices_world(self) -> Float[np.ndarray, "vertex 3"]:
        """Surface points in the assembled pose [m]."""
        return frozen_array(se3.apply(self.T_world_part, self.vertices_part), np.float64)

    @cached_property
    def bounds_world(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner of the axis-aligned box in the assembled pose [m]."""
        return frozen_array([self.vertices_world.min(axis=0), self.vertices_world.max(axis=0)], np.float64)


@dataclass(frozen=True, kw_only=True)
class Product:
    """A product nested in the file's own structure: several parts that the designer drew as one thing."""

    name: str
    """Unique among products and parts."""
    parts: tuple[str, ...]
    """All of its parts, those of products inside it too, in part order; at least two, and never all there are."""


@dataclass(frozen=True, kw_only=True)
class Kept:
    """A product, or a set of parts, that stays one part, because it is bought as one or because the user wants that."""

    product: str
    """The product, and the part that it became."""
    reason: str
    members: tuple[str, ...] = ()
    """The parts that it is made of, where the input has no such product: a bearing told by its shape."""


@dataclass(frozen=True, kw_only=True)
class StandIn:
    """A closed body in place of a part whose surface is not closed. It contains that surface."""

    part: str
    problem: str
    """What is wrong with the surface."""
    how: str
    """What the body is made of."""
    off: float
    """How far it reaches from the surface, at most, by samples [m]."""

    @property
    def words(self) -> str:
        """What a reader has to know."""
        return f"{self.part}: {self.problem}; a closed stand-in is used, {self.how}, up to {1e3 * self.off:.3g} mm off"


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where an assembly was read from, so that a plan can be checked against it."""

    path: str
    sha256: str
    """Of the file, or of the sorted (name, content hash) list of a folder."""
    unit: str
    """Unit of the source coordinates ("m", "mm", ...); the assembly itself is in metres."""
    split: Literal["auto", "all", "none"] = "none"
    """Which parts of several solids were taken apart (`ReadConfig.split`)."""
    excluded: tuple[str, ...] = ()
    """Parts that were left out (`ReadConfig.exclude`)."""
    products: tuple[Product, ...] = ()
    """The product tree as the file has it, before anything was kept together."""
    kept: tuple[Kept, ...] = ()
    """Products that stay one part (`ReadConfig.kept`)."""
    stand_ins: tuple[StandIn, ...] = ()
    """Parts that are not closed in the file, and the closed bodies in their place (`ReadConfig.stand_ins`)."""


@dataclass(frozen=True, kw_only=True)
class Overlap:
    """Two parts that share volume in the assembled pose, as the CAD has them."""

    first: str
    second: str
    volume: float
    """Volume of the boolean intersection [m³]."""
    fraction: float
    """That volume over the smaller part's volume."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembly:
    """Parts in their assembled poses, SI units, unique names."""

    parts: tuple[Part, ...]
    source: Source | None = None
    overlaps: tuple[Overlap, ...] = ()
    """Pairs that overlap in the assembled pose, worst first."""
    identical: tuple[tuple[str, ...], ...] = ()
    """Classes of parts with the same shape; only classes of two or more."""
    notes: tuple[str, ...] = ()
    """What was mended or looked doubtful while reading, one line each."""
    products: tuple[Product, ...] = ()
    """The products that are made of several of these parts, the outer ones first; two of them share parts only where
    one is inside the other."""
    _index: dict[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {part.name: k for k, part in enumerate(self.parts)})
        assert len(self._index) == len(self.parts), "part names are unique"

    def __len__(self) -> int:
        return len(self.parts)

    def __repr__(self) -> str:
        size = f", {size_words(self.bounds_world)}" if self.parts else ""
        source = f", from {self.source.path}" if self.source is not None and self.source.path else ""
        return f"Assembly({len(self)} parts: {few_words(self.names)}{size}{source})"

    def _repr_html_(self) -> str:
        """Return a table of the parts, as a notebook shows it; `sashimono.show` shows them in 3D."""
        return html_table(
            repr(self),
            ("part", "size", "triangles", "overlaps"),
            [
                (
                    part.name,
                    size_words(part.bounds_world),
                    str(len(part.faces)),
                    few_words(
                        [
                            o.second if o.first == part.name else o.first
                            for o in self.overlaps
                            if part.name in (o.first, o.second)
                        ]
                    ),
                )
                for part in self.parts
            ],
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Part names, in part order."""
        return tuple(part.name for part in self.parts)

    def index(self, name: str) -> int:
        """Return the position of the part with this name; KeyError if there is none."""
        return self._index[name]

    def part(self, name: str) -> Part:
        """Return the part with this name; KeyError if there is none."""
        return self.parts[self._index[name]]

    @cached_property
    def bounds_world(self) -> Float[np.ndarray, "2 3"]:
        """Lower and upper corner of the whole assembly's axis-aligned box [m]."""
        boxes = np.array([part.bounds_world for part in self.parts])
        return frozen_array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)], np.float64)

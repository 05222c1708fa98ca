"""What the examination of an input gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from sashimono.assembly import Assembly, Part, html_table
from sashimono.fasteners.recognise import Fastener

Severity = Literal["error", "warning", "note"]
"""An error stands in the way of a plan; a warning may spoil it; a note is worth knowing."""

Guess = Literal["thread", "press fit", "hole not drawn", "rounding", "duplicate", "inside", "drawing error"]
"""What an overlap may be."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing worth saying."""

    kind: str
    """What it is about, in one word or two: "surface", "overlap", ..."""
    severity: Severity
    parts: tuple[str, ...]
    """Parts that it is about; none if it is about all."""
    message: str
    """In words."""
    way_out: str = ""
    """What can be done; "" if nothing need be."""


@dataclass(frozen=True, kw_only=True)
class PairOverlap:
    """Two parts that share volume as drawn."""

    first: str
    second: str
    volume: float
    """[m³]."""
    fraction: float
    """That volume over the smaller part's."""
    depth: float | None
    """Of the deepest point of one in the other [m]; None where it was not measured, and for duplicates."""
    guess: Guess


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """A gap between facing surfaces of two parts."""

    first: str
    second: str
    gap: float
    """The median of the gaps that count as tiny [m]."""
    relative: float
    """The same, over the smaller part's smallest extent."""


@dataclass(frozen=True, kw_only=True)
class Treatment:
    """What planning will do with a part."""

    part: str
    planned: bool
    """Whether it can be planned as the file is."""
    how: str
    """In words."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """What an input is like."""

    assembly: Assembly
    """The sound parts."""
    broken: tuple[tuple[Part, str], ...]
    """The other parts, and what is wrong with each."""
    size: tuple[float, ...]
    """Edges of the box around all parts [m]."""
    size_words: str
    """Size and unit in words."""
    findings: tuple[Finding, ...]
    """Errors first."""
    overlaps: tuple[PairOverlap, ...]
    """Worst first."""
    clearances: tuple[Clearance, ...]
    """Smallest first."""
    fasteners: tuple[Fastener, ...]
    touching: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """For each sound part, the parts that it touches."""
    treatments: tuple[Treatment, ...] = ()
    """One for each part."""

    def __repr__(self) -> str:
        counts = [
            f"{count} {severity}{'' if count == 1 else 's'}"
            for severity in ("error", "warning", "note")
            if (count := sum(finding.severity == severity for finding in self.findings))
        ]
        parts = len(self.assembly) + len(self.broken)
        return f"Diagnosis({parts} parts, {self.size_words}; {', '.join(counts) or 'nothing to say'})"

    def _repr_html_(self) -> str:
        rows = [(finding.severity, finding.kind, finding.message, finding.way_out) for finding in self.findings]
        return html_table(repr(self), ("", "about", "finding", "way out"), rows)

    @property
    def ok(self) -> bool:
        """Whether nothing stands in the way of a plan."""
        return all(finding.severity != "error" for finding in self.findings)

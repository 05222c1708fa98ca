"""Fasteners in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence

from sashimono.assembly import few_words
from sashimono.fasteners.recognise import Fastener
from sashimono.geometry.features.directions import direction_name


def fastener_lines(fasteners: Sequence[Fastener]) -> list[str]:
    """Return a line for each fastener: part, kind, size, way in, what it clamps and goes into, tool, thread."""
    lines = []
    for f in fasteners:
        size = f.size or f"{1e3 * f.diameter:.3g} mm"
        words = [f"{f.part}: {f.kind} {size}, along {direction_name(f.axis)}"]
        if f.clamps:
            words.append(f"clamps {few_words(f.clamps)}")
        if f.into:
            words.append(f"in {few_words(f.into)}")
        if f.nuts:
            words.append(f"nut {few_words(f.nuts)}")
        if f.washers:
            words.append(f"washer {few_words([name for name, _ in f.washers])}")
        if f.kind in ("screw", "bolt", "nut"):
            words.append(f"tool {f.tool}")
            words.append(f.way_in)
        lines.append("; ".join(words) + f" ({f.reason})")
    return lines


def fasteners_as_dict(fasteners: Sequence[Fastener]) -> dict[str, object]:
    """Return what ``sashimono fasteners --json`` writes: docs/conventions.md names the fields. Lengths in m."""
    return {
        "fasteners": [
            {
                "part": f.part,
                "kind": f.kind,
                "axis": [float(x) for x in f.axis],
                "point": [float(x) for x in f.point],
                "low": f.low,
                "high": f.high,
                "diameter": f.diameter,
                "outer": f.outer,
                "size": f.size or None,
                "tool": f.tool,
                "thread_pitch": f.thread_pitch,
                "clamps": list(f.clamps),
                "into": list(f.into),
                "nuts": list(f.nuts),
                "washers": [{"part": name, "nut_side": far} for name, far in f.washers],
                "confidence": f.confidence,
                "reason": f.reason,
            }
            for f in fasteners
        ]
    }

"""Which parts a fastener joins rigidly: a screw and what it is screwed into, a bolt and its nuts."""

from __future__ import annotations

from collections.abc import Sequence

from sashimono.fasteners.recognise import Fastener


def bonds(fasteners: Sequence[Fastener]) -> dict[str, tuple[str, ...]]:
    """Return, by fastener, the parts that it holds to itself once both are in place.

    A screw holds what it goes into, a nut its bolt. What is clamped between head and thread is not among them: it is
    pressed, not joined. Pins, washers, circlips and standoffs only lie in place. That there is a thread is taken from
    what the part is: most CAD draws plain cylinders.

    Args:
        fasteners: What `find_fasteners` found.
    """
    out: dict[str, tuple[str, ...]] = {}
    for f in fasteners:
        if f.kind in ("screw", "bolt", "nut") and f.into:
            out[f.part] = f.into
    return out

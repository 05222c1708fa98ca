"""What changed, in words and as JSON."""

from __future__ import annotations

from sashimono.revision.compare import Revision
from sashimono.revision.parts import PartChange

FORMAT, VERSION = "sashimono.diff", 1


def revision_lines(found: Revision) -> list[str]:
    """Return what changed, a line each, and whether the old plan still works."""
    changed = [change for change in found.parts if change.kinds]
    kept = len(found.parts) - len(changed)
    lines = [f"{kept} parts as they were, {len(changed)} not"]
    lines += [_part_words(change) for change in changed]
    if found.status is not None:
        lines.append(f"plan: {found.status[1]}, was {found.status[0]}")
    lines += [f"order: {first} now before {then}" for first, then in found.earlier]
    lines += [f"step of {step.part}: {'; '.join(step.words)}" for step in found.steps]
    for side in (found.old, found.new):
        if side.note:
            lines.append(f"note: {side.path}: {side.note}; names and poses alone are compared")
    return [*lines, verdict(found), *(f"  {reason}" for reason in found.reasons if found.holds is False)]


def verdict(found: Revision) -> str:
    """Return the outcome in a line."""
    if found.holds is None:
        outcome = "no difference" if found.same else "different"
        return f"{outcome}; whether the old plan works is not known: {'; '.join(found.reasons)}"
    if not found.holds:
        order = {True: ", though its order does", False: ", nor does its order", None: ""}[found.order_works]
        return f"the old plan does not work any more{order}: plan again"
    return "no difference, and the old plan works" if found.same else "different, but the old plan still works"


def _part_words(change: PartChange) -> str:
    if change.old is None or change.new is None:
        return f"{'added' if change.old is None else 'removed'}: {change.new or change.old}"
    words = []
    if change.old != change.new:
        words.append(f"was called {change.old}")
    if change.shift > 0.0:
        words.append(f"moved by {1e3 * change.shift:.3g} mm")
    if change.reshaped and change.volumes is not None:
        before, after = change.volumes
        words.append(f"shape changed, volume {100.0 * (after / before - 1.0):+.2g} %")
    return f"{' and '.join(change.kinds)}: {change.new}, {', '.join(words)}"


def revision_as_dict(found: Revision) -> dict[str, object]:
    """Return what ``sashimono diff --json`` writes: docs/conventions.md names the fields. Lengths in m."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "same": found.same,
        "holds": found.holds,
        "order_works": found.order_works,
        "reasons": list(found.reasons),
        "old": found.old.path,
        "new": found.new.path,
        "parts": [
            {
                "old": change.old,
                "new": change.new,
                "kinds": list(change.kinds),
                "shift": change.shift,
                "volumes": None if change.volumes is None else list(change.volumes),
            }
            for change in found.parts
        ],
        "status": None if found.status is None else list(found.status),
        "earlier": [list(pair) for pair in found.earlier],
        "steps": [{"part": step.part, "words": list(step.words)} for step in found.steps],
    }

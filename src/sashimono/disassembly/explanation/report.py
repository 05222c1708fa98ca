"""An explanation in words and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from sashimono.assembly import millimetres
from sashimono.disassembly.explanation.explain import BlockedDirection, Blocker, Explanation
from sashimono.geometry.features.directions import direction_name

_MOST_SETS = 4
"""Sets of parts to remove first that are put into words; JSON has all."""


def explanation_lines(found: Explanation) -> list[str]:
    """Return the explanation as lines of plain text: the verdict, then what stops the part, then what would help."""
    if found.exit_direction is not None:
        return [f"{found.part} can leave: it {found.reason}, at last along {direction_name(found.exit_direction)}"]
    lines = [f"{found.part} {_verdict(found)}: {found.reason}"]
    for entry in found.directions:
        head = f"  along {direction_name(entry.direction)} it gets {millimetres(entry.travel)}"
        lines.append(f"{head}; stopped by {'; '.join(_blocker_words(found.part, b) for b in entry.blockers)}")
    lines.append(f"  {_removal_words(found)}")
    lines += [
        f"  overlap in the CAD: {o.first} and {o.second} share {1e9 * o.volume:.3g} mm³, "
        f"{100.0 * o.fraction:.2g} % of the smaller one; mend it if it is not meant"
        for o in found.overlaps
    ]
    lines.append(f"  {change_words(found)}")
    return lines


def _verdict(found: Explanation) -> str:
    if found.proven_for is None:
        return "cannot leave, as far as was found"
    return f"is proven to be blocked for {found.proven_for}, and no other motion was found"


def change_words(found: Explanation) -> str:
    """Return what small change of shape would free the part, in words; or that none was found."""
    if found.easy_change is None:
        return "no small change of outline frees it: what is in the way lies well within its outline"
    changes = [_change_of(found.part, blocker) for blocker in found.easy_change.blockers]
    return f"to free it along {direction_name(found.easy_change.direction)}: {'; '.join(changes)}"


def _change_of(part: str, blocker: Blocker) -> str:
    seen = blocker.obstruction
    assert seen is not None, "a small change is known for every blocker"
    trim = f"{_verb(seen.opening_part)} {part} by {millimetres(seen.lateral_part)} ({_faces(seen.faces_part)})"
    widen = f"{_verb(seen.opening_obstacle)} {blocker.part} by {millimetres(seen.lateral_obstacle)}"
    widen += f" ({_faces(seen.faces_obstacle)})"
    options = [
        words
        for words, amount in ((widen, seen.lateral_obstacle), (trim, seen.lateral_part))
        if amount <= 2.0 * seen.lateral
    ]
    return ", or ".join(options)


def _verb(opening: bool) -> str:
    return "widen the opening of" if opening else "trim"


def _blocker_words(part: str, blocker: Blocker) -> str:
    seen = blocker.obstruction
    if seen is None:
        return f"{blocker.part} after {millimetres(blocker.travel)}, by a slight contact"
    return (
        f"{blocker.part} after {millimetres(blocker.travel)}, "
        f"{millimetres(seen.depth)} of it ahead over {1e6 * seen.area:.3g} mm² "
        f"({_faces(seen.faces_part)} of {part}, {_faces(seen.faces_obstacle)} of {blocker.part})"
    )


def _removal_words(found: Explanation) -> str:
    if not found.removal_sets:
        return "no parts can be removed one at a time before it so that a single translation frees it"
    sets = [" and ".join(names) for names in found.removal_sets[:_MOST_SETS]]
    more = len(found.removal_sets) - len(sets)
    return f"remove first: {'; or '.join(sets)}{f'; or one of {more} larger sets' if more else ''}"


def _faces(faces: np.ndarray) -> str:
    return "1 face" if len(faces) == 1 else f"{len(faces)} faces"


def explanations_as_dict(found: Iterable[Explanation]) -> dict[str, Any]:
    """Return the JSON form: lengths in metres, areas in m², unknown or infinite figures null.

    ``parts``: for each ``part``, ``fixed``, ``answer``, ``proven_for`` or null, ``reason``, ``exit_direction`` or
    null, ``directions`` (``direction``, ``travel``, ``change``, and ``blockers`` with ``part``, ``travel``, ``depth``,
    ``area``, ``lateral_part``, ``lateral_blocker``, ``faces_part``, ``faces_blocker``: indices of triangles),
    ``removal_sets``, ``overlaps``, ``change`` in words, and all of it as ``text``.
    """
    return {"format": "sashimono.explanation", "version": 1, "unit": "m", "parts": [_as_dict(entry) for entry in found]}


def _as_dict(found: Explanation) -> dict[str, Any]:
    return {
        "part": found.part,
        "fixed": list(found.fixed),
        "answer": str(found.answer),
        "proven_for": None if found.proven_for is None else str(found.proven_for),
        "reason": found.reason,
        "exit_direction": None if found.exit_direction is None else found.exit_direction.tolist(),
        "directions": [_direction_as_dict(entry) for entry in found.directions],
        "removal_sets": [list(names) for names in found.removal_sets],
        "overlaps": [
            {"first": o.first, "second": o.second, "volume": o.volume, "fraction": o.fraction} for o in found.overlaps
        ],
        "change": None if found.easy_change is None else change_words(found),
        "text": explanation_lines(found),
    }


def _direction_as_dict(entry: BlockedDirection) -> dict[str, Any]:
    return {
        "direction": entry.direction.tolist(),
        "travel": _finite(entry.travel),
        "change": _finite(entry.change),
        "blockers": [_blocker_as_dict(blocker) for blocker in entry.blockers],
    }


def _blocker_as_dict(blocker: Blocker) -> dict[str, Any]:
    seen = blocker.obstruction
    return {
        "part": blocker.part,
        "travel": _finite(blocker.travel),
        "depth": None if seen is None else seen.depth,
        "area": None if seen is None else seen.area,
        "lateral_part": None if seen is None else _finite(seen.lateral_part),
        "lateral_blocker": None if seen is None else _finite(seen.lateral_obstacle),
        "faces_part": [] if seen is None else seen.faces_part.tolist(),
        "faces_blocker": [] if seen is None else seen.faces_obstacle.tolist(),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

"""Lines over a picture: arrows of ways in, arrows of turns, balloons. Places are pixels of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from sashimono.view.manual.drawing import View

_LEAST = 34.0
"""Shortest arrow [pixels]."""


@dataclass(frozen=True, kw_only=True)
class Mark:
    """One line, with a head at its end if it is an arrow."""

    kind: Literal["arrow", "turn", "trail", "way on", "balloon"]
    points: tuple[tuple[float, float], ...]
    """Columns and rows; of a balloon, its middle and the place it names."""
    text: str = ""


def trail(ends: Float[np.ndarray, "2 2"]) -> Mark:
    """Return a thin line on which the way goes on, behind other parts too."""
    return _mark("way on", ends)


def _mark(kind: Literal["arrow", "turn", "way on"], points: Float[np.ndarray, "n 2"]) -> Mark:
    return Mark(kind=kind, points=tuple((float(x), float(y)) for x, y in points))


def straight_arrow(ends: Float[np.ndarray, "2 2"], own: Bool[np.ndarray, "row column"]) -> Mark:
    """Return the arrow of a straight way, from what comes to its mouth.

    What comes hides the beginning of its way: the arrow starts where it is left behind. Where that leaves too little,
    the arrow is drawn beside what comes.
    """
    a, b = ends
    length = float(np.linalg.norm(b - a))
    if length < 1e-6:
        return _mark("arrow", np.array([a - [0.0, 60.0], a - [0.0, 20.0]]))
    start = _left_behind(ends, own)
    if has_room(ends, own):
        return _mark("arrow", np.array([start, b]))
    ahead = (b - a) / length
    return _mark("arrow", _beside(own, ahead, max(_LEAST + 20.0, length)))


def has_room(ends: Float[np.ndarray, "2 2"], own: Bool[np.ndarray, "row column"]) -> bool:
    """Return whether an arrow fits between what comes (``own``) and its mouth."""
    a, b = ends
    return float((b - _left_behind(ends, own)) @ (b - a)) >= _LEAST * float(np.linalg.norm(b - a)) > 0.0


def _left_behind(ends: Float[np.ndarray, "2 2"], own: Bool[np.ndarray, "row column"]) -> Float[np.ndarray, "2"]:
    """Where a way comes out from behind what comes, five pixels on."""
    a, b = ends
    ahead = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    rows, columns = own.shape
    at = a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a)
    place = np.round(at).astype(int)
    inside = (place >= 0).all(axis=1) & (place[:, 0] < columns) & (place[:, 1] < rows)
    covered = np.zeros(len(at), dtype=bool)
    covered[inside] = own[place[inside, 1], place[inside, 0]]
    first = int(np.flatnonzero(covered).max()) + 1 if covered.any() else 0
    return a + min(1.0, first / 59.0) * (b - a) + 5.0 * ahead


def _beside(
    own: Bool[np.ndarray, "row column"], ahead: Float[np.ndarray, "2"], length: float
) -> Float[np.ndarray, "2 2"]:
    """An arrow next to what comes, on the side that lies farther out, where the picture has room."""
    rows, columns = np.nonzero(own)
    if len(rows) == 0:
        middle = 0.5 * np.array(own.shape[::-1])
        return np.array([middle - 0.5 * length * ahead, middle + 0.5 * length * ahead])
    places = np.stack([columns, rows], axis=1).astype(float)
    across = np.array([-ahead[1], ahead[0]])
    middle = places.mean(axis=0)
    reach = (places - middle) @ across
    choices = [middle + (reach.max() + 24.0) * across, middle + (reach.min() - 24.0) * across]
    low, high = np.array([20.0, 20.0]), np.array(own.shape[::-1]) - 20.0
    room = [float(np.minimum(choice - low, high - choice).min()) for choice in choices]
    spot = np.clip(choices[int(np.argmax(room))], low, high)
    return np.array([spot - 0.5 * length * ahead, spot + 0.5 * length * ahead])


def path_arrow(points: Float[np.ndarray, "n 2"]) -> Mark:
    """Return the arrow of a way with bends; bends of less than a pixel are left out."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) > 1.0:
            kept.append(point)
    if len(kept) == 1:
        kept.append(kept[0] + [0.0, _LEAST])
    return _mark("arrow", np.array(kept))


def turn_arrow(
    back: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"], radius: float, sense: float, view: View
) -> Mark:
    """Return an arrow about an axis, most of a circle, turning by the right-hand rule if ``sense`` is 1."""
    u = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    u /= np.linalg.norm(u)
    v = np.cross(direction, u)
    least = 22.0 / view.scale
    wide = max(1.15 * radius, least)
    angles = np.linspace(0.0, 1.6 * np.pi, 40) * sense
    # it begins at the side that is away from the viewer, so that the gap is there
    away = np.arctan2(-(view.R[2] @ v), -(view.R[2] @ u)) + 0.2 * np.pi * sense
    circle = (
        back
        - 0.35 * wide * direction
        + wide * (np.cos(away + angles)[:, None] * u + np.sin(away + angles)[:, None] * v)
    )
    return _mark("turn", view.pixel(circle))

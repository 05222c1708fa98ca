"""Straight ways out between the lines: directions that no face gives, found by leaning to where the part gets farther.

A bearing under a hook leaves at 13 degrees, because the hook is there and not because any face says so. So where the
lines of the parts and the contacts lead nowhere, the direction itself is improved step by step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.geometry.features.directions import frame_along


@dataclass(frozen=True, kw_only=True)
class LeaningConfig:
    """How directions are improved; it counts work, never time."""

    starts: int = 3
    """Directions that it begins with: those of all given in which the part gets farthest."""
    square: float = 0.1
    """Where one is nearer to square to a line of the part than this cosine, it is made square to it as well."""
    steps: tuple[float, ...] = tuple(np.radians((8.0, 4.0, 2.0, 1.0, 0.5)))
    """By how much a direction is turned, one after the other [rad]."""
    neighbours: int = 6
    """Directions looked at around one."""
    max_looks: int = 72
    """Directions followed for one part, besides those that are given."""
    gain: float = 1.02
    """A direction is better if the part gets so many times as far."""


def leaning_direction(
    parts: PlacedParts,
    part: int,
    others: Sequence[int],
    given: Float[np.ndarray, "direction 3"],
    *,
    config: LeaningConfig,
) -> Float[np.ndarray, "3"] | None:
    """Return a direction in which a part leaves the others straight, near one of those given; None if none is found."""
    given = np.array([turned for start in given for turned in _squared(parts, part, start, config)])
    reaches = np.zeros(len(given))
    for k, direction in enumerate(given):
        # of those that are no start, it need not be known how far the part gets
        least = float(np.sort(reaches[:k])[-config.starts]) if k >= config.starts else 0.0
        reaches[k] = _travel(parts, part, others, direction, enough=least)
        if np.isinf(reaches[k]):
            return direction
    looks = 0
    for k in np.argsort(-np.round(reaches, 12), kind="stable")[: config.starts]:
        best, reach = given[k], reaches[k]
        for step in config.steps:
            improved = True
            while improved and np.isfinite(reach) and looks < config.max_looks:
                improved = False
                for direction in around(best, step, config.neighbours):
                    looks += 1
                    travel = _travel(parts, part, others, direction, enough=config.gain * float(reach))
                    if travel > config.gain * reach:
                        best, reach, improved = direction, travel, True
                        break
        if np.isinf(reach):
            return best
    return None


def _squared(
    parts: PlacedParts, part: int, start: Float[np.ndarray, "3"], config: LeaningConfig
) -> list[Float[np.ndarray, "3"]]:
    """The start as it is; and made square to the part's lines that it is nearly square to, if it is to any."""
    square = start
    for line in parts.part_lines[part]:
        if abs(square @ line) < config.square:
            square = square - (square @ line) * line
            square = square / np.linalg.norm(square)
    return [start, square] if (square != start).any() else [start]


def around(direction: Float[np.ndarray, "3"], step: float, count: int) -> Float[np.ndarray, "neighbour 3"]:
    """Return so many unit directions around one, turned from it by an angle [rad]."""
    angles = 2.0 * np.pi * np.arange(count) / count
    across = np.column_stack([np.cos(angles), np.sin(angles)]) @ frame_along(direction)[:2]
    return np.cos(step) * direction + np.sin(step) * across


def _travel(
    parts: PlacedParts, part: int, others: Sequence[int], direction: Float[np.ndarray, "3"], *, enough: float
) -> float:
    """How far a part gets along a direction [m]; infinite if it passes all others.

    Of a travel of at most ``enough`` no more is told than that.
    """
    travel = np.inf
    for _, other in parts.parts_ahead(part, np.zeros(3), direction, others):
        past = free_travel(parts, part, np.zeros(3), direction, other, length=travel, enough=enough)
        travel = min(travel, past)
        if travel <= enough:
            break
    return travel

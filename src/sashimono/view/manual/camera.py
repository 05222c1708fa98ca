"""From where a task is best seen: the part that comes, its way, and the place where it goes in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.view.manual.drawing import Solid, fit_view, layer_of, look_from, merged

AZIMUTHS = tuple(np.radians(-90.0 + 90.0 * quarter + turn) for quarter in range(4) for turn in (28.0, 45.0, 62.0))
"""About the table's normal [rad]; none along an axis of the world, where boxes look flat."""
ELEVATIONS = ((0.5, 0.0), (0.95, 0.06), (0.2, 0.1), (-0.45, 0.45))
"""Heights of the viewer [rad], and how much each is disliked: a person stands above the table."""
_SIZE = 110
"""Of the pictures that views are compared by [pixels]."""
_WEIGHTS = (1.2, 1.2, 0.6)
"""What it is worth to see all of the coming parts, of their way, and of where they end."""
_MOST_SEEN = sum(_WEIGHTS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """What a picture is about."""

    fixed: tuple[Solid, ...]
    moving: tuple[Solid, ...]
    """Where they begin."""
    target: tuple[Solid, ...]
    """Where they end."""
    way: Float[np.ndarray, "point 3"]
    """Points along the way in that ought to be seen, ending at the mouth [m]."""
    direction: Float[np.ndarray, "3"] | None
    """The way of travel; None if nothing moves."""

    @cached_property
    def groups(self) -> tuple[Solid, Solid, Solid]:
        """What is fixed, what moves, and where that ends, each as one: quicker to draw from many places."""
        return merged(self.fixed), merged(self.moving), merged(self.target)

    @cached_property
    def points(self) -> Float[np.ndarray, "n 3"]:
        """Between which all of it lies."""
        return np.concatenate([solid.outermost for solid in (*self.fixed, *self.moving, *self.target)])


@dataclass(frozen=True, kw_only=True)
class Stand:
    """Where a viewer stands [rad]."""

    azimuth: float
    elevation: float


def choose_stand(subject: Subject, up: Float[np.ndarray, "3"], last: Stand | None) -> Stand:
    """Return the best of 48 places.

    Counted are the share of the coming parts that is seen, of their way, and of where they end; how long the way
    looks; and how near the place is to that of the picture before, so that the reader need not walk about. Only places
    that could still be the best are drawn.
    """
    stands = [
        (Stand(azimuth=azimuth, elevation=elevation), dislike)
        for elevation, dislike in ELEVATIONS
        for azimuth in AZIMUTHS
    ]
    turned = np.stack([look_from(up, stand.azimuth, stand.elevation) for stand, _ in stands])
    places = []
    for (stand, dislike), R, size in zip(stands, turned, _sizes(subject, turned), strict=True):
        near = 0.45 * _nearness(stand, last) if last is not None else 0.05 * float(np.cos(stand.azimuth + 0.8))
        places.append((_slant(subject, R) + 0.3 * float(size) - dislike + near, stand, R))
    places.sort(key=lambda place: -place[0])
    best, most = places[0][1], -np.inf
    for beside, stand, R in places:
        if beside + _MOST_SEEN <= most:
            break
        seen = visibility(subject, R)
        score = beside + sum(weight * share for weight, share in zip(_WEIGHTS, seen, strict=True))
        if score > most + 1e-9:
            best, most = stand, score
    return best


def _nearness(stand: Stand, last: Stand) -> float:
    return 0.5 * float(np.cos(stand.azimuth - last.azimuth)) + 0.5 * (stand.elevation == last.elevation)


def _slant(subject: Subject, R: Float[np.ndarray, "3 3"]) -> float:
    """How long the way looks, from 0 to 1."""
    if subject.direction is None:
        return 1.0
    return min(1.0, float(np.linalg.norm(R[:2] @ subject.direction)) / 0.75)


def _sizes(subject: Subject, R: Float[np.ndarray, "view 3 3"]) -> Float[np.ndarray, "view"]:
    """How large everything is seen, over the largest that a view could have."""
    seen = subject.points @ R[:, :2].reshape(-1, 3).T
    spread = (seen.max(axis=0) - seen.min(axis=0)).reshape(-1, 2).prod(axis=1)
    largest = float(np.linalg.norm(np.ptp(subject.points, axis=0))) ** 2
    return spread / max(largest, 1e-18)


class Visibility(NamedTuple):
    """Shares from 0 to 1 of what is seen."""

    moving: float
    way: float
    target: float


def visibility(subject: Subject, R: Float[np.ndarray, "3 3"]) -> Visibility:
    """Return what is seen of a subject by a viewer with these rows right, up, towards him."""
    view = fit_view(subject.points, R, _SIZE, _SIZE, 0.02)
    fixed, moving, target = (layer_of([group], view, shaded=False) for group in subject.groups)

    def share(layer_depth: np.ndarray, before: Sequence[np.ndarray]) -> float:
        own = np.isfinite(layer_depth)
        if not own.any():
            return 1.0
        nearest = np.min(before, axis=0)
        return float((own & (layer_depth <= nearest + 0.5)).sum() / own.sum())

    columns, rows = np.clip(np.round(view.pixel(subject.way) - 0.5).astype(int), 0, _SIZE - 1).T
    depth = -(subject.way @ view.R[2]) * view.scale
    covered = fixed.depth[rows, columns] < depth - 1.5
    return Visibility(
        moving=share(moving.depth, [fixed.depth]),
        way=1.0 - float(covered.mean()) if len(covered) else 1.0,
        target=share(target.depth, [fixed.depth]),
    )


def choose_glass(subject: Subject, R: Float[np.ndarray, "3 3"], *, enough: float = 0.45) -> frozenset[int]:
    """Return which fixed parts are drawn as glass: those that hide most of what the picture is about, one by one.

    None while ``enough`` of the coming parts and of where they end is seen.
    """
    glass: set[int] = set()
    view = fit_view(subject.points, R, _SIZE, _SIZE, 0.02)
    wanted = [layer_of([group], view, shaded=False).depth for group in subject.groups[1:]]
    depths = [layer_of([solid], view, shaded=False).depth for solid in subject.fixed]
    for _ in subject.fixed:
        left = [k for k in range(len(depths)) if k not in glass]
        if not left:
            break
        nearest = np.min([depths[k] for k in left], axis=0)
        shares = [
            float((np.isfinite(depth) & (depth <= nearest + 0.5)).sum() / max(1, np.isfinite(depth).sum()))
            for depth in wanted
        ]
        # a part that sits in a hole is hidden by right: a tenth of it shows where
        if shares[0] >= enough and shares[1] >= 0.1:
            break
        hidden = wanted[0] if shares[0] < enough else wanted[1]
        covers = {k: int((np.isfinite(hidden) & (depths[k] < hidden - 0.5)).sum()) for k in left}
        worst = max(covers, key=lambda k: covers[k])
        if covers[worst] == 0:
            break
        glass.add(worst)
    return frozenset(glass)

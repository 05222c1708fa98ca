"""From where a task is best seen: the part that comes, its way, and the place where it goes in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.view.manual.drawing import Solid, fit_view, layer_of, look_from

AZIMUTHS = tuple(np.radians(-90.0 + 90.0 * quarter + turn) for quarter in range(4) for turn in (28.0, 45.0, 62.0))
"""About the table's normal [rad]; none along an axis of the world, where boxes look flat."""
ELEVATIONS = ((0.5, 0.0), (0.95, 0.06), (0.2, 0.1), (-0.45, 0.45))
"""Heights of the viewer [rad], and how much each is disliked: a person stands above the table."""
_SIZE = 110
"""Of the pictures that views are compared by [pixels]."""


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


@dataclass(frozen=True, kw_only=True)
class Stand:
    """Where a viewer stands [rad]."""

    azimuth: float
    elevation: float


def choose_stand(subject: Subject, up: Float[np.ndarray, "3"], last: Stand | None) -> Stand:
    """Return the best of 48 places.

    Counted are the share of the coming parts that is seen, of their way, and of where they end; how long the way
    looks; and how near the place is to that of the picture before, so that the reader need not walk about.
    """
    best, most = Stand(azimuth=AZIMUTHS[0], elevation=ELEVATIONS[0][0]), -np.inf
    for elevation, dislike in ELEVATIONS:
        for azimuth in AZIMUTHS:
            stand = Stand(azimuth=azimuth, elevation=elevation)
            score = _score(subject, look_from(up, azimuth, elevation)) - dislike
            score += 0.45 * _nearness(stand, last) if last is not None else 0.05 * float(np.cos(azimuth + 0.8))
            if score > most + 1e-9:
                best, most = stand, score
    return best


def _nearness(stand: Stand, last: Stand) -> float:
    return 0.5 * float(np.cos(stand.azimuth - last.azimuth)) + 0.5 * (stand.elevation == last.elevation)


def _score(subject: Subject, R: Float[np.ndarray, "3 3"]) -> float:
    seen = visibility(subject, R)
    slant = 1.0
    if subject.direction is not None:
        slant = min(1.0, float(np.linalg.norm(R[:2] @ subject.direction)) / 0.75)
    return 1.2 * seen.moving + 1.2 * seen.way + 0.6 * seen.target + 1.0 * slant + 0.3 * seen.fixed


@dataclass(frozen=True, kw_only=True)
class Visibility:
    """Shares from 0 to 1 of what is seen."""

    moving: float
    way: float
    target: float
    fixed: float
    """Of all parts that stand: how large they are seen, over the largest that a view could have."""


def visibility(subject: Subject, R: Float[np.ndarray, "3 3"]) -> Visibility:
    """Return what is seen of a subject by a viewer with these rows right, up, towards him."""
    solids = [*subject.fixed, *subject.moving, *subject.target]
    view = fit_view(np.concatenate([solid.points for solid in solids]), R, _SIZE, _SIZE, 0.02)
    fixed, moving, target = (
        layer_of(group, view, shaded=False) for group in (subject.fixed, subject.moving, subject.target)
    )

    def share(layer_depth: np.ndarray, before: Sequence[np.ndarray]) -> float:
        own = np.isfinite(layer_depth)
        if not own.any():
            return 1.0
        nearest = np.min(before, axis=0)
        return float((own & (layer_depth <= nearest + 0.5)).sum() / own.sum())

    columns, rows = np.clip(np.round(view.pixel(subject.way) - 0.5).astype(int), 0, _SIZE - 1).T
    depth = -(subject.way @ view.R[2]) * view.scale
    covered = fixed.depth[rows, columns] < depth - 1.5
    spread = np.prod(np.ptp(np.concatenate([s.points for s in solids]) @ R[:2].T, axis=0))
    box = np.ptp(np.concatenate([s.points for s in solids]), axis=0)
    largest = float(np.linalg.norm(box)) ** 2
    return Visibility(
        moving=share(moving.depth, [fixed.depth]),
        way=1.0 - float(covered.mean()) if len(covered) else 1.0,
        target=share(target.depth, [fixed.depth]),
        fixed=float(spread) / max(largest, 1e-18),
    )


def choose_glass(subject: Subject, R: Float[np.ndarray, "3 3"], *, enough: float = 0.45) -> frozenset[int]:
    """Return which fixed parts are drawn as glass: those that hide most of what the picture is about, one by one.

    None while ``enough`` of the coming parts and of where they end is seen.
    """
    glass: set[int] = set()
    goal = [*subject.moving, *subject.target]
    view = fit_view(np.concatenate([s.points for s in [*subject.fixed, *goal]]), R, _SIZE, _SIZE, 0.02)
    wanted = [layer_of(group, view, shaded=False).depth for group in (subject.moving, subject.target)]
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

"""One moving body against one obstacle along a path: sweeps both ways, and booleans where they touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.overlap import intersection, sampled_depth
from sashimono.verify.sweep import HalfSpace, Screws, Sweep, sweep


@dataclass(frozen=True, kw_only=True)
class PairFinding:
    """What was found of one moving body and one obstacle."""

    against: str
    depth: float
    """Deepest penetration found [m], not below 0."""
    allowed: float
    """Depth in the assembled pose, where it was needed, plus the tolerance [m]."""
    pose: float
    """Pose index, with fraction, of the deepest point found."""
    problem: str | None
    queries: int
    notes: tuple[str, ...] = ()


def pair_tolerance(first: SampledBody, second: SampledBody, config: VerifyConfig) -> float:
    """Return the depth beyond the assembled pose that a pair may reach [m].

    A share of the smaller part's smallest extent, but less than half a thin wall, lest a shell slip through another.
    """
    extent = min(first.smallest_extent, second.smallest_extent)
    return min(config.relative_tolerance * extent, config.relative_wall * min(first.wall, second.wall))


def check_pair(
    moving: SampledBody,
    fixed: SampledBody,
    path: Screws,
    T_world_fixed: Float[np.ndarray, "4 4"],
    *,
    allowance: Callable[[], float],
    tolerance: float,
    config: VerifyConfig,
) -> PairFinding:
    """Return what the moving body does to a fixed one along the path.

    ``allowance`` gives the depth of the pair in the assembled pose; it is asked for only if the pair goes deeper
    than the tolerance, because measuring it costs more than most pairs need.
    """
    seen = path.seen_from(T_world_fixed)
    found = _both_ways(moving, fixed, seen, path.reversed_for(T_world_fixed), tolerance, tolerance, config)
    allowed, queries, first_depth = 0.0, found.queries, found.depth
    if not found.holds and not found.exhausted and (allowed := allowance()) > 0.0:
        limit = allowed + tolerance
        found = _both_ways(moving, fixed, seen, path.reversed_for(T_world_fixed), limit, tolerance, config)
        queries += found.queries
    depth, at, notes = found.depth, found.at, ()
    if found.holds and len(found.near):
        depth, at, notes = _with_booleans(moving, fixed, seen, found, config)
        if depth > allowed + tolerance and allowed == 0.0:
            allowed = allowance()
    problem = _problem(fixed.name, depth, at, allowed, tolerance, found.exhausted)
    if problem is None and allowed > tolerance:
        again = _after_parting(moving, fixed, path, T_world_fixed, tolerance, config)
        queries += again.queries
        if not again.holds:
            problem = _problem(fixed.name, again.depth, again.at, 0.0, tolerance, again.exhausted)
            problem = f"{problem}: once parted from it, the overlap in the assembled pose excuses nothing"
    return PairFinding(
        against=fixed.name,
        depth=max(0.0, depth, first_depth),
        allowed=allowed + tolerance,
        pose=at,
        problem=problem,
        queries=queries,
        notes=notes,
    )


def _after_parting(
    moving: SampledBody,
    fixed: SampledBody,
    path: Screws,
    T_world_fixed: Float[np.ndarray, "4 4"],
    tolerance: float,
    config: VerifyConfig,
) -> Sweep:
    """Check the path up to where the pair, walking back from the assembled pose, has first come apart.

    An overlap in the assembled pose is an excuse while the pair is still in it, not for a second meeting.
    """
    seen = path.seen_from(T_world_fixed)
    least = 0.25 * min(moving.wall, fixed.wall)
    time = float(len(path.angle))
    while time > 0.0:
        depth = sampled_depth(moving, fixed, seen.pose_at(time))
        if depth <= config.relative_parted * tolerance:
            break
        stretch = int(np.ceil(time)) - 1
        speed = float(np.linalg.norm(path.shift[stretch])) + path.angle[stretch] * moving.reach(path.point[stretch])
        step = max(depth - config.relative_parted * tolerance, least)
        time = max(0.0, float(stretch), time - step / speed) if speed > 0.0 else float(stretch)
    early = path.until(time)
    return _both_ways(
        moving, fixed, early.seen_from(T_world_fixed), early.reversed_for(T_world_fixed), tolerance, tolerance, config
    )


def check_table(moving: SampledBody, table: HalfSpace, path: Screws, *, config: VerifyConfig) -> PairFinding:
    """Return how deep the moving body dips into the table along the path."""
    tolerance = config.relative_tolerance * moving.smallest_extent
    found = sweep(
        moving.tree,
        table,
        path,
        limit=tolerance,
        resolution=config.relative_resolution * tolerance,
        coarse=0.25 * moving.wall,
        max_queries=config.max_queries,
    )
    return PairFinding(
        against="table",
        depth=max(0.0, found.depth),
        allowed=tolerance,
        pose=found.at,
        problem=_problem("table", found.depth, found.at, 0.0, tolerance, found.exhausted),
        queries=found.queries,
    )


def _problem(against: str, depth: float, at: float, allowed: float, tolerance: float, exhausted: bool) -> str | None:
    if depth > allowed + tolerance:
        beyond = f", {allowed * 1e3:.4g} mm of it as assembled" if allowed > tolerance else ""
        return (
            f"goes {depth * 1e3:.4g} mm deep into {against} at pose {at:.2f}{beyond}"
            f" (tolerance {tolerance * 1e3:.4g} mm)"
        )
    if exhausted:
        return f"could not be cleared of {against}: the queries ran out (max_queries)"
    return None


def _both_ways(
    moving: SampledBody,
    fixed: SampledBody,
    seen: Screws,
    back: Screws,
    limit: float,
    tolerance: float,
    config: VerifyConfig,
) -> Sweep:
    """Sweep the moving body's samples against the fixed one, then the fixed one's against the moving one."""
    options = {
        "limit": limit,
        "resolution": config.relative_resolution * tolerance,
        "coarse": 0.25 * min(moving.wall, fixed.wall),
    }
    out = sweep(moving.tree, fixed, seen, max_queries=config.max_queries, **options)
    if not out.holds:
        return out
    other = sweep(fixed.tree, moving, back, max_queries=config.max_queries - out.queries, **options)
    deeper = other if other.depth > out.depth else out
    return Sweep(
        holds=other.holds,
        exhausted=other.exhausted,
        depth=deeper.depth,
        at=deeper.at,
        queries=out.queries + other.queries,
        near=np.union1d(out.near, other.near),
    )


def _with_booleans(
    moving: SampledBody, fixed: SampledBody, seen: Screws, found: Sweep, config: VerifyConfig
) -> tuple[float, float, tuple[str, ...]]:
    """Return the deepest of the samples and of the intersection bodies at some of the times of contact."""
    ranks = np.linspace(0.0, len(found.near) - 1.0, config.boolean_poses).round().astype(int)
    times = np.unique(np.append(found.near[np.unique(ranks)], found.at))
    depth, at = found.depth, found.at
    for time in times:
        stretch = min(int(time), len(seen.angle) - 1)
        T = seen.pose(stretch, float(time - stretch))
        low, high = _low_high(moving, T)
        if (low > fixed.high).any() or (high < fixed.low).any():
            continue
        common = intersection(moving, fixed, T)
        if not common.exact:
            return depth, at, (f"no boolean could be taken with {fixed.name}: samples only",)
        if common.depth > depth:
            depth, at = common.depth, float(time)
    return depth, at, ()


def _low_high(body: SampledBody, T: Float[np.ndarray, "4 4"]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array(np.meshgrid(*np.stack([body.low, body.high], axis=1))).reshape(3, -1).T
    moved = se3.apply(T, corners)
    return moved.min(axis=0), moved.max(axis=0)

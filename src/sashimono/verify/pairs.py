"""One moving body against one obstacle along a path: sweeps both ways, and booleans where they touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.overlap import AssembledOverlaps, DeepestSample, Excuse, intersection, sampled_depth
from sashimono.verify.piercing import pierced_at
from sashimono.verify.sweep import Screws, Sweep, sweep
from sashimono.verify.target import HalfSpace


@dataclass(frozen=True, kw_only=True)
class PairFinding:
    """What was found of one moving body and one obstacle."""

    against: str
    depth: float
    """Deepest penetration found [m], not below 0. Within the tolerance there may be a deeper one, also within it."""
    allowed: float
    """Depth in the assembled pose, where it was needed, plus the tolerance [m]."""
    pose: float
    """Pose index, with fraction, of the deepest point found."""
    problem: str | None
    queries: int
    notes: tuple[str, ...] = ()
    by_fit: tuple[str, str] | None = None
    """The two parts, where only the fit that the plan declares of them allows it."""


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
    overlaps: AssembledOverlaps | None,
    tolerance: float,
    config: VerifyConfig,
) -> PairFinding:
    """Return what the moving body does to a fixed one along the path.

    ``overlaps`` tells what the overlap of the pair in the assembled pose excuses; None if nothing does. It is asked
    only if the pair goes deeper than the tolerance, because measuring it costs more than most pairs need.
    """
    pair = _Pair(moving, fixed, path, T_world_fixed, tolerance, config)
    excuse, once_parted = Excuse(depth=0.0), None
    # what is too deep as assembled needs the excuse, whatever else is on the way
    drawn = 0.0 if overlaps is None else sampled_depth(moving, fixed, pair.assembled)
    if overlaps is not None and drawn > tolerance:
        excuse = overlaps.excuse(moving.name, fixed.name)
    if excuse.depth > 0.0:
        found = Sweep(holds=False, exhausted=False, depth=drawn, at=float(len(path.angle)), queries=0, near=np.empty(0))
    else:
        found = pair.sweep(None, path)
    queries, drawn = found.queries, found.depth
    if overlaps is not None and not found.holds and not found.exhausted:
        excuse = overlaps.excuse(moving.name, fixed.name)
        if excuse.depth > 0.0:
            # an overlap in the assembled pose is an excuse while the pair is still in it, not for a second meeting
            parting = pair.parting() if excuse.depth > tolerance else 0.0
            since = min(int(parting), len(path.angle) - 1)
            found = pair.sweep(excuse, path.since(since))
            found = replace(found, at=found.at + since, near=found.near + since)
            queries += found.queries
            if parting > 0.0 and found.holds:
                once_parted = pair.sweep(None, path.until(parting))
                queries += once_parted.queries
                found = replace(found, near=np.union1d(found.near, once_parted.near))
    depth, at, holds, notes = found.depth, found.at, found.holds, ()
    if holds and len(found.near):
        depth, at, notes = pair.with_booleans(found)
        if depth > tolerance and overlaps is not None:
            excuse = overlaps.excuse(moving.name, fixed.name)
        holds = depth <= excuse.depth + tolerance and not (depth > tolerance and pair.far_off(excuse, at))
    problem = None if holds else _problem(fixed.name, depth, at, excuse, tolerance, found.exhausted)
    if problem is None and once_parted is not None and not once_parted.holds:
        said = (once_parted.depth, once_parted.at, Excuse(depth=0.0), tolerance, once_parted.exhausted)
        problem = (
            f"{_problem(fixed.name, *said)}: once parted from it, the overlap in the assembled pose excuses nothing"
        )
    return PairFinding(
        against=fixed.name,
        depth=max(0.0, depth, drawn),
        allowed=excuse.depth + tolerance,
        pose=at,
        problem=problem,
        queries=queries,
        notes=notes,
    )


def check_by_fit(
    moving: SampledBody,
    fixed: SampledBody,
    path: Screws,
    T_world_fixed: Float[np.ndarray, "4 4"],
    *,
    depth: float,
    config: VerifyConfig,
) -> PairFinding:
    """Return what the moving body does to a fixed one with which a fit is declared.

    They may go into each other up to the declared depth [m], wherever they are, and one may not slip through the other.
    """
    pair = _Pair(moving, fixed, path, T_world_fixed, depth, config)
    found = pair.sweep(None, path)
    deepest, at, notes = found.depth, found.at, ()
    if found.holds and len(found.near):
        deepest, at, notes = pair.with_booleans(found)
    problem = None
    if not found.holds or deepest > depth:
        problem = _problem(fixed.name, deepest, at, Excuse(depth=0.0), depth, found.exhausted)
        problem = problem.replace("(tolerance ", "(declared ")
    elif (time := pair.pierced_at(found)) is not None:
        at, problem = time, f"slips through {fixed.name} at pose {time:.2f}: no declared fit excuses that"
    return PairFinding(
        against=fixed.name,
        depth=max(0.0, deepest),
        allowed=depth,
        pose=at,
        problem=problem,
        queries=found.queries,
        notes=notes,
        by_fit=(moving.name, fixed.name),
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
        problem=None
        if found.holds
        else _problem("table", found.depth, found.at, Excuse(depth=0.0), tolerance, found.exhausted),
        queries=found.queries,
    )


def _problem(against: str, depth: float, at: float, excuse: Excuse, tolerance: float, exhausted: bool) -> str:
    """Say what is wrong with a pair that does not hold."""
    if exhausted:
        return f"could not be cleared of {against}: the queries ran out (max_queries)"
    beyond = f", {excuse.depth * 1e3:.4g} mm of it as assembled" if excuse.depth > tolerance else ""
    if depth <= excuse.depth + tolerance:
        beyond = ", too far from where they overlap as assembled to be excused by that"
    return (
        f"goes {depth * 1e3:.4g} mm deep into {against} at pose {at:.2f}{beyond} (tolerance {tolerance * 1e3:.4g} mm)"
    )


class _Pair:
    """One moving body, one fixed one, and the path between them."""

    def __init__(
        self,
        moving: SampledBody,
        fixed: SampledBody,
        path: Screws,
        T_world_fixed: Float[np.ndarray, "4 4"],
        tolerance: float,
        config: VerifyConfig,
    ) -> None:
        self._moving, self._fixed, self._path, self._T_world_fixed = moving, fixed, path, T_world_fixed
        self._tolerance, self._config = tolerance, config
        self._seen = path.seen_from(T_world_fixed)
        self.assembled = self._seen.pose_at(float(len(path.angle)))
        """The last pose of the path, seen from the fixed body."""

    def sweep(self, excuse: Excuse | None, path: Screws) -> Sweep:
        """Sweep the moving body's samples against the fixed one, then the fixed one's against the moving one."""
        config, tolerance, limit = self._config, self._tolerance, self._tolerance
        if excuse is not None and not excuse.places:  # as much everywhere
            excuse, limit = None, tolerance + excuse.depth
        options = {
            "limit": limit,
            "resolution": config.relative_resolution * tolerance,
            "coarse": 0.25 * min(self._moving.wall, self._fixed.wall),
        }
        ease = None if excuse is None else excuse.ease_moving(tolerance)
        seen = path.seen_from(self._T_world_fixed)
        out = sweep(self._moving.tree, self._fixed, seen, max_queries=config.max_queries, ease=ease, **options)
        if not out.holds:
            return out
        ease = None if excuse is None else excuse.ease_fixed(self._fixed.tree, tolerance)
        left, back = config.max_queries - out.queries, path.reversed_for(self._T_world_fixed)
        other = sweep(self._fixed.tree, self._moving, back, max_queries=left, ease=ease, **options)
        deeper = other if other.depth > out.depth or not other.holds else out
        return Sweep(
            holds=other.holds,
            exhausted=other.exhausted,
            depth=deeper.depth,
            at=deeper.at,
            queries=out.queries + other.queries,
            near=np.union1d(out.near, other.near),
        )

    def parting(self) -> float:
        """Return when the pair, walking back from the assembled pose, has first come apart [stretches]; 0 if never."""
        moving, path, config = self._moving, self._path, self._config
        least, parted = 0.25 * min(moving.wall, self._fixed.wall), config.relative_parted * self._tolerance
        time = float(len(path.angle))
        while time > 0.0:
            deepest = DeepestSample(moving, self._fixed, self._seen.pose_at(time))
            depth = deepest.depth
            if depth <= parted:
                break
            while depth > parted and time > 0.0:
                stretch = int(np.ceil(time)) - 1
                reach = path.angle[stretch] * moving.reach(path.point[stretch])
                speed = float(np.linalg.norm(path.shift[stretch])) + reach
                step = max(depth - parted, least)
                time = max(0.0, float(stretch), time - step / speed) if speed > 0.0 else float(stretch)
                depth = deepest.depth_at(self._seen.pose_at(time))
        return time

    def with_booleans(self, found: Sweep) -> tuple[float, float, tuple[str, ...]]:
        """Return the deepest of the samples and of the intersection bodies at some of the times of contact."""
        ranks = np.linspace(0.0, len(found.near) - 1.0, self._config.boolean_poses).round().astype(int)
        times = np.unique(np.append(found.near[np.unique(ranks)], found.at))
        depth, at = found.depth, found.at
        for time in times:
            T = self._pose(float(time))
            low, high = self._moving.box_in(T)
            if (low > self._fixed.high).any() or (high < self._fixed.low).any():
                continue
            common = intersection(self._moving, self._fixed, T, enough=self._tolerance)
            if not common.exact:
                return depth, at, (f"no boolean could be taken with {self._fixed.name}: samples only",)
            if common.depth > depth:
                depth, at = common.depth, float(time)
        return depth, at, ()

    def pierced_at(self, found: Sweep) -> float | None:
        """Return the first time at which one of the two has gone through the other; None if neither has."""
        return pierced_at(
            self._moving,
            self._fixed,
            self._seen,
            found.near,
            least=0.5 * pair_tolerance(self._moving, self._fixed, self._config),
            depth=self._tolerance,
            through=self._config.relative_through,
        )

    def far_off(self, excuse: Excuse, time: float) -> bool:
        """Return whether, at this time, the intersection body is too deep too far from the overlap as assembled."""
        if not excuse.places:
            return False
        T, tolerance = self._pose(time), self._tolerance
        left = intersection(self._moving, self._fixed, T, excuse=excuse, tolerance=tolerance, enough=tolerance)
        return left.depth > tolerance

    def _pose(self, time: float) -> Float[np.ndarray, "4 4"]:
        stretch = min(int(time), len(self._seen.angle) - 1)
        return self._seen.pose(stretch, time - stretch)

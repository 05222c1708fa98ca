"""Does anything that is turned along a thread dip too deep? Branch and bound over helices and turns.

All samples of a body that is turned many times about one axis at one pitch move along helices. A ball around the middle
of a piece of helix, as large as half the piece is long and as far as its neighbours are, holds that piece of all of
them. So where there is room, one look settles many samples for much of a turn. What it does not settle is cut up, down
to single helices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.verify.body import counted
from sashimono.verify.helices import Helices, HelixTree, helix_tree, laid_together
from sashimono.verify.target import Target, signed_distance

_CHUNK = 40_000
_MAX_PIECES = 16
_CELL = 1e-3
"""Side of the cells in which helices are one and the same, over the limit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HelixSweep:
    """What a sweep along the helices of one run found."""

    holds: bool
    exhausted: bool
    depth: float
    """Deepest sample that was looked at [m]."""
    at: float
    """Turn from where the run begins at which that is [rad]."""
    queries: int
    near: Float[np.ndarray, "turn"]
    """Turns at which a stretch of surface between samples could not be cleared [rad]."""


def sweep_helices(
    helices: Helices,
    run: int,
    points: Float[np.ndarray, "n 3"],
    radii: Float[np.ndarray, "n"],
    target: Target,
    *,
    limit: float,
    resolution: float,
    max_queries: int,
) -> HelixSweep:
    """Return whether samples stay less than ``limit`` deep in the target all along one run.

    Args:
        helices: The runs.
        run: Which one.
        points: The samples where the run begins, in the target's frame [m].
        radii: How far the surface goes for which each of them stands [m].
        target: What is not to be penetrated.
        limit: Allowed depth [m].
        resolution: Travel to either side [m] below which a sample that is within the limit is not looked at again.
        max_queries: Looks allowed.
    """
    helix, start = helices.invariants(run, points)
    least, most = helices.turned(run)
    cell = _CELL * limit
    tree = helix_tree(*laid_together(helix, start + least, start + most, cell))
    limit -= cell / float(np.sqrt(2.0))
    surface = float(radii.max())
    rates = np.hypot(tree.helix[:, 0], helices.pitch[run])
    node = np.array([len(tree.reach) - 1])
    stack = [(node, 0.5 * (tree.low[node] + tree.high[node]), 0.5 * (tree.high[node] - tree.low[node]))]
    depth, at, queries, near = -np.inf, 0.0, 0, []
    while stack:
        node, turn, half = stack.pop()
        if len(node) > _CHUNK:
            stack.append((node[_CHUNK:], turn[_CHUNK:], half[_CHUNK:]))
            node, turn, half = node[:_CHUNK], turn[:_CHUNK], half[:_CHUNK]
        queries += len(node)
        travel = rates[node] * half
        need = tree.reach[node] + travel - limit
        centers = helices.points(run, tree.helix[node], turn)
        # the surface around the samples is told as near, whatever the samples are cleared by
        beyond = np.maximum(need, surface - limit)
        close = np.flatnonzero(target.box_distance(centers) < beyond)
        s = signed_distance(target, centers[close], beyond[close], limit)
        node, turn, half, travel, need = node[close], turn[close], half[close], travel[close], need[close]
        leaf = tree.first_child[node] < 0
        turned = (turn - tree.low[node] + least).clip(least, most)  # when the sample that comes first is there
        if leaf.any():
            k = int(np.argmin(np.where(leaf, s, np.inf)))
            if -s[k] > depth:
                depth, at = -float(s[k]), float(turned[k])
        near.append(np.unique(np.round(turned[s < surface - limit], 2)))
        if depth > limit or queries > max_queries:
            break
        open_ = s < need
        stack.extend(_cut(tree, node[open_], turn[open_], half[open_], (s + limit)[open_], travel[open_], resolution))
    else:
        return HelixSweep(holds=True, exhausted=False, depth=depth, at=at, queries=queries, near=_joined(near))
    return HelixSweep(holds=False, exhausted=depth <= limit, depth=depth, at=at, queries=queries, near=_joined(near))


def _cut(
    tree: HelixTree,
    node: np.ndarray,
    turn: np.ndarray,
    half: np.ndarray,
    margin: np.ndarray,
    travel: np.ndarray,
    resolution: float,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return smaller pieces of those not settled; of single helices, those that are settled finely enough end here."""
    reach = tree.reach[node]
    leaf = tree.first_child[node] < 0
    in_space = np.flatnonzero(~leaf & (travel <= reach))
    in_time = np.flatnonzero((~leaf & (travel > reach)) | (leaf & (travel > margin) & (travel > resolution)))
    aim = np.maximum(margin - reach, np.where(leaf, resolution, reach))[in_time]
    pieces = np.clip(np.ceil(travel[in_time] / aim), 2, _MAX_PIECES).astype(np.int64)
    out = []
    if len(in_time):
        rows, within = counted(pieces)
        rows, pieces = in_time[rows], pieces[rows]
        shorter = half[rows] / pieces
        out.append((node[rows], turn[rows] - half[rows] + (2 * within + 1) * shorter, shorter))
    if len(in_space):
        rows, within = counted(tree.child_count[node[in_space]])
        rows = in_space[rows]
        child = tree.first_child[node[rows]] + within
        # only where the child is at all
        low = np.maximum(turn[rows] - half[rows], tree.low[child])
        high = np.minimum(turn[rows] + half[rows], tree.high[child])
        there = low <= high
        out.append((child[there], 0.5 * (low + high)[there], 0.5 * (high - low)[there]))
    return out


def _joined(turns: list[np.ndarray]) -> np.ndarray:
    return np.unique(np.concatenate(turns)) if turns else np.empty(0)

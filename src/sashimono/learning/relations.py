"""How parts stand to one another along lines that each could leave by: what `past-posed` sees of a blueprint.

Everything is measured on clouds of points with normals, and nothing changes when the whole is turned or moved. Sampled
points are far apart beside a fit's clearance, so distances between them say little there. Three things say more: how
far a point lies before the *plane* of another (exact for flat faces, nearly so for round ones), the share of points
that meet something within the distance of neighbouring samples, and whether what is met lies around them or only on one
side. Lengths are in the unit of the cloud; those marked "in spacings" are over the distance between samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit

VERSION = 3
"""Raised whenever the same clouds would give other numbers."""

PATH_FEATURES = (
    "entry_half", "entry_one", "entry_two", "entry_spacings", "entry_length", "entry_enclosed", "entry_enclosed_mean",
    "travel", "pressed", "exit_half", "exit_one", "exit_spacings", "exit_enclosed", "exit_enclosed_mean",
    "wall_spacings", "wall_length", "wall_inside", "wall_all_inside", "own_spacings", "own_length", "own_inside",
    "touch_most", "touch_against", "touch_many", "touch_along", "touch_away", "ahead", "beyond",
)  # fmt: skip
"""Of a part that moves along a direction, by other part: see `_along`."""

PAIR_FEATURES = ("distance", "distance_spacings", "near", "nearer", "spacing", "finer", "touch")
"""Of two parts, whatever the direction: see `_touching`."""

LINE_FEATURES = ("across", "parallel", "touch_across", "touch_parallel", "front", "length", "width", "touches")
"""Of a part and a direction, whatever the others: see `_along`."""


@dataclass(frozen=True, kw_only=True)
class RelationConfig:
    """How closely relations are measured."""

    points: int = 768
    """First points of each part that are looked at."""
    lines: int = 8
    """Lines of each part; it may leave along each both ways."""
    facing: int = 80
    """Most points of a part that face a direction, and most that face away from it or stand across it; of another part,
    of those beside or ahead of the moving one."""
    touching: int = 160
    """First points of each part between which contact is sought."""

    @property
    def directions(self) -> int:
        """Directions of each part."""
        return 2 * self.lines


@dataclass(frozen=True, kw_only=True, eq=False)
class Relations:
    """Relations of all parts of a blueprint."""

    directions: Float[np.ndarray, "part direction 3"]
    """Unit vectors along which a part may leave; the second half is opposite to the first."""
    paths: Float[np.ndarray, "part part direction path"]
    """[i, j, d]: what i meets of j on its way along its direction d."""
    pairs: Float[np.ndarray, "part part pair"]
    lines: Float[np.ndarray, "part direction line"]


def find_relations(
    clouds: Float[np.ndarray, "part point 6"], *, config: RelationConfig | None = None, workers: int = 1
) -> Relations:
    """Return the relations of parts in place, in the unit frame; the same whatever the number of threads."""
    config = config or RelationConfig()
    clouds = np.ascontiguousarray(clouds[:, : config.points], dtype=np.float32)
    count, K = len(clouds), config.directions
    spacing = _spacing(clouds)
    pairs = np.zeros((count, count, len(PAIR_FEATURES)), np.float32)
    touches = np.zeros((count, count, _MOST_TOUCHES, 3), np.float32)
    touched = np.zeros((count, count), np.int32)
    directions = np.zeros((count, K, 3), np.float32)
    paths = np.zeros((count, count, K, len(PATH_FEATURES)), np.float32)
    lines = np.zeros((count, K, len(LINE_FEATURES)), np.float32)

    def touch(i: int) -> None:
        _touching(i, clouds, spacing, config.touching, pairs, touches, touched)

    def follow(i: int) -> None:
        _choose_lines(clouds[i], touches[i], touched[i], directions[i], lines[i])
        _along(i, clouds, spacing, touches, touched, config.facing, directions, paths, lines)

    for stage in (touch, follow):
        _each(stage, range(count), workers)
    return Relations(directions=directions, paths=paths, pairs=pairs, lines=lines)


def _each(function, items: Iterable[int], workers: int) -> None:
    if workers == 1:
        for item in items:
            function(item)
        return
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(function, items))


_MOST_TOUCHES = 24
"""Touching points kept of a pair."""
_TOLERANCE = 0.004
"""Points so far beyond a plane still lie before it: half-precision coordinates, facets, press fits."""
_FACING = 0.25
"""Least cosine between a normal and a direction for a point to face it; those below stand across it."""
_FAR = 4.0
"""Distances are cut off at so many spacings."""


@njit(cache=True, nogil=True, fastmath=True)
def _spacing(clouds):
    """Distance between neighbouring samples of each part: twice the mean distance to the nearest one."""
    count, points = clouds.shape[0], clouds.shape[1]
    out = np.empty(count, np.float32)
    asked = min(points, 48)
    for i in range(count):
        total = 0.0
        for p in range(asked):
            best = np.float32(1e9)
            for q in range(points):
                dx = clouds[i, p, 0] - clouds[i, q, 0]
                dy = clouds[i, p, 1] - clouds[i, q, 1]
                dz = clouds[i, p, 2] - clouds[i, q, 2]
                d = dx * dx + dy * dy + dz * dz
                if q != p and d < best:
                    best = d
            total += np.sqrt(best)
        out[i] = max(2.0 * total / asked, 1e-4)
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _touching(i, clouds, spacing, most, pairs, touches, touched):
    """Distances of part i to the others, and normals of i, outward, where it touches them.

    Two points touch if each lies in the other's plane, their normals are opposite, and they are neighbouring samples.
    """
    count = clouds.shape[0]
    points = min(clouds.shape[1], most)
    thinned = np.float32(np.sqrt(clouds.shape[1] / points))
    for j in range(count):
        if j == i:
            continue
        reach = thinned * max(spacing[i], spacing[j])
        near2 = np.float32((1.5 * reach) ** 2)
        found, least, near, nearer, pressed = 0, np.float32(1e9), 0, 0, 0
        for p in range(points):
            x, y, z = clouds[i, p, 0], clouds[i, p, 1], clouds[i, p, 2]
            a, b, c = clouds[i, p, 3], clouds[i, p, 4], clouds[i, p, 5]
            best, hit = np.float32(1e9), False
            for q in range(points):
                dx = clouds[j, q, 0] - x
                dy = clouds[j, q, 1] - y
                dz = clouds[j, q, 2] - z
                d = dx * dx + dy * dy + dz * dz
                best = min(best, d)
                if d < near2 and not hit:
                    e, f, g = clouds[j, q, 3], clouds[j, q, 4], clouds[j, q, 5]
                    if (
                        a * e + b * f + c * g < -0.8
                        and abs(dx * a + dy * b + dz * c) < 2.0 * _TOLERANCE
                        and abs(dx * e + dy * f + dz * g) < 2.0 * _TOLERANCE
                    ):
                        hit = True
            least = min(least, best)
            near += best < near2
            nearer += 4.0 * best < near2
            if hit:
                pressed += 1
                if found < _MOST_TOUCHES:
                    touches[i, j, found, 0], touches[i, j, found, 1], touches[i, j, found, 2] = a, b, c
                    found += 1
        touched[i, j] = found
        least = np.sqrt(least)
        pairs[i, j, 0] = min(least, 1.0)
        pairs[i, j, 1] = min(least / reach, _FAR) / _FAR
        pairs[i, j, 2] = near / points
        pairs[i, j, 3] = nearer / points
        pairs[i, j, 4] = min(10.0 * spacing[j], 2.0)
        pairs[i, j, 5] = min(max(np.log(spacing[i] / spacing[j]) / 3.0, -1.0), 1.0)
        pairs[i, j, 6] = pressed / points


@njit(cache=True, nogil=True, fastmath=True)
def _fitness(line, normals, count):
    """Shares of normals that stand across a line and that lie along it, nearly exactly."""
    across, parallel = 0.0, 0.0
    for n in range(count):
        cosine = abs(line[0] * normals[n, 0] + line[1] * normals[n, 1] + line[2] * normals[n, 2])
        if cosine < 0.1:
            across += 1.0 / (1.0 + (cosine / 0.01) ** 2)
        elif cosine > 0.98:
            parallel += 1.0 / (1.0 + (1.0 - cosine) / 1e-4)
    return across / max(count, 1), parallel / max(count, 1)


@njit(cache=True, nogil=True, fastmath=True)
def _choose_lines(cloud, touches, touched, directions, out):
    """Fill in the directions of a part: lines that most normals of it, and most where it is touched, keep to.

    A part slides along a line that the normals of its contacts stand across: an axis, an edge. Candidates are its
    normals and the products of two of them. The first three lines are at right angles: of a plate, all lines within it
    are equally fit, and its normal must be among those chosen. The second half of the directions is opposite to the
    first.
    """
    own = np.empty((96, 3), np.float32)
    own_count = min(len(cloud), 96)
    for n in range(own_count):
        own[n] = cloud[n, 3:]
    held = np.empty((128, 3), np.float32)
    held_count = 0
    for n in range(touches.shape[1]):  # evenly from all neighbours
        for j in range(len(touched)):
            if n < touched[j] and held_count < 128:
                held[held_count] = touches[j, n]
                held_count += 1
    candidates = np.empty((192, 3), np.float32)
    found = 0
    for part in range(2):
        normals, count = (own, own_count) if part == 0 else (held, held_count)
        if count == 0:
            continue
        for n in range(min(count, 28)):
            candidates[found] = normals[n]
            found += 1
        for n in range(68):
            a, b = normals[(7 * n) % count], normals[(11 * n + 3 + n // 7) % count]
            x = a[1] * b[2] - a[2] * b[1]
            y = a[2] * b[0] - a[0] * b[2]
            z = a[0] * b[1] - a[1] * b[0]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.3:
                candidates[found, 0], candidates[found, 1], candidates[found, 2] = x / length, y / length, z / length
                found += 1
    score = np.empty((found, 5), np.float32)
    for n in range(found):
        score[n, 1], score[n, 2] = _fitness(candidates[n], own, own_count)
        score[n, 3], score[n, 4] = _fitness(candidates[n], held, held_count)
        score[n, 0] = score[n, 1] + score[n, 2] + 1.5 * score[n, 3] + score[n, 4]
    half = len(directions) // 2
    line = np.empty(3, np.float32)
    for k in range(half):
        best = -1
        for n in range(found):
            if score[n, 0] < 0.0 or (best >= 0 and score[n, 0] <= score[best, 0] + 1e-4):
                continue
            if k == 1 and abs(_dot(directions[0], candidates[n])) > 0.02:
                continue
            best = n
        if k == 2 or (k == 1 and best < 0):
            other = directions[1]
            if k == 1:  # any line that is not the first
                other = np.zeros(3, np.float32)
                other[np.argmin(np.abs(directions[0]))] = 1.0
            _cross(directions[0], other, line)
            across, parallel = _fitness(line, own, own_count)
            held_across, held_parallel = _fitness(line, held, held_count)
        elif best < 0:  # fewer lines than asked for: the first again
            line[:] = directions[0]
            across, parallel, held_across, held_parallel = out[0, 0], out[0, 1], out[0, 2], out[0, 3]
        else:
            line[:] = candidates[best]
            across, parallel, held_across, held_parallel = (
                score[best, 1],
                score[best, 2],
                score[best, 3],
                score[best, 4],
            )
        for side in range(2):
            directions[side * half + k] = line if side == 0 else -line
            out[side * half + k, 0], out[side * half + k, 1] = across, parallel
            out[side * half + k, 2], out[side * half + k, 3] = held_across, held_parallel
        for n in range(found):
            if abs(_dot(line, candidates[n])) > 0.97:
                score[n, 0] = -1.0


@njit(cache=True, nogil=True, fastmath=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, fastmath=True)
def _cross(a, b, out):
    """Write the unit vector across two others."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    out /= np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])


@njit(cache=True, nogil=True, fastmath=True)
def _along(i, clouds, spacing, touches, touched, most, directions, paths, lines):
    """What part i meets of every other part on its way along each of its directions.

    Front points of i face the direction. Points of j that face the other way are entries, those that face it are
    exits, the rest are walls. A ray from a front point enters before it exits; an exit without an entry is an entry
    that no sample shows, as of a small hole in a large plate. ``inside`` is the share of front points that lie behind
    the wall nearest to them across the direction: in j's material, once i has come so far.
    """
    count, points = clouds.shape[0], clouds.shape[1]
    K = directions.shape[1]
    kinds = np.empty(3, np.int64)
    own_kinds = np.empty(3, np.int64)
    # by kind: across, across, along; the normal likewise
    own = np.empty((3, most, 6), np.float32)
    met = np.empty((3, most, 6), np.float32)
    box, other_box, no_box = np.empty(6, np.float32), np.empty(6, np.float32), np.empty(6, np.float32)
    frame = np.empty((3, 3), np.float32)
    no_box[:3], no_box[3:] = -1e9, 1e9
    total = 0
    for j in range(count):
        total += touched[i, j]
    for k in range(K):
        d = directions[i, k]
        first = abs(_dot(d, directions[i, 0])) < 0.8
        _frame(d, directions[i, 0] if first else directions[i, 1], frame)
        facing = _project(clouds[i], frame, no_box, most, own, own_kinds, box)
        fronts = min(own_kinds[0], most)
        thinned_own = np.float32(spacing[i] * np.sqrt(max(1.0, facing / most)))
        lines[i, k, 4] = facing / points
        lines[i, k, 5] = box[5] - box[2]
        lines[i, k, 6] = max(box[3] - box[0], box[4] - box[1])
        lines[i, k, 7] = min(total / 64.0, 2.0)
        near = box.copy()
        for j in range(count):
            if j == i:
                continue
            out = paths[i, j, k]
            out[:] = 0.0
            out[3] = out[11] = out[14] = out[15] = out[18] = out[19] = out[7] = out[4] = 1.0
            h = max(spacing[i], spacing[j])
            for c in range(2):
                near[c], near[3 + c] = box[c] - 2.0 * h, box[3 + c] + 2.0 * h
            near[2], near[5] = box[2] - 2.0 * _TOLERANCE, 1e9
            _project(clouds[j], frame, near, most, met, kinds, other_box)
            out[26] = min(max(other_box[2] - box[5], -1.0), 1.0)
            out[27] = min(max(other_box[5] - box[2], -1.0), 1.0)
            if touched[i, j]:
                _touch(d, touches[i, j], touched[i, j], out)
            if fronts == 0:
                continue
            h = max(h, thinned_own)
            _meet(own[0], fronts, met[1], min(kinds[1], most), True, _thinned(h, spacing[j], kinds[1], most), out)
            _meet(own[0], fronts, met[0], min(kinds[0], most), False, _thinned(h, spacing[j], kinds[0], most), out)
            wide = _thinned(h, spacing[j], kinds[2], most)
            _pass_walls(own[0], fronts, met[2], min(kinds[2], most), wide, out)
            wide = _thinned(h, spacing[j], kinds[1], most)
            _pass_outline(met[1], min(kinds[1], most), own[2], min(own_kinds[2], most), wide, out)


@njit(cache=True, nogil=True, fastmath=True)
def _thinned(h, spacing, found, most):
    """Distance between samples when only so many of those found are looked at."""
    return np.float32(max(h, spacing * np.sqrt(max(1.0, found / most))))


@njit(cache=True, nogil=True, fastmath=True)
def _frame(d, other, frame):
    """Fill in two directions across another, and it. They follow a line of the part, so that all turns with it."""
    _cross(d, other, frame[0])
    _cross(d, frame[0], frame[1])
    frame[2] = d


@njit(cache=True, nogil=True, fastmath=True)
def _project(cloud, frame, within, most, chosen, kinds, box):
    """Sort the first points within a box by how they face the last direction of the frame; return how many face it.

    ``kinds`` gets how many there are of each kind, of which ``chosen`` gets at most so many, and ``box`` the bounds of
    the whole cloud.
    """
    u, v, d = frame[0], frame[1], frame[2]
    for c in range(3):
        kinds[c], box[c], box[3 + c] = 0, 1e9, -1e9
    for p in range(cloud.shape[0]):
        x, y, z = cloud[p, 0], cloud[p, 1], cloud[p, 2]
        a = x * u[0] + y * u[1] + z * u[2]
        b = x * v[0] + y * v[1] + z * v[2]
        s = x * d[0] + y * d[1] + z * d[2]
        box[0], box[1], box[2] = min(box[0], a), min(box[1], b), min(box[2], s)
        box[3], box[4], box[5] = max(box[3], a), max(box[4], b), max(box[5], s)
        if a < within[0] or b < within[1] or s < within[2] or a > within[3] or b > within[4]:
            continue
        e, f, g = cloud[p, 3], cloud[p, 4], cloud[p, 5]
        cosine = e * d[0] + f * d[1] + g * d[2]
        kind = 0 if cosine > _FACING else (1 if cosine < -_FACING else 2)
        n = kinds[kind]
        kinds[kind] = n + 1
        if n < most:
            chosen[kind, n, 0], chosen[kind, n, 1], chosen[kind, n, 2] = a, b, s
            chosen[kind, n, 3] = e * u[0] + f * u[1] + g * u[2]
            chosen[kind, n, 4] = e * v[0] + f * v[1] + g * v[2]
            chosen[kind, n, 5] = cosine
    return kinds[0]


@njit(cache=True, nogil=True, fastmath=True)
def _touch(d, touches, found, out):
    """How the normals of contacts stand to the direction."""
    worst, against, along, away = np.float32(-1.0), 0, 0, 0
    for n in range(found):
        cosine = _dot(touches[n], d)
        worst = max(worst, cosine)
        against += cosine > 0.08
        along += abs(cosine) <= 0.08
        away += cosine < -0.08
    out[21], out[22], out[23] = worst, against / found, found / _MOST_TOUCHES
    out[24], out[25] = along / found, away / found


@njit(cache=True, nogil=True, fastmath=True)
def _meet(front, fronts, others, count, entering, h, out):
    """Entries, or exits, ahead of the front points."""
    reach2 = np.float32((2.0 * h) ** 2)
    half, one, two, pressed = 0, 0, 0, 0
    least, first = np.float32(1e9), np.float32(1.0)
    enclosed, enclosed_sum = np.float32(0.0), np.float32(0.0)
    for p in range(fronts):
        a, b, s = front[p, 0], front[p, 1], front[p, 2]
        best, hit = np.float32(1e9), False
        weight, off_a, off_b = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for q in range(count):
            da = others[q, 0] - a
            db = others[q, 1] - b
            # how far the point lies before the plane of the other
            before = -(da * others[q, 3] + db * others[q, 4] + (others[q, 2] - s) * others[q, 5])
            if before <= -_TOLERANCE if entering else before >= -_TOLERANCE:
                continue
            across2 = da * da + db * db
            best = min(best, across2)
            if across2 < reach2:
                w = 1.0 - across2 / reach2
                w = w * w
                weight += w
                off_a += w * da
                off_b += w * db
                if 4.0 * across2 < reach2:
                    first = min(first, max(before / abs(others[q, 5]), 0.0))
                    hit |= abs(before) < 1.5 * _TOLERANCE
        pressed += hit
        least = min(least, best)
        half += 16.0 * best < reach2
        one += 4.0 * best < reach2
        two += best < reach2
        if weight > 0.0:
            off = np.sqrt(off_a * off_a + off_b * off_b) / (weight * 2.0 * h)
            around = min(weight, 2.0) * 0.5 * max(0.0, 1.0 - 3.0 * off)
            enclosed = max(enclosed, around)
            enclosed_sum += around
    least = np.sqrt(least)
    if entering:
        out[0], out[1], out[2] = half / fronts, one / fronts, two / fronts
        out[3] = min(least / h, _FAR) / _FAR
        out[4] = min(3.0 * least, 1.0)
        out[5], out[6] = enclosed, enclosed_sum / fronts
        out[7], out[8] = first, pressed / fronts
    else:
        out[9], out[10] = half / fronts, one / fronts
        out[11] = min(least / h, _FAR) / _FAR
        out[12], out[13] = enclosed, enclosed_sum / fronts


@njit(cache=True, nogil=True, fastmath=True)
def _pass_walls(front, fronts, walls, count, h, out):
    """On which side of the nearest wall beside their way the front points pass."""
    reach2 = np.float32((2.0 * h) ** 2)
    least, inside, all_inside = np.float32(1e9), 0, 0
    for p in range(fronts):
        best, side, most_side = np.float32(1e9), np.float32(1e9), np.float32(-1e9)
        for q in range(count):
            if walls[q, 2] < front[p, 2] - _TOLERANCE:
                continue
            da = front[p, 0] - walls[q, 0]
            db = front[p, 1] - walls[q, 1]
            across2 = da * da + db * db
            if across2 < reach2:
                before = da * walls[q, 3] + db * walls[q, 4]
                most_side = max(most_side, before)
                if across2 < best:
                    best, side = across2, before
        if best < 1e8:
            least = min(least, side)
            inside += side < -_TOLERANCE
            all_inside += most_side < -_TOLERANCE
    out[14] = min(max(least / h, -1.0), 1.0)
    out[15] = min(max(20.0 * least, -1.0), 1.0)
    out[16], out[17] = inside / fronts, all_inside / fronts


@njit(cache=True, nogil=True, fastmath=True)
def _pass_outline(entries, count, walls, wall_count, h, out):
    """On which side of the moving part's nearest wall the entries ahead of it lie."""
    reach2 = np.float32((2.0 * h) ** 2)
    least, inside = np.float32(1e9), 0
    for q in range(count):
        best, side = np.float32(1e9), np.float32(1e9)
        for p in range(wall_count):
            da = entries[q, 0] - walls[p, 0]
            db = entries[q, 1] - walls[p, 1]
            across2 = da * da + db * db
            if across2 < reach2 and across2 < best:
                ds = entries[q, 2] - walls[p, 2]
                if da * entries[q, 3] + db * entries[q, 4] + ds * entries[q, 5] < _TOLERANCE:
                    best, side = across2, da * walls[p, 3] + db * walls[p, 4]
        if best < 1e8:
            least = min(least, side)
            inside += side < -_TOLERANCE
    out[18] = min(max(least / h, -1.0), 1.0)
    out[19] = min(max(20.0 * least, -1.0), 1.0)
    out[20] = inside / max(count, 1)

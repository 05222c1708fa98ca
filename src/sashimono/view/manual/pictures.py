"""One picture a task: what stands in grey, what comes in orange, arrows for its way; and the exploded cover."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.geometry.legs import Leg, simple_legs
from sashimono.plan import AssemblyPlan, Step
from sashimono.raster.png import png_bytes
from sashimono.raster.zbuffer import Layer
from sashimono.view.appearance import linear_rgb, part_colors
from sashimono.view.display_mesh import cluster_vertices
from sashimono.view.explode import Explosion
from sashimono.view.manual.arrows import Mark, has_room, path_arrow, straight_arrow, trail, turn_arrow
from sashimono.view.manual.camera import Stand, Subject, choose_glass, choose_stand
from sashimono.view.manual.content import BillRow, Task
from sashimono.view.manual.drawing import Solid, View, draw_picture, fit_view, layer_of, look_from

MOVING = "#f07d1a"
"""What comes; nothing else is orange."""
PLACED = "#d3d8de"
"""What stands, before its own colour is mixed in."""
HELD = "#7fa8e6"
"""What must be held."""
_STRETCHES = (1.7, 2.6)
"""Where no arrow fits between what comes and its mouth, it is drawn so many times farther from there."""
_SMALLER = 0.7
"""Unless that makes the picture smaller than this."""
_BALLOON_COLUMN = 120
"""Left free on either side of the exploded picture [pixels]."""
OVERVIEW = (230, 170)
"""Width and height of the small picture of the whole [pixels]."""


@dataclass(frozen=True, kw_only=True)
class PictureConfig:
    """How pictures are made."""

    width: int = 960
    height: int = 600
    supersample: int = 2
    """Pixels drawn for each one of the image, along each side."""
    coarse: int = 1500
    """Surfaces of more triangles are simplified where views are compared."""
    detail: float = 3.2
    """Where the whole is so many times larger than what a task is about, a detail is drawn, and the whole beside it."""
    thumbnail: int = 132
    """Width and height of the picture of a part [pixels]."""
    cover_width: int = 1200
    cover_height: tuple[int, int] = (640, 1080)
    """Least and greatest height of the exploded picture, which follows from what it shows [pixels]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Illustration:
    """A picture, and what is drawn over it as lines and words."""

    png: bytes
    width: int
    height: int
    marks: tuple[Mark, ...] = ()
    overview: bytes | None = None
    """PNG of the whole, where the picture shows a detail."""
    overview_frame: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """What the picture shows of the overview: left, top, width, height [pixels]."""
    overview_corner: tuple[int, int] = (0, 0)
    """Left and top of the overview in the picture [pixels]."""
    busy: Float[np.ndarray, "row column"] = field(default_factory=lambda: np.zeros((1, 1)))
    """How much is drawn, a value each 8 pixels: 1 for what stands, more for what comes and where it ends."""
    glass: bool = False
    """Whether something is drawn as glass."""


class Illustrator:
    """Draws the pictures of one plan; views follow one another, so tasks are drawn in order."""

    def __init__(self, plan: AssemblyPlan, assembly: Assembly, config: PictureConfig | None = None) -> None:
        self._plan, self._assembly = plan, assembly
        self._config = config or PictureConfig()
        self._colors = {name: np.array(linear_rgb(c)) for name, c in part_colors(plan, assembly).items()}
        self._last: Stand | None = None

    def task(self, task: Task) -> Illustration:
        """Return the picture of a task."""
        config = self._config
        held = {*task.held, *task.clamped}
        fixed = tuple(self._placed(name, name in held) for name in task.placed)
        orange = np.array(linear_rgb(MOVING))
        target = tuple(self._solid(name, np.eye(4), orange) for name in task.members)
        back = self._drawn_back(task, fixed, 1.0)
        subject = Subject(
            fixed=tuple(self._coarse(solid) for solid in fixed),
            moving=tuple(self._coarse(solid) for solid in back.solids),
            target=tuple(self._coarse(solid) for solid in target),
            way=np.concatenate(back.sampled) if back.sampled else np.zeros((0, 3)),
            direction=task.step.direction,
        )
        stand = choose_stand(subject, task.up, None if task.turns_product else self._last)
        self._last = stand
        R = look_from(task.up, stand.azimuth, stand.elevation)
        glass = choose_glass(subject, R) if fixed else frozenset()
        fixed = tuple(_glassy(solid) if k in glass else solid for k, solid in enumerate(fixed))
        first = shot = self._shot(fixed, target, back, R)
        for stretch in _STRETCHES:
            if shot.arrows_fit:
                break
            shot = self._shot(fixed, target, self._drawn_back(task, fixed, stretch), R)
        if not shot.arrows_fit or shot.view.scale < _SMALLER * first.view.scale:
            shot = first
        view, whole = shot.view, shot.whole
        solids = [*fixed, *shot.back.solids]
        marks = self._marks(shot)
        overview, frame = None, (0.0, 0.0, 0.0, 0.0)
        if whole is not None:
            overview = png_bytes(draw_picture(solids, whole, times=config.supersample))
            ratio = whole.scale / view.scale
            half = np.array([view.width, view.height]) * 0.5 * ratio
            middle = (view.middle - whole.middle) * whole.scale * [1.0, -1.0] + 0.5 * np.array(OVERVIEW)
            left, top, wide, high = (float(x) for x in (*(middle - half), *(2.0 * half)))
            frame = (left, top, wide, high)
        ends = target if any(way is not None for way in shot.back.ways) else ()
        pixels = draw_picture(solids, view, outlined=ends, times=config.supersample)
        goal = layer_of(target, view, shaded=False).covered
        busy = _busy(pixels, [np.asarray(shot.own.any(axis=0)), goal])
        return Illustration(
            png=png_bytes(pixels),
            width=config.width,
            height=config.height,
            marks=marks,
            overview=overview,
            overview_frame=frame,
            overview_corner=_free_corner(busy, OVERVIEW, config),
            busy=busy,
            glass=bool(glass),
        )

    def _drawn_back(self, task: Task, fixed: Sequence[Solid], stretch: float) -> _Back:
        """What comes, drawn back along its way, ``stretch`` times as far from its mouth as usual."""
        orange = np.array(linear_rgb(MOVING))
        solids: list[Solid] = []
        ways: list[Way | None] = []
        owner: list[int] = []
        for k, step in enumerate(task.steps):
            shift, way = self._shown(step, fixed, stretch)
            ways.append(way)
            for name in step.members:
                solids.append(self._solid(name, shift, orange))
                owner.append(k)
        return _Back(solids=tuple(solids), ways=tuple(ways), owner=tuple(owner))

    def _shot(self, fixed: Sequence[Solid], target: Sequence[Solid], back: _Back, R: Float[np.ndarray, "3 3"]) -> _Shot:
        everything = np.concatenate([solid.points for solid in (*fixed, *back.solids)])
        focus = np.concatenate([solid.points for solid in (*back.solids, *target)] + back.sampled)
        view, whole = self._views(everything, focus, R)
        seen = layer_of([*fixed, *back.solids], view, shaded=False).part - len(fixed)
        owner = np.array(back.owner)
        own = np.array([np.isin(seen, np.flatnonzero(owner == k)) for k in range(len(back.ways))])
        return _Shot(back=back, view=view, whole=whole, own=own)

    def thumbnail(self, names: Sequence[str], up: Float[np.ndarray, "3"]) -> bytes:
        """Return a small PNG of one part, or of parts together, in their own colours."""
        size = self._config.thumbnail
        solids = [self._solid(name, np.eye(4), self._colors[name]) for name in names]
        points = np.concatenate([solid.points for solid in solids])
        view = fit_view(points, look_from(up, -0.9, 0.5), size, size, 0.05)
        return png_bytes(draw_picture(solids, view, times=self._config.supersample))

    def cover(self, bill: Sequence[BillRow], up: Float[np.ndarray, "3"], apart: Explosion) -> Illustration:
        """Return the exploded picture, with a balloon for each line of the bill of materials."""
        offsets = {name: apart.offset(name) for name in self._assembly.names}
        solids = [
            self._solid(part.name, se3.make(translation=offsets[part.name]), self._colors[part.name])
            for part in self._assembly.parts
        ]
        points = np.concatenate([solid.points for solid in solids])
        R = self._best_of_all(solids, up)
        width = self._config.cover_width
        right, high = np.ptp(points @ R[:2].T, axis=0)
        room = width - 2.0 * _BALLOON_COLUMN
        height = int(np.clip(room * high / max(right, 1e-9) + 60.0, *self._config.cover_height))
        inner = fit_view(points, R, int(room), height, 0.03)
        view = View(R=R, middle=inner.middle, scale=inner.scale, width=width, height=height)
        seen = layer_of(solids, view, shaded=False)
        anchors = {}
        for row in bill:
            places = [anchor for name in row.names if (anchor := _inside(seen, self._assembly.index(name))) is not None]
            if places:
                anchors[row.number] = max(places, key=lambda place: place[2])[:2]
        half = 0.5 * right * view.scale
        columns = (0.5 * width - half - 80.0, 0.5 * width + half + 80.0)
        marks = [*self._ways_apart(apart, view), *_balloons(anchors, columns, height)]
        pixels = draw_picture(solids, view, times=self._config.supersample)
        return Illustration(png=png_bytes(pixels), width=width, height=height, marks=tuple(marks))

    def _ways_apart(self, apart: Explosion, view: View) -> list[Mark]:
        """Thin lines along which the parts were drawn off what they sit on, wherever that is drawn."""
        marks = []
        for part in self._assembly.parts:
            seat = apart.seats.get(part.name)
            start = np.zeros(3) if seat is None else apart.offset(seat)
            end = apart.offset(part.name)
            if np.linalg.norm(end - start) > 1e-9:
                middle = part.bounds_world.mean(axis=0)
                a, b = view.pixel(np.array([middle + start, middle + end]))
                marks.append(Mark(kind="trail", points=((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))))
        return marks

    def _best_of_all(self, solids: Sequence[Solid], up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
        """The view in which most of the parts are seen."""
        best, most = look_from(up, -1.0, 0.5), -np.inf
        for k in range(12):
            for elevation in (0.45, 0.8):
                R = look_from(up, -1.0 + k * np.pi / 6.0, elevation)
                view = fit_view(np.concatenate([solid.points for solid in solids]), R, 120, 90, 0.02)
                seen = np.bincount(layer_of(solids, view, shaded=False).part.reshape(-1) + 1, minlength=len(solids) + 1)
                score = float(np.minimum(seen[1:], 60).sum()) - 5.0 * (elevation > 0.5)
                if score > most:
                    best, most = R, score
        return best

    def _coarse(self, solid: Solid) -> Solid:
        """The solid with less detail, by which views are compared."""
        if len(solid.faces) <= self._config.coarse:
            return solid
        points, faces = cluster_vertices(solid.points, np.asarray(solid.faces, dtype=np.int64), 6)
        return Solid(points=points, faces=faces, color=solid.color)

    def _solid(self, name: str, shift: Float[np.ndarray, "4 4"], color: np.ndarray) -> Solid:
        part: Part = self._assembly.part(name)
        points = se3.apply(shift @ self._plan.parts[name], part.vertices_part)
        return Solid(points=points, faces=part.faces, color=color)

    def _placed(self, name: str, held: bool) -> Solid:
        if held:
            return self._solid(name, np.eye(4), np.array(linear_rgb(HELD)))
        return self._solid(name, np.eye(4), 0.72 * np.array(linear_rgb(PLACED)) + 0.28 * self._colors[name])

    def _shown(self, step: Step, fixed: Sequence[Solid], stretch: float) -> tuple[Float[np.ndarray, "4 4"], Way | None]:
        """Where a step's parts are drawn, as a displacement from the assembled pose, and the way from there."""
        legs = step.insertion
        if not legs:
            return np.eye(4), None
        points = np.concatenate([self._solid(name, np.eye(4), np.zeros(3)).points for name in step.members])
        low, high = points.min(axis=0), points.max(axis=0)
        size = float(np.linalg.norm(high - low))
        whole = np.concatenate([points, *(solid.points for solid in fixed)])
        gap = stretch * min(0.6 * size, 0.22 * float(np.linalg.norm(np.ptp(whole, axis=0))))
        if len(legs) == 1 and legs[0].length > 1e-6:
            leg = legs[0]
            along = points @ leg.direction
            front = 0.5 * (low + high)
            front = front + (along.max() - front @ leg.direction) * leg.direction
            rise = min(_rise(points, fixed, leg.direction, size), leg.length)
            shift = se3.make(translation=-(rise + gap) * leg.direction)
            back = front - (along.max() - along.min() + rise + gap) * leg.direction
            way = Way(
                points=np.array([front - (rise + gap) * leg.direction, front - rise * leg.direction]),
                turn=_turn(legs), bent=False, back=back, radius=_radius(points, front, leg.direction), end=front,
            )  # fmt: skip
            return shift, way
        start = min(segment.start for segment in step.motion.segments if segment.kind == "insertion")
        to_start = se3.inverse(self._plan.parts[step.part])
        shifts = step.motion.T_world_part[start:] @ to_start
        middle = 0.5 * (low + high)
        track = shifts[:, :3, :3] @ middle + shifts[:, :3, 3]
        way = Way(points=track, turn=_turn(legs), bent=True, back=track[0], radius=0.3 * size, end=track[-1])
        return shifts[0], way

    def _views(
        self, everything: Float[np.ndarray, "n 3"], focus: Float[np.ndarray, "m 3"], R: Float[np.ndarray, "3 3"]
    ) -> tuple[View, View | None]:
        """The picture's view, and that of the whole where the picture is a detail."""
        config = self._config
        whole = fit_view(everything, R, config.width, config.height)
        near = fit_view(focus, R, config.width, config.height)
        if near.scale <= config.detail * whole.scale:
            return whole, None
        scale = max(near.scale / 2.4, 1.6 * whole.scale)
        # the window stays on what there is to see
        flat = everything @ R[:2].T
        half = 0.5 * np.array([config.width, config.height]) / scale
        low, high = flat.min(axis=0) - 0.1 * half, flat.max(axis=0) + 0.1 * half
        middle = np.where(high - low > 2.0 * half, np.clip(near.middle, low + half, high - half), 0.5 * (low + high))
        view = View(R=R, middle=middle, scale=scale, width=config.width, height=config.height)
        return view, fit_view(everything, R, *OVERVIEW, 0.04)

    def _marks(self, shot: _Shot) -> tuple[Mark, ...]:
        marks: list[Mark] = []
        view = shot.view
        for way, own in zip(shot.back.ways, shot.own, strict=True):
            if way is None:
                continue
            if way.bent:
                marks.append(path_arrow(view.pixel(way.points)))
            else:
                marks.append(trail(view.pixel(np.array([way.points[-1], way.end]))))
                marks.append(straight_arrow(view.pixel(way.points), own))
            if way.turn is not None:
                sense = 1.0 if way.turn.turns > 0.0 else -1.0
                marks.append(turn_arrow(way.back, way.turn.direction, way.radius, sense, view))
        return tuple(marks)


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The way of what comes, as it is drawn."""

    points: Float[np.ndarray, "point 3"]
    """From where it is drawn to its mouth."""
    turn: Leg | None
    """The turn with which it ends, if it does."""
    bent: bool
    """Whether there is more than one leg."""
    back: Float[np.ndarray, "3"]
    """Behind what comes, on its axis."""
    radius: float
    """Of what comes, about its axis [m]."""
    end: Float[np.ndarray, "3"]
    """Where its front ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Back:
    """What comes, drawn back along its way."""

    solids: tuple[Solid, ...]
    ways: tuple[Way | None, ...]
    """Of each step."""
    owner: tuple[int, ...]
    """Of each solid: the place of its step."""

    @property
    def sampled(self) -> list[Float[np.ndarray, "point 3"]]:
        """Points along each way."""
        return [_sampled(way.points) for way in self.ways if way is not None]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shot:
    """A picture before it is drawn."""

    back: _Back
    view: View
    whole: View | None
    own: Bool[np.ndarray, "step row column"]
    """Where each step's parts are seen."""

    @property
    def arrows_fit(self) -> bool:
        """Whether each straight way has room for its arrow between what comes and the mouth."""
        return all(
            has_room(self.view.pixel(way.points), own)
            for way, own in zip(self.back.ways, self.own, strict=True)
            if way is not None and not way.bent
        )


def _turn(legs: Sequence[Leg]) -> Leg | None:
    """The turn that ends a way, of at least ten degrees; None if there is none."""
    last = simple_legs(legs)[-1]
    return last if abs(last.turns) >= 10.0 / 360.0 else None


def _rise(
    points: Float[np.ndarray, "n 3"], fixed: Sequence[Solid], direction: Float[np.ndarray, "3"], size: float
) -> float:
    """Return how far back a part is when its front comes to what stands about its way [m]; 0 if nothing does."""
    if not fixed:
        return 0.0
    flat = np.linalg.svd(direction[None])[2][1:]
    place = points @ flat.T
    low, high = place.min(axis=0), place.max(axis=0)
    reach = 0.08 * size
    front = float((points @ direction).max())
    tops = [0.0]
    for solid in fixed:
        corners = solid.points[solid.faces].reshape(-1, 3, 3)
        at = corners @ flat.T
        near = ((at.max(axis=1) >= low - reach) & (at.min(axis=1) <= high + reach)).all(axis=1)
        if near.any():
            # of a large triangle only what is near counts: its nearest corner along the way is a bound
            tops.append(front - float((corners[near] @ direction).min()))
    return max(tops)


def _radius(
    points: Float[np.ndarray, "n 3"], on_axis: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
) -> float:
    arms = points - on_axis
    return float(np.linalg.norm(arms - np.outer(arms @ direction, direction), axis=1).max())


def _sampled(points: Float[np.ndarray, "n 3"], count: int = 12) -> Float[np.ndarray, "m 3"]:
    """Points evenly along a line through points."""
    share = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, float(share.max()), count)
    return np.stack([np.interp(at, share, points[:, axis]) for axis in range(3)], axis=1)


def _glassy(solid: Solid) -> Solid:
    return Solid(points=solid.points, faces=solid.faces, color=solid.color, glass=True)


def _busy(
    pixels: np.ndarray, subject: Sequence[Bool[np.ndarray, "row column"]], cell: int = 8
) -> Float[np.ndarray, "cellrow cellcolumn"]:
    """How much is drawn in each cell; what the picture is about counts for more."""
    drawn = (pixels.min(axis=2) < 250).astype(np.float64) + 1.5 * np.sum(subject, axis=0)
    rows, columns = (n // cell for n in drawn.shape)
    return drawn[: rows * cell, : columns * cell].reshape(rows, cell, columns, cell).mean(axis=(1, 3))


def _free_corner(busy: np.ndarray, size: tuple[int, int], config: PictureConfig) -> tuple[int, int]:
    """Left and top of the corner in which least is drawn."""
    columns, rows = -(-size[0] // 8), -(-size[1] // 8)
    corners = {
        (config.width - size[0], 0): busy[:rows, -columns:],
        (config.width - size[0], config.height - size[1]): busy[-rows:, -columns:],
        (0, config.height - size[1]): busy[-rows:, :columns],
        (0, 0): busy[:rows, :columns],
    }
    return min(corners, key=lambda corner: float(corners[corner].sum()))


def _inside(seen: Layer, part: int) -> tuple[float, float, float] | None:
    """Column, row and depth inside of the point of a part that is farthest from the rim of what is seen of it."""
    own = seen.part == part
    if not own.any():
        return None
    rows, columns = np.nonzero(own)
    top, left = int(rows.min()), int(columns.min())
    crop = np.pad(own[top : rows.max() + 1, left : columns.max() + 1], 1)
    deep = np.asarray(ndimage.distance_transform_edt(crop))
    row, column = np.unravel_index(int(np.argmax(deep)), deep.shape)
    return left + float(column) - 0.5, top + float(row) - 0.5, float(deep[row, column])


def _balloons(anchors: Mapping[int, tuple[float, float]], columns: tuple[float, float], height: int) -> list[Mark]:
    """Numbers in circles in two columns beside what is drawn, each with a line to its part."""
    sides: dict[bool, list[int]] = {False: [], True: []}
    order = sorted(anchors, key=lambda number: anchors[number][0])
    for k, number in enumerate(order):
        sides[k >= len(order) / 2].append(number)
    marks = []
    for right, numbers in sides.items():
        numbers.sort(key=lambda number: anchors[number][1])
        rows = _spread([anchors[number][1] for number in numbers], height)
        for number, row in zip(numbers, rows, strict=True):
            marks.append(Mark(kind="balloon", points=((columns[right], row), anchors[number]), text=str(number)))
    return marks


def _spread(wanted: Sequence[float], height: int) -> list[float]:
    """Return rows in order, as near to the wanted ones as a least distance lets them."""
    if not wanted:
        return []
    apart = min(54.0, (height - 60.0) / max(1, len(wanted)))
    rows = list(wanted)
    for _ in range(200):
        moved = False
        for k in range(len(rows) - 1):
            short = apart - (rows[k + 1] - rows[k])
            if short > 0.01:
                rows[k] -= 0.5 * short
                rows[k + 1] += 0.5 * short
                moved = True
        rows = [
            min(max(row, 30.0 + apart * k * 0.999), height - 30.0 - apart * 0.999 * (len(rows) - 1 - k))
            for k, row in enumerate(rows)
        ]
        if not moved:
            break
    return rows

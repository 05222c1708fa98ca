"""The fasteners of an assembly: what they are by shape and by where they sit, what they clamp, what they go into.

A name is a hint: it breaks a tie between two readings of one shape, and decides nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.fasteners.placement import Around, PlacementConfig, Solids, parts_around, touches_ring
from sashimono.fasteners.shape import Drive, Shape, ShapeConfig, recognise_shape
from sashimono.fasteners.sizes import nominal_width

Kind = Literal["screw", "bolt", "nut", "washer", "pin", "standoff", "circlip"]
"""A bolt has a hexagon head or a nut; a screw has neither. A bolt without a head is a stud."""


@dataclass(frozen=True, kw_only=True)
class FastenerConfig:
    """How fasteners are told from what looks like them."""

    shape: ShapeConfig = field(default_factory=ShapeConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    coaxial: float = 0.2
    """Largest distance between the axes of a screw and its nut or washer, over the radius."""
    parallel: float = 0.998
    """Least cosine between them."""
    nut_hole: tuple[float, float] = (0.72, 1.06)
    """Diameter of a nut's hole over that of the shank in it, least and most."""
    washer_hole: tuple[float, float] = (0.97, 1.45)
    """The same of a washer."""
    stud_length: float = 3.0
    """Shortest stud, over its diameter."""
    pin_length: tuple[float, float] = (1.2, 8.0)
    """Length of a pin over its diameter, least and most."""
    pin_held: float = 0.65
    """Share of a pin's length that is all in holes."""
    held: float = 0.5
    """Share of a slotted or crossed round bar's length that is in holes, if it is a set screw."""
    touching: float = 0.08
    """Largest gap between a head, nut or washer and what it rests on, over the diameter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fastener:
    """A part that fastens others. Lengths in m, world frame, assembled."""

    part: str
    kind: Kind
    axis: Float[np.ndarray, "3"]
    """Unit direction in which it goes in: from its head or drive to its tip. Of a nut, towards its bolt's head."""
    point: Float[np.ndarray, "3"]
    """On the axis: where its head rests; of what has no head, its drive end or its middle."""
    diameter: float
    """Of the shank or the hole."""
    outer: float
    """Of the head, nut or washer; across the flats of a hexagon."""
    low: float
    """Where shank or ring begins along the axis from the point."""
    high: float
    """Where it ends."""
    head_length: float
    size: str
    """Nominal size, as "M6"; "" if it is near none."""
    drive: Drive
    """What turns it."""
    drive_size: float
    """Width across the flats, or of the recess; 0 if none."""
    thread_pitch: float | None
    """Shift per turn of a thread that the surface has; None: no thread found."""
    confidence: float
    """From 0 to 1: 0.95 by shape and place, 0.8 by shape alone, 0.6 where only the place decided."""
    reason: str
    """Why it counts as this, in words."""
    clamps: tuple[str, ...] = ()
    """Parts that it holds down: between its head and what it goes into, from the head on."""
    into: tuple[str, ...] = ()
    """Parts that it is screwed or pushed into; of a circlip, what it sits on."""
    nuts: tuple[str, ...] = ()
    """Nuts on its shank."""
    washers: tuple[tuple[str, bool], ...] = ()
    """Washers on its shank, and whether each is on the nut's side."""

    @property
    def tool(self) -> str:
        """What turns it, in words: "hex key 4 mm", "wrench 10 mm", "screwdriver (cross)"; "none"."""
        if self.drive == "none":
            return "none"
        if self.drive in ("hex socket", "hex"):
            name = "hex key" if self.drive == "hex socket" else "wrench"
            return f"{name} {nominal_width(self.drive_size, key=self.drive == 'hex socket'):g} mm"
        return f"screwdriver ({self.drive})"

    @property
    def way_in(self) -> str:
        """How it goes in, in words: "turned", or "pushed: no thread found"."""
        if self.thread_pitch is not None:
            return f"thread found, pitch {1e3 * self.thread_pitch:.3g} mm"
        return "pushed: no thread found"


def find_fasteners(assembly: Assembly, *, config: FastenerConfig | None = None) -> tuple[Fastener, ...]:
    """Return the screws, bolts, nuts, washers, pins, standoffs and circlips of an assembly, in part order.

    Parts whose surface bounds no solid are never among them.
    """
    config = config or FastenerConfig()
    return _Finder(assembly, config).run()


_HINTS = {
    "pin": r"dowel|(?<![a-z])pins?(?![a-z])|peg",
    "washer": r"washer|shim",
    "shaft": r"shaft|axle|axis|rod|peg|spindle",
}


def _hinted(name: str, word: str) -> bool:
    return re.search(_HINTS[word], name.lower()) is not None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seat:
    """A shank with what is around it."""

    part: int
    shape: Shape
    around: tuple[Around, ...]


class _Finder:
    def __init__(self, assembly: Assembly, config: FastenerConfig) -> None:
        self.assembly, self.config = assembly, config
        self.solids = Solids(assembly)
        self.shapes = self._shapes(assembly.parts)

    def run(self) -> tuple[Fastener, ...]:
        shanks = [self._seat(k) for k, s in self.shapes.items() if s.form in ("headed", "headless")]
        nuts = {k for k, s in self.shapes.items() if s.form == "nut" and s.certain}
        nuts |= self._plain_nuts(shanks)
        washers = {k for k, s in self.shapes.items() if s.form == "washer"}
        found: dict[int, Fastener] = {}
        for seat in shanks:
            fastener = self._screw(seat, nuts, washers) or self._pin(seat)
            if fastener is not None:
                found[seat.part] = fastener
        for k in sorted(nuts):
            found[k] = self._nut(k, found)
        for k in sorted(washers):
            fastener = self._washer(k, found)
            if fastener is not None:
                found[k] = fastener
        for k, shape in self.shapes.items():
            if shape.form == "standoff":
                found[k] = self._made(k, "standoff", 0.8, "a bar with threaded or plain holes in its ends")
            elif shape.form == "circlip":
                fastener = self._circlip(k)
                if fastener is not None:
                    found[k] = fastener
        real = {self.assembly.parts[k].name for k in found}
        return tuple(
            replace(found[k], washers=tuple(entry for entry in found[k].washers if entry[0] in real))
            for k in sorted(found)
        )

    def _shapes(self, parts: Sequence[Part]) -> dict[int, Shape]:
        out: dict[int, Shape] = {}
        for k, part in enumerate(parts):
            shape = recognise_shape(part.vertices_world, part.faces, config=self.config.shape)
            if shape is not None:
                out[k] = shape
        return out

    def _name(self, k: int) -> str:
        return self.assembly.parts[k].name

    def _names(self, parts: Sequence[int]) -> tuple[str, ...]:
        return tuple(self._name(k) for k in parts)

    def _seat(self, k: int) -> _Seat:
        s = self.shapes[k]
        around = parts_around(
            self.solids, k, s.axis, s.point, s.low, s.high, 0.5 * s.diameter, config=self.config.placement
        )
        return _Seat(part=k, shape=s, around=tuple(around))

    def _offset(self, shank: Shape, ring: Shape) -> float | None:
        """Where a ring's middle is along a shank's axis; None if it is not on it."""
        if abs(shank.axis @ ring.axis) < self.config.parallel:
            return None
        arm = ring.point - shank.point
        along = float(arm @ shank.axis)
        if np.linalg.norm(arm - along * shank.axis) > self.config.coaxial * 0.5 * shank.diameter:
            return None
        margin = 0.5 * ring.length
        return along if shank.low - margin <= along <= shank.high + margin else None

    def _plain_nuts(self, shanks: Sequence[_Seat]) -> set[int]:
        """Plates with a hole at the end of a shank that fills it: on its tip, or on both ends of a bar."""
        out: set[int] = set()
        for seat in shanks:
            s = seat.shape
            tip, other_end = set[int](), set[int]()
            for k, plate in self.shapes.items():
                if plate.form not in ("plate", "nut"):
                    continue
                along = self._offset(s, plate)
                if along is None or not 0.95 * s.diameter <= plate.diameter <= 1.02 * s.diameter:
                    continue
                if s.high - along <= 3.0 * s.diameter:
                    tip.add(k)
                elif along - s.low <= 3.0 * s.diameter:
                    other_end.add(k)
            if s.form == "headed":
                out |= tip
            elif s.helix is not None or (tip and other_end):
                out |= tip | other_end
        return out

    def _on(self, shank: Shape, rings: set[int], hole: tuple[float, float]) -> list[tuple[float, int]]:
        """The rings on a shank whose holes fit, by where they are along it."""
        out = []
        for k in rings:
            along = self._offset(shank, self.shapes[k])
            if along is not None and hole[0] * shank.diameter <= self.shapes[k].diameter <= hole[1] * shank.diameter:
                out.append((along, k))
        return sorted(out)

    def _screw(self, seat: _Seat, nuts: set[int], washers: set[int]) -> Fastener | None:
        s, config = seat.shape, self.config
        own_nuts = self._on(s, nuts, config.nut_hole)
        own_washers = self._on(s, washers, config.washer_hole)
        rings = {k for _, k in (*own_nuts, *own_washers)}
        others = [a for a in seat.around if a.part not in rings]
        clamps, into = self._split(s, others, own_nuts)
        if s.form == "headless":
            stud = len(own_nuts) > 0 and s.length >= config.stud_length * s.diameter
            driven = s.certain or (s.drive != "none" and sum(a.share for a in others) >= config.held)
            if not driven and not stud:
                return None
            kind: Kind = "bolt" if stud else "screw"
            reason = f"a round bar with {s.drive}" if driven else "a round bar with nuts on it"
        else:
            held = bool(own_nuts) or self._clamps(seat, others)
            if not s.certain and not held:
                return None
            kind = "bolt" if own_nuts or s.drive == "hex" else "screw"
            how = f"with {s.drive}" if s.drive != "none" else "without a drive"
            reason = f"a head {how} on a round shank" + ("" if own_nuts or others else ", by shape alone")
        nut_at = own_nuts[0][0] if own_nuts else np.inf
        far = [(self._name(k), bool(self._is_nut_side(along, s, others, nut_at))) for along, k in own_washers]
        placed = bool(own_nuts or others)
        confidence = (0.95 if placed else 0.8) if s.certain else 0.6
        return self._made(
            seat.part, kind, confidence, reason, clamps=self._names(clamps), into=self._names(into),
            nuts=self._names([k for _, k in own_nuts]), washers=tuple(far),
        )  # fmt: skip

    def _is_nut_side(self, along: float, s: Shape, others: Sequence[Around], nut_at: float) -> bool:
        if not np.isfinite(nut_at):
            return False
        return all(a.middle < along for a in others) if others else along > 0.5 * (s.low + nut_at)

    def _split(
        self, s: Shape, others: Sequence[Around], own_nuts: Sequence[tuple[float, int]]
    ) -> tuple[list[int], list[int]]:
        """The parts that a screw clamps, and those that it goes into, from the head on."""
        if own_nuts:
            last = own_nuts[-1][0]
            return [a.part for a in others if a.middle < last], []
        if s.form == "headless":
            return [], [a.part for a in others]
        if len(others) < 2:
            return [], [a.part for a in others]
        deepest = max(others, key=lambda a: (a.high, a.low))
        return [a.part for a in others if a is not deepest], [deepest.part]

    def _clamps(self, seat: _Seat, others: Sequence[Around]) -> bool:
        """Whether what has a head but no drive clamps: a wide hole under its head, a tight one around its tip.

        A shaft with a collar is as tight in its wheel as in its bearing, or stands out.
        """
        s, placement = seat.shape, self.config.placement
        if len(others) < 2 or _hinted(self._name(seat.part), "shaft"):
            return False
        deepest = max(others, key=lambda a: (a.high, a.low))
        wide = all(a.fit > placement.tight for a in others if a is not deepest)
        stands_out = s.high - deepest.high > 0.5 * s.diameter
        return (
            wide and deepest.fit <= placement.tight and not stands_out and self._rests(seat, [a.part for a in others])
        )

    def _rests(self, seat: _Seat, others: Sequence[int]) -> bool:
        """Whether a head rests on one of the parts around its shank."""
        s = seat.shape
        below = self.config.touching * s.diameter
        head = 0.5 * s.outer
        return any(touches_ring(self.solids, k, s.axis, s.point, s.low + below, 0.5 * s.diameter, head) for k in others)

    def _pin(self, seat: _Seat) -> Fastener | None:
        s, config = seat.shape, self.config
        if s.form != "headless" or s.helix is not None or s.certain:
            return None
        ratio = s.length / s.diameter
        least, most = config.pin_length
        if not least <= ratio <= most or not seat.around:
            return None
        # of two readings, a dowel or a short shaft, the name may choose one
        hint = _hinted(self._name(seat.part), "pin")
        if _hinted(self._name(seat.part), "shaft") and not hint:
            return None
        held = [a for a in seat.around if a.fit <= 1.1]
        share = _covered(held, s.low, s.high)
        if share < config.pin_held * (0.8 if hint else 1.0):
            return None
        return self._made(
            seat.part, "pin", 0.8 if hint else 0.6, f"a plain round bar, {100.0 * share:.0f} % of it in holes",
            into=self._names([a.part for a in held]),
        )  # fmt: skip

    def _nut(self, k: int, found: dict[int, Fastener]) -> Fastener:
        shape, name = self.shapes[k], self._name(k)
        bolts = [f for f in found.values() if name in f.nuts]
        plate = shape.form == "plate" or not shape.certain
        reason = "a plate on the end of a shank that fills its hole" if plate else "a ring with flats or a thread"
        if not bolts:
            return self._made(k, "nut", 0.8, reason + ", by shape alone")
        bolt = bolts[0]
        toward_head = -bolt.axis if (shape.point - bolt.point) @ bolt.axis > 0.5 * (bolt.low + bolt.high) else bolt.axis
        made = self._made(k, "nut", 0.6 if plate else 0.95, reason, clamps=bolt.clamps, into=(bolt.part,))
        sign = 1.0 if made.axis @ toward_head > 0.0 else -1.0
        return replace(made, axis=toward_head, low=min(sign * made.low, sign * made.high), size=made.size or bolt.size)

    def _washer(self, k: int, found: dict[int, Fastener]) -> Fastener | None:
        shape, name = self.shapes[k], self._name(k)
        screws = [f for f in found.values() if any(name == washer for washer, _ in f.washers)]
        if screws:
            touching = [f for f in screws if self._next_to(k, f, found)]
            if touching or shape.certain or _hinted(name, "washer"):
                return self._made(
                    k, "washer", 0.95 if touching else 0.8, "a flat ring on a shank", into=(screws[0].part,)
                )
            return None
        if shape.certain:
            return self._made(k, "washer", 0.7, "a flat ring with the measures of a standard washer")
        return None

    def _next_to(self, k: int, screw: Fastener, found: dict[int, Fastener]) -> bool:
        """Whether a ring lies against a screw's head or one of its nuts."""
        ring = self.shapes[k]
        along = float((ring.point - screw.point) @ screw.axis)
        gap = self.config.touching * screw.diameter
        if screw.head_length > 0.0 and abs(along - 0.5 * ring.length - screw.low) <= gap:
            return True
        for nut in screw.nuts:
            other = self.shapes[self.assembly.index(nut)]
            apart = abs(float((other.point - ring.point) @ screw.axis)) - 0.5 * (other.length + ring.length)
            if abs(apart) <= gap:
                return True
        return False

    def _circlip(self, k: int) -> Fastener | None:
        """A clip on a shaft, or in a bore: what fills its middle or is all around it."""
        s = self.shapes[k]
        around = parts_around(
            self.solids, k, s.axis, s.point, s.low, s.high, 0.5 * s.outer, config=self.config.placement
        )
        seats = [a.part for a in around if a.fit == 0.0 or a.fit >= 0.85]
        if not seats:
            return None
        beside = []
        for other in self.solids.near(k, 0.5 * s.length):
            if other in seats:
                continue
            reach = 0.6 * s.length
            if any(
                touches_ring(self.solids, other, s.axis, s.point, h, 0.5 * s.diameter, 0.5 * s.outer)
                for h in (s.low - 0.1 * reach, s.high + 0.1 * reach)
            ):
                beside.append(other)
        return self._made(
            k, "circlip", 0.9, "a flat ring with a gap, on a shaft or in a bore",
            clamps=self._names(beside), into=self._names(seats),
        )  # fmt: skip

    def _made(
        self,
        k: int,
        kind: Kind,
        confidence: float,
        reason: str,
        *,
        clamps: tuple[str, ...] = (),
        into: tuple[str, ...] = (),
        nuts: tuple[str, ...] = (),
        washers: tuple[tuple[str, bool], ...] = (),
    ) -> Fastener:
        s = self.shapes[k]
        return Fastener(
            part=self._name(k),
            kind=kind,
            axis=s.axis,
            point=s.point,
            diameter=s.diameter,
            outer=s.outer,
            low=s.low,
            high=s.high,
            head_length=s.head_length,
            size=s.size,
            drive=s.drive,
            drive_size=s.drive_size,
            thread_pitch=None if s.helix is None else abs(2.0 * np.pi * s.helix.pitch),
            confidence=confidence,
            reason=reason,
            clamps=clamps,
            into=into,
            nuts=nuts,
            washers=washers,
        )


def _covered(around: Sequence[Around], low: float, high: float) -> float:
    """The share of a stretch that some part is around."""
    grid = np.linspace(low, high, 101)
    inside = np.zeros(len(grid), bool)
    for a in around:
        inside |= (grid >= a.low) & (grid <= a.high)
    return float(inside.mean())

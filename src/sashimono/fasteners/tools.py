"""The tool that drives a fastener: the space that it takes from the start of the turning until the fastener is seated.

Sizes are those of ordinary hand tools, rounded up (hex keys ISO 2936, open-ended wrenches ISO 3318, sockets ISO 2725).
A straight tool stands on the fastener's axis and is its own turning space. A key or wrench that is turned from the side
needs a sector in which it is swung to and fro.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from manifold3d import CrossSection, Manifold

from sashimono.assembly import Assembly, few_words
from sashimono.fasteners.recognise import Fastener
from sashimono.geometry.features.directions import frame_along
from sashimono.geometry.mesh.solid import to_manifold
from sashimono.plan import Tool, ToolSpace


@dataclass(frozen=True, kw_only=True)
class ToolConfig:
    """Sizes of tools; widths are those across the flats of key or hexagon."""

    shaft: float = 1.2
    """Diameter of a key's or driver's shaft, over the width."""
    shaft_length: tuple[float, float] = (0.04, 10.0)
    """Length of a shaft before its handle: at least, in metres, and so many widths more."""
    handle: tuple[float, float] = (0.015, 2.5)
    """Diameter of the handle behind the shaft, likewise."""
    handle_length: float = 0.06
    """Length of the handle [m]."""
    socket: float = 1.5
    """Diameter of a socket over a hexagon, over the width."""
    short_arm: tuple[float, float] = (0.008, 4.2)
    """Length of the arm of an angled key that goes into the screw, like `shaft_length`."""
    long_arm: tuple[float, float] = (0.04, 8.0)
    """Length of the other arm."""
    jaw: float = 2.2
    """Diameter of the jaw of an open-ended wrench, over the width."""
    wrench: tuple[float, float] = (0.04, 10.0)
    """Length of such a wrench, like `shaft_length`."""
    swing: float = 60.0
    """Angle through which a key or wrench is swung before it is set on anew [degree]: that of a hexagon."""
    step: float = 30.0
    """Angle between the sectors that are tried [degree]."""
    touching: float = 1e-3
    """Largest share of its own area, or volume, by which a tool may run into a part: rounding."""


@dataclass(frozen=True, kw_only=True)
class ToolWay:
    """One way to drive a fastener: the space taken, and what is in it."""

    space: tuple[ToolSpace, ...]
    blockers: frozenset[str]
    """Parts that reach into it, wherever they are in the order."""


def tool_ways(assembly: Assembly, fastener: Fastener, *, config: ToolConfig | None = None) -> tuple[ToolWay, ...]:
    """Return the ways to drive a fastener, the straight tool first; none for what has no drive.

    Args:
        assembly: All parts in place.
        fastener: What `find_fasteners` found there.
        config: Sizes of tools.
    """
    config = config or ToolConfig()
    if fastener.drive == "none" or fastener.kind not in ("screw", "bolt", "nut"):
        return ()
    own = {fastener.part, *fastener.nuts, *(fastener.into if fastener.kind == "nut" else ())}
    scene = _Scene(assembly, fastener, own)
    straight = _straight(fastener, config)
    ways = [ToolWay(space=straight, blockers=scene.in_cylinders(straight, config))]
    if not ways[0].blockers or fastener.drive not in ("hex", "hex socket"):
        return tuple(ways)
    return (*ways, *_swung(fastener, scene, config))


def _straight(f: Fastener, config: ToolConfig) -> tuple[ToolSpace, ...]:
    """Shaft and handle of a driver, or a socket and its extension, along the axis away from the seat."""
    width = f.drive_size if f.drive_size > 0.0 else 0.4 * f.outer
    travel = f.high - f.low
    length = config.shaft_length[0] + config.shaft_length[1] * width
    if f.drive == "hex":
        # a socket comes down around the hexagon
        thickness = travel if f.kind == "nut" else f.head_length
        foot = (-f.high if f.kind == "nut" else 0.0) + 0.1 * thickness
        return (ToolSpace(low=foot, high=foot + thickness + length + travel, radius=config.socket * width / 2.0),)
    top = f.head_length
    behind = top + length
    grip = config.handle[0] + config.handle[1] * width
    return (
        ToolSpace(low=top, high=behind, radius=config.shaft * width / 2.0),
        ToolSpace(low=behind, high=behind + config.handle_length + travel, radius=grip / 2.0),
    )


def _swung(f: Fastener, scene: _Scene, config: ToolConfig) -> list[ToolWay]:
    """An angled key, or an open-ended wrench, for each sector that is tried."""
    width, travel = f.drive_size, f.high - f.low
    if f.drive == "hex socket":
        arm = config.short_arm[0] + config.short_arm[1] * width
        lift = f.head_length + arm
        axial = (ToolSpace(low=f.head_length, high=lift + travel, radius=config.shaft * width / 2.0),)
        low, high, reach = lift - width, lift + travel, config.long_arm[0] + config.long_arm[1] * width
    else:
        foot = -f.high if f.kind == "nut" else 0.0
        thickness = (f.high - f.low) if f.kind == "nut" else f.head_length
        low, high = foot + 0.2 * thickness, foot + 0.8 * thickness + travel
        axial = (ToolSpace(low=low, high=high, radius=config.jaw * width / 2.0),)
        reach = config.wrench[0] + config.wrench[1] * width
    on_axis = scene.in_cylinders(axial, config)
    frame = frame_along(-f.axis)
    disc = ToolSpace(low=low, high=high, radius=reach)
    shadows = scene.shadows(disc)
    ways = []
    for k in range(round(360.0 / config.step)):
        middle = np.radians(k * config.step)
        toward = np.cos(middle) * frame[0] + np.sin(middle) * frame[1]
        sector = _sector(reach, middle, np.radians(config.swing))
        inside = {
            name for name, shadow in shadows.items() if (shadow ^ sector).area() > config.touching * sector.area()
        }
        space = ToolSpace(
            low=low,
            high=high,
            radius=reach,
            toward=(float(toward[0]), float(toward[1]), float(toward[2])),
            angle=float(np.radians(config.swing)),
        )
        ways.append(ToolWay(space=(*axial, space), blockers=on_axis | inside))
    return ways


def _sector(radius: float, middle: float, angle: float) -> CrossSection:
    turns = middle + np.linspace(-0.5, 0.5, 13) * angle
    return CrossSection([np.concatenate([[[0.0, 0.0]], radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)])])


class _Scene:
    """The other parts, in the frame of a fastener: z away from its seat, its axis at the origin."""

    def __init__(self, assembly: Assembly, fastener: Fastener, own: set[str]) -> None:
        self._parts = [part for part in assembly.parts if part.name not in own]
        self._frame = frame_along(-fastener.axis)
        self._point = fastener.point

    def in_cylinders(self, spaces: Sequence[ToolSpace], config: ToolConfig) -> frozenset[str]:
        """Names of the parts that reach into any of these spaces."""
        found = set()
        for space in spaces:
            tool = _cylinder(space, 0.98 * space.radius)
            for name, solid in self._near(space):
                if (solid ^ tool).volume() > config.touching * tool.volume():
                    found.add(name)
        return frozenset(found)

    def shadows(self, space: ToolSpace) -> dict[str, CrossSection]:
        """What each part has within a cylinder, seen along the axis."""
        tool = _cylinder(space, space.radius)
        inside = ((name, solid ^ tool) for name, solid in self._near(space))
        return {name: cut.project() for name, cut in inside if cut.volume() > 0.0}

    def _near(self, space: ToolSpace) -> list[tuple[str, Manifold]]:
        near = []
        for part in self._parts:
            points = (part.vertices_world - self._point) @ self._frame.T
            low, high = points.min(axis=0), points.max(axis=0)
            outside = (low[:2] > space.radius).any() or (high[:2] < -space.radius).any()
            if outside or low[2] > space.high or high[2] < space.low:
                continue
            near.append((part.name, to_manifold(points, part.faces)))
        return near


def _cylinder(space: ToolSpace, radius: float) -> Manifold:
    return Manifold.cylinder(space.high - space.low, radius, circular_segments=32).translate((0.0, 0.0, space.low))


def tool_for(fastener: Fastener, ways: Sequence[ToolWay], placed: Collection[str]) -> Tool | None:
    """Return the tool that drives a fastener, and whether it has access with these parts in place; None for no drive.

    Args:
        fastener: What is driven.
        ways: What `tool_ways` found.
        placed: Names of the parts that are there.
    """
    if not ways:
        return None
    chosen = min(ways, key=lambda way: len(way.blockers & set(placed)))
    there = sorted(chosen.blockers & set(placed))
    kind: Literal["hex key", "wrench", "screwdriver"] = "screwdriver"
    if fastener.drive in ("hex", "hex socket"):
        kind = "wrench" if fastener.drive == "hex" else "hex key"
    size = fastener.drive_size if fastener.drive_size > 0.0 else None
    reason = f"no room for it: {few_words(there)} in the way" if there else None
    return Tool(name=fastener.tool, kind=kind, size=size, access=not there, reason=reason, space=chosen.space)

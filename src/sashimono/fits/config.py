"""What counts as elastic, and how much of it is taken."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """Which fits are declared where a plan is otherwise incomplete."""

    enabled: bool = True
    """Whether any are."""
    max_parts: int = 24
    """Of more parts that hold one another, none is looked at."""
    lines: int = 12
    """Lines along which a part is tried to be drawn out, both ways: the axes, its own, those of the others."""
    max_traced: int = 2_500_000
    """Points that are followed past another part, for each set of parts: a few seconds."""
    max_ways: int = 6
    """Ways out of which it is asked what gives, for each part that leaves: those with the least need."""
    accuracy: float = 0.05
    """To which the depth that is needed is found, relative to it."""
    margin: float = 1.12
    """Declared depth over the one that is needed: between probes it may be greater."""
    planned: float = 0.95
    """Share of the declared depth that level 1 uses."""
    solid: float = 0.135
    """Most that a part with an arm gives, over the smaller part's smallest extent."""
    strain: float = 0.04
    """Most that the surface of what bends is strained. Plastics of snap hooks bear 2 to 8 %, spring steel 1 to 2 %."""
    stretch: float = 0.12
    """Most that a spring or an O-ring is stretched, radius over radius."""
    across: float = 0.5
    """A ring, a spring or an O-ring gives across its axis: pushes that have more than this along it are another's."""
    ring_thickness: float = 0.45
    """Thickest open ring, across over its mean radius."""
    ring_round: float = 0.12
    """Its inner or its outer radius varies by no more, tenth to ninetieth percentile over the mean radius."""
    ring_gap: tuple[float, float] = (4.0, 170.0)
    """Its gap [degrees], least and most."""
    spring_wire: float = 0.25
    """Thickest wire of a spring, its radius over that of the coil: springs are wound to 4 and more."""
    spring_step: float = 0.6
    """How well a spring's surface keeps in step with its pitch, from 0 to 1; rings and tubes keep none."""
    seal_section: float = 0.35
    """Thickest O-ring, the radius of its section over that of its middle line."""
    seal_round: float = 0.08
    """Largest deviation of its surface from a torus, over the radius of its section."""
    seal_around: float = 0.75
    """Share of the circle on which it must touch the other part."""
    sheet: float = 0.04
    """Thickest formed sheet, over its middle extent."""
    sheet_formed: float = 4.0
    """Least that its smallest extent is, over its thickness: a washer is flat."""
    sheet_even: float = 0.8
    """Least share of its surface under which it is about as thick as in the middle of all: castings are not."""
    sheet_filled: float = 0.4
    """Most of its convex hull that it fills."""
    sheet_free: float = 0.25
    """Free length of a formed sheet, over its middle extent."""
    relaxed: float = 0.6
    """Least share of the depth needed that a formed sheet overlaps as assembled: it is drawn relaxed."""
    press: float = 2.5
    """Most that a press fit goes deeper than it overlaps as assembled, over that."""
    press_radius: float = 0.04
    """The same, over its radius."""
    arm_slender: float = 3.0
    """Shortest arm, free length over thickness."""
    arm_thickens: float = 2.2
    """Where what bends is thicker than this, over where it is thinnest, it ends."""
    through: float = 2.4
    """Where both parts are no thicker than this, over how deep the other one is in there, one slips through the other:
    in the middle of a wall it is 2."""
    pressed_deep: float = 0.5
    """Places less deep than this, over the deepest, are not looked at."""
    pressed_near: float = 6.0
    """Points nearer to one another than this, over the depth, and ..."""
    pressed_alike: float = 0.7
    """... whose pushes have at least this cosine, are one place."""
    pressed_opposite: float = 0.6
    """Places nearer to the back of one than this, over the thickness there, are opposite to it: it is squeezed."""
    arm_places: int = 16
    """Most places at which the arms of one part are looked at."""

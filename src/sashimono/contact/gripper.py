"""Parallel-jaw grippers: two finger boxes and a palm box.

Gripper frame: origin midway between the finger tips, x from the first finger to the second, z along the
approach, from the palm to the part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.errors import SashimonoError
from sashimono.geometry.body import Body

_LENGTHS = (
    "max_opening",
    "finger_width",
    "finger_thickness",
    "finger_length",
    "tip_reach",
    "pad_thickness",
    "patch_radius",
    "open_margin",
    "palm_width",
    "palm_depth",
    "palm_length",
    "closing_advance",
)


class Boxes(NamedTuple):
    """Boxes aligned with the gripper frame."""

    low: Float[np.ndarray, "box 3"]
    """Lower corners [m]."""
    high: Float[np.ndarray, "box 3"]
    """Upper corners [m]."""


@dataclass(frozen=True, kw_only=True)
class Gripper:
    """A parallel-jaw gripper, all lengths in metres."""

    name: str
    max_opening: float
    """Largest distance between the pads."""
    finger_width: float
    """Extent of a finger along y, across the closing direction."""
    finger_thickness: float
    """Extent of a finger along x, the closing direction."""
    finger_length: float
    """Extent of a finger along z, from the palm to the contact."""
    tip_reach: float
    """How far a finger reaches beyond the contact."""
    pad_thickness: float
    """Soft layer on each finger, which yields to the part held: the rigid finger begins behind it."""
    patch_radius: float
    """Radius of the contact patch of the soft pad, from which its torsional friction follows."""
    open_margin: float
    """How far each finger opens to let go; less where the opening leaves less."""
    palm_width: float
    """Extent of the palm along x."""
    palm_depth: float
    """Extent of the palm along y."""
    palm_length: float
    """Extent of the palm along z."""
    closing_advance: float = 0.0
    """How much farther the tips of a linkage reach closed than at the largest opening, linear in between: added to
    ``finger_length``."""

    def reach(self, opening: float) -> float:
        """Return the way from the palm to the contact at an opening [m]."""
        return self.finger_length + self.closing_advance * (1.0 - min(1.0, max(0.0, opening / self.max_opening)))

    def scaled(self, factor: float) -> Gripper:
        """Return the same gripper with every length multiplied by the factor."""
        return replace(self, **{name: getattr(self, name) * factor for name in _LENGTHS})

    def closed(self, opening: float, *, inset: float) -> Boxes:
        """Return fingers and palm holding a part this wide; a finger begins ``inset`` behind its contact plane."""
        inner, outer = opening / 2.0 + inset, opening / 2.0 + self.finger_thickness
        return self._mirrored([(inner, outer)], self.reach(opening), reach_back=0.0)

    def release(self, opening: float, retreat: float, *, inset: float) -> Boxes:
        """Return all that fingers and palm sweep while they open and retreat by that length along -z [m].

        The sweep of a box along one of its axes is a box, so this is exact. Closing on the part after a
        straight approach sweeps the same.
        """
        half = opening / 2.0
        margin = self.margin(opening)
        outer = half + margin + self.finger_thickness
        inner = half + max(margin, inset)
        # a linkage draws the tips back as it opens, so that its length at the contact bounds the sweep
        return self._mirrored([(half + inset, outer), (inner, outer)], self.reach(opening), reach_back=retreat)

    def margin(self, opening: float) -> float:
        """Return how far each finger can open beyond this opening to let go [m]."""
        return max(0.0, min(self.open_margin, (self.max_opening - opening) / 2.0))

    def _mirrored(self, fingers: list[tuple[float, float]], length: float, *, reach_back: float) -> Boxes:
        """Finger boxes (inner x, outer x) on both sides, the last of them drawn back, and the palm, last."""
        y = self.finger_width / 2.0
        low, high = [], []
        for k, (inner, outer) in enumerate(fingers):
            back = length + (reach_back if k == len(fingers) - 1 else 0.0)
            low += [[inner, -y, -back], [-outer, -y, -back]]
            high += [[outer, y, self.tip_reach], [-inner, y, self.tip_reach]]
        widest = max(outer for _, outer in fingers)
        palm = max(self.palm_width / 2.0, widest)
        # open, the palm is nearer by the advance of the linkage at most
        near = length - (self.closing_advance if reach_back > 0.0 else 0.0)
        low.append([-palm, -self.palm_depth / 2.0, -length - self.palm_length - reach_back])
        high.append([palm, self.palm_depth / 2.0, -near])
        return Boxes(np.array(low), np.array(high))


GENERIC = Gripper(
    name="generic",
    max_opening=1.0,
    finger_width=0.15,
    finger_thickness=0.06,
    finger_length=0.8,
    tip_reach=0.02,
    pad_thickness=0.01,
    patch_radius=0.05,
    open_margin=0.05,
    palm_width=1.1,
    palm_depth=0.35,
    palm_length=0.6,
)
"""A jaw with the proportions of common ones and an opening of 1 m, to be scaled."""

PRESETS: dict[str, Gripper] = {
    gripper.name: gripper
    for gripper in (
        Gripper(
            name="robotiq-hand-e",
            max_opening=0.050,
            finger_width=0.022,
            finger_thickness=0.010,
            finger_length=0.045,
            tip_reach=0.003,
            pad_thickness=0.001,
            patch_radius=0.005,
            open_margin=0.003,
            palm_width=0.075,
            palm_depth=0.075,
            palm_length=0.099,
        ),
        Gripper(
            name="robotiq-2f85",
            max_opening=0.085,
            finger_width=0.022,
            finger_thickness=0.014,
            finger_length=0.060,
            closing_advance=0.0135,
            tip_reach=0.004,
            pad_thickness=0.0015,
            patch_radius=0.005,
            open_margin=0.004,
            palm_width=0.149,
            palm_depth=0.075,
            palm_length=0.094,
        ),
        Gripper(
            name="franka-hand",
            max_opening=0.080,
            finger_width=0.020,
            finger_thickness=0.015,
            finger_length=0.045,
            tip_reach=0.009,
            pad_thickness=0.001,
            patch_radius=0.005,
            open_margin=0.004,
            palm_width=0.204,
            palm_depth=0.063,
            palm_length=0.066,
        ),
    )
}
"""Real grippers by name: stroke and outer dimensions as their makers state them, to the millimetre, as boxes. Good for
access, not for a collision-free cell: check them against the maker's drawing first."""


@dataclass(frozen=True, kw_only=True)
class FingertipTool:
    """The paper's contacts: two balls in proportion to each part, and nothing behind them (`fingertips`)."""

    name: str = "fingertips"


FINGERTIPS = FingertipTool()

Tool = Gripper | FingertipTool | None
"""What may hold a part; None: generic jaws in proportion to each part."""


def named_gripper(name: str | Gripper, others: Sequence[str] = ()) -> Tool:
    """Return the tool with this name: ``fingertips``, a preset, or None for ``auto`` (proportionate to each part).

    A gripper is returned as it is. Raises SashimonoError for any other name, listing those known and ``others``.
    """
    if isinstance(name, Gripper):
        return name
    if name == FINGERTIPS.name:
        return FINGERTIPS
    if name == "auto":
        return None
    if name not in PRESETS:
        known = ", ".join([FINGERTIPS.name, "auto", *sorted(PRESETS), *others])
        raise SashimonoError(f"gripper {name!r} is not known. Choose one of: {known}; or name a .json file.")
    return PRESETS[name]


def gripper_from_fields(fields: Mapping[str, Any], where: str) -> Gripper:
    """Return the gripper with these fields (those of `Gripper`, lengths in metres).

    Raises SashimonoError, naming ``where`` they come from, for a field that is missing, unknown or not a length.
    """
    known = {field.name for field in dataclass_fields(Gripper)}
    optional = {"closing_advance"}
    if wrong := sorted(set(fields) - known) + sorted(known - optional - set(fields)):
        raise SashimonoError(
            f"{where}: {wrong[0]} is missing, or no field of a gripper. It has: {', '.join(sorted(known))}."
        )
    for name, value in fields.items():
        real = isinstance(value, int | float) and not isinstance(value, bool)
        if name != "name" and not (real and math.isfinite(value) and value >= 0.0):
            raise SashimonoError(f"{where}: {name} is {value!r}, not a length in metres.")
    return Gripper(**fields)


def proportionate_gripper(body: Body, *, room: float = 1.25, thin: float = 0.2) -> Gripper:
    """Return the generic jaw in proportion to one part: no real tool, named ``auto``.

    Models come normalised or as furniture, where no real gripper fits. The opening is ``room`` times the
    part's middle extent along its inertia axes, so that it can be held across its two smaller extents.
    Tip, pad and contact patch are at most ``thin`` times the smallest extent.
    """
    smallest, middle = float(body.extents[0]), float(body.extents[1])
    gripper = GENERIC.scaled(room * middle)
    limit = thin * smallest
    return replace(
        gripper,
        name="auto",
        tip_reach=min(gripper.tip_reach, limit),
        pad_thickness=min(gripper.pad_thickness, limit),
        patch_radius=min(gripper.patch_radius, limit),
    )

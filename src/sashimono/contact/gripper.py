"""Parallel-jaw grippers: two finger boxes and a palm box.

Gripper frame: origin midway between the finger tips, x from the first finger to the second, z along the
approach, from the palm to the part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

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

    def scaled(self, factor: float) -> Gripper:
        """Return the same gripper with every length multiplied by the factor."""
        return replace(self, **{name: getattr(self, name) * factor for name in _LENGTHS})

    def closed(self, opening: float, *, inset: float) -> Boxes:
        """Return fingers and palm holding a part this wide; a finger begins ``inset`` behind its contact plane."""
        inner, outer = opening / 2.0 + inset, opening / 2.0 + self.finger_thickness
        return self._mirrored([(inner, outer, self.finger_length)], reach_back=0.0)

    def release(self, opening: float, retreat: float, *, inset: float) -> Boxes:
        """Return all that fingers and palm sweep while they open and retreat by that length along -z [m].

        The sweep of a box along one of its axes is a box, so this is exact. Closing on the part after a
        straight approach sweeps the same.
        """
        half = opening / 2.0
        margin = self.margin(opening)
        outer = half + margin + self.finger_thickness
        opening_sweep = (half + inset, outer, self.finger_length)
        inner = half + max(margin, inset)
        return self._mirrored([opening_sweep, (inner, outer, self.finger_length + retreat)], reach_back=retreat)

    def margin(self, opening: float) -> float:
        """Return how far each finger can open beyond this opening to let go [m]."""
        return max(0.0, min(self.open_margin, (self.max_opening - opening) / 2.0))

    def _mirrored(self, fingers: list[tuple[float, float, float]], reach_back: float) -> Boxes:
        """Finger boxes (inner x, outer x, length) on both sides, and the palm, last."""
        y = self.finger_width / 2.0
        low, high = [], []
        for inner, outer, length in fingers:
            low += [[inner, -y, -length], [-outer, -y, -length]]
            high += [[outer, y, self.tip_reach], [-inner, y, self.tip_reach]]
        widest = max(outer for _, outer, _ in fingers)
        palm = max(self.palm_width / 2.0, widest)
        low.append([-palm, -self.palm_depth / 2.0, -self.finger_length - self.palm_length - reach_back])
        high.append([palm, self.palm_depth / 2.0, -self.finger_length])
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
            name="hand_e",
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
            name="2f_85",
            max_opening=0.085,
            finger_width=0.022,
            finger_thickness=0.014,
            finger_length=0.060,
            tip_reach=0.004,
            pad_thickness=0.0015,
            patch_radius=0.005,
            open_margin=0.004,
            palm_width=0.149,
            palm_depth=0.075,
            palm_length=0.094,
        ),
        Gripper(
            name="panda",
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
"""Grippers by name. Envelopes of real ones, rounded: good for access, not for a collision-free cell."""


def named_gripper(name: str) -> Gripper | None:
    """Return the gripper with this name, or None for ``"auto"`` (proportionate to each part).

    Raises SashimonoError for any other name, listing those known.
    """
    if name == "auto":
        return None
    if name not in PRESETS:
        known = ", ".join(["auto", *sorted(PRESETS)])
        raise SashimonoError(f"gripper {name!r} is not known. Choose one of: {known}.")
    return PRESETS[name]


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

"""A vacuum cup: where it sits flat on a part, whether it carries it in any orientation, and gets there.

Asked of steps beside grasps, to see at once where a cup will do; plans hold parts by fingers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.contact.access import Access
from sashimono.contact.config import ContactConfig
from sashimono.contact.gripper import PRESETS, Boxes, Gripper, named_gripper
from sashimono.contact.push import weight_of
from sashimono.contact.wrenches import unit_across
from sashimono.errors import SashimonoError
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Table

_RING = 16
_ALIGNED = math.cos(math.radians(2.0))


@dataclass(frozen=True, kw_only=True)
class SuctionCup:
    """A round cup on a straight stem, all lengths in metres. Frame: origin on the part, z along the approach."""

    name: str
    radius: float
    """Of the sealing rim."""
    length: float
    """From the rim to the stem's body."""
    body_radius: float
    body_length: float
    vacuum: float
    """Pressure below that of the air [Pa]."""
    friction: float = 0.5
    """Between rim and part."""
    flatness: float = 2e-4
    """How uneven the surface under the rim may be."""
    safety: float = 2.0
    """Holding force over what is needed."""

    # what `Access` asks of a tool
    pad_thickness: float = 0.002
    max_opening: float = 0.0

    @property
    def finger_length(self) -> float:
        """Length of the straight retreat's unit."""
        return self.length

    @property
    def finger_thickness(self) -> float:
        """What sets the spacing of the poses checked along the way."""
        return 2.0 * self.radius

    @property
    def palm_length(self) -> float:
        """Extent of the body along z."""
        return self.body_length

    @property
    def palm_width(self) -> float:
        """Extent of the body across z."""
        return 2.0 * self.body_radius

    def holds(self, weight: float, arm: float) -> bool:
        """Return whether the cup carries a weight [N], its centre this far from the cup's [m], however it is turned.

        The rim lets go on one side when the moment exceeds what the suction presses it on with, at the rim's radius;
        along the surface friction holds.
        """
        force = self.vacuum * math.pi * self.radius**2
        return self.safety * weight * max(1.0 + arm / self.radius, 1.0 / self.friction) <= force

    def closed(self, opening: float, *, inset: float) -> Boxes:
        """Return cup and body, sitting on the part."""
        return self.release(opening, 0.0, inset=inset)

    def release(self, opening: float, retreat: float, *, inset: float) -> Boxes:
        """Return what cup and body sweep while they retreat by that length along -z [m]."""
        r, b = self.radius, self.body_radius
        low = [[-r, -r, -self.length - retreat], [-b, -b, -self.length - self.body_length - retreat]]
        return Boxes(np.array(low), np.array([[r, r, -inset], [b, b, -self.length]]))


VACUUM_CUP = SuctionCup(
    name="vacuum-cup", radius=0.010, length=0.025, body_radius=0.015, body_length=0.060, vacuum=60e3
)
"""A 20 mm bellows cup at 60 kPa, a common one of no particular maker: about 19 N."""


def real_tool(name: str | Gripper) -> Gripper | SuctionCup:
    """Return the real tool with this name, a jaw gripper or the cup; a gripper is returned as it is.

    Raises SashimonoError for any other name, listing those known.
    """
    if name == VACUUM_CUP.name:
        return VACUUM_CUP
    if isinstance(tool := named_gripper(name, [VACUUM_CUP.name]), Gripper):
        return tool
    known = ", ".join(REAL_TOOLS)
    raise SashimonoError(f"{name} is no real tool. Choose among: {known}; or name a .json file.")


REAL_TOOLS = (*PRESETS, VACUUM_CUP.name)
"""Names of the real tools."""


def find_seats(body: Body, cup: SuctionCup) -> tuple[Float[np.ndarray, "seat 3"], Float[np.ndarray, "seat 3"]]:
    """Return points and outward unit normals of the surface samples around which the whole rim is flat on the part."""
    points, normals = body.samples, body.sample_normals
    u = unit_across(normals)
    v = np.cross(normals, u)
    flat = np.ones(len(points), dtype=np.bool_)
    for share in (1.0, 0.5):
        angles = 2.0 * np.pi * np.arange(_RING) / _RING
        around = np.cos(angles)[:, None] * u[:, None] + np.sin(angles)[:, None] * v[:, None]
        ring = points[:, None] + share * cup.radius * around
        d, n = body.signed_distance.normals(ring.reshape(-1, 3), 2.0 * cup.flatness)
        aligned = (n.reshape(ring.shape) * normals[:, None]).sum(axis=2) > _ALIGNED
        flat &= ((np.abs(d).reshape(aligned.shape) <= cup.flatness) & aligned).all(axis=1)
    return points[flat], normals[flat]


def why_no_suction(
    body: Body,
    motion: Motion,
    obstacles: Sequence[Obstacle],
    table: Table | None,
    *,
    cup: SuctionCup,
    config: ContactConfig,
    most: int,
) -> str | None:
    """Return None if the cup can take the part from its resting to its assembled pose, else why it cannot.

    Seats nearest to the centre of mass are tried first, ``most`` of them; the turn of the cup about its own axis does
    not matter.
    """
    points, normals = find_seats(body, cup)
    if len(points) == 0:
        return f"no face is flat under a cup of {2e3 * cup.radius:.3g} mm"
    weight = weight_of(body, config)
    arms = np.linalg.norm(points - body.mass_center, axis=1)
    order = np.argsort(np.round(arms / body.radius, 6), kind="stable")
    if not cup.holds(weight, float(arms[order[0]])):
        return f"too heavy: {weight:.3g} N, its centre {1e3 * arms[order[0]]:.3g} mm from the nearest seat"
    access = Access(body, motion, obstacles, table, cup, config)
    tried = [k for k in order[:most].tolist() if cup.holds(weight, float(arms[k]))]
    for k in tried:
        z = -normals[k]
        x = unit_across(z[None])[0]
        pose = se3.make(np.stack([x, np.cross(z, x), z], axis=1), points[k])
        if access.first_clear(0.0, pose[None]) is not None:
            return None
    return access.reason(len(points), len(tried))

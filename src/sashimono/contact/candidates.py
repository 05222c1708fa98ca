"""The grasps of one part, best first, before anything around it is looked at."""

from __future__ import annotations

from dataclasses import replace
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Part
from sashimono.contact.antipodal import GraspPairs, antipodal_pairs
from sashimono.contact.config import ContactConfig
from sashimono.contact.ferrari_canny import ferrari_canny, quality_bound
from sashimono.contact.gripper import Gripper
from sashimono.contact.samples import main_lines, sample_contacts, steady_pairs
from sashimono.contact.wrenches import contact_wrenches, torsional_friction
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.mesh import measures


@runtime_checkable
class Patch(Protocol):
    """What the qualities need to know of what holds the part."""

    @property
    def patch_radius(self) -> float:
        """Radius of the contact patch [m]."""
        ...


Holder = TypeVar("Holder", bound=Patch)


class GraspCandidates(Generic[Holder]):
    """Distinct antipodal grasps of one part with one gripper, in the part frame.

    Exact qualities are worked out when first asked for and kept.
    """

    def __init__(
        self,
        pairs: GraspPairs,
        *,
        gripper: Holder,
        center: Float[np.ndarray, "3"],
        radius: float,
        lines: Float[np.ndarray, "line 3"],
        config: ContactConfig,
    ) -> None:
        self.pairs = pairs
        self.gripper = gripper
        self._center, self._radius, self._lines, self._config = center, radius, lines, config
        self._wrenches = contact_wrenches(
            pairs.points,
            pairs.normals,
            tangential_friction=config.tangential_friction,
            torsion=torsional_friction(config.friction, gripper.patch_radius),
            edges=config.cone_edges,
            center=center,
            radius=radius,
            first_edges=self._across(pairs.lines),
        )
        arms = (pairs.points.mean(axis=1) - center) / radius
        self._bounds = np.round(quality_bound(self._wrenches, pairs.lines, arms), 9)
        self._exact: dict[int, float] = {}

    def __len__(self) -> int:
        return len(self.pairs)

    def moved(self, T: Float[np.ndarray, "4 4"]) -> GraspCandidates[Holder]:
        """Return the same grasps in the frame of an identical part: T takes this part's points to that part's."""
        R = T[:3, :3]
        pairs = GraspPairs(
            points=self.pairs.points @ R.T + T[:3, 3],
            normals=self.pairs.normals @ R.T,
            found=self.pairs.found,
            narrowest=self.pairs.narrowest,
        )
        other = GraspCandidates(
            pairs,
            gripper=self.gripper,
            center=R @ self._center + T[:3, 3],
            radius=self._radius,
            lines=self._lines @ R.T,
            config=self._config,
        )
        other._exact = self._exact  # a rigid motion changes no quality
        return other

    def ranked(self) -> list[tuple[int, float]]:
        """Return the grasps' numbers, each with an upper bound of its quality, in descending order of that."""
        order = np.argsort(-self._bounds, kind="stable")
        return [(int(k), float(self._bounds[k])) for k in order]

    def quality(self, k: int) -> float:
        """Return the exact Ferrari-Canny quality of a grasp, with soft fingers."""
        if k not in self._exact:
            self._exact[k] = round(ferrari_canny(self._wrenches[k]), 9)
        return self._exact[k]

    def opening(self, k: int) -> float:
        """Return the distance between the contacts of a grasp [m]."""
        return float(np.linalg.norm(self.pairs.points[k, 1] - self.pairs.points[k, 0]))

    def approaches(self, k: int) -> Float[np.ndarray, "approach 4 4"]:
        """Return gripper poses ``T_part_gripper`` around the line between the contacts, along a main line first."""
        x = self.pairs.lines[k]
        first = self._across(x[None])[0]
        angles = 2.0 * np.pi * np.arange(self._config.approaches) / self._config.approaches
        z = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * np.cross(x, first)
        T = np.tile(np.eye(4), (len(angles), 1, 1))
        T[:, :3, 0] = x
        T[:, :3, 1] = np.cross(z, x)
        T[:, :3, 2] = z
        T[:, :3, 3] = self.pairs.points[k].mean(axis=0)
        return T

    def _across(self, x: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Unit vectors across x, along the part's heaviest main line that is far from x, if there is one."""
        lines = np.concatenate([self._lines, np.eye(3)])
        line = lines[np.argmax(np.abs(x @ lines.T) < 0.61, axis=1)]  # one of the axes always is
        across = line - (line * x).sum(axis=1, keepdims=True) * x
        return across / np.linalg.norm(across, axis=1, keepdims=True)


def find_candidates(
    part: Part,
    body: Body,
    *,
    gripper: Gripper,
    config: ContactConfig,
    rng: np.random.Generator,
    off_edges: bool = False,
) -> GraspCandidates[Gripper]:
    """Return the distinct antipodal grasps of a part with a gripper, in the part frame.

    ``off_edges`` leaves out those with a contact at an edge, where the normal is a matter of rounding.
    """
    center = body.mass_center
    radius = measures.radius(part.vertices_part, center)
    lines = main_lines(part.vertices_part, part.faces, config)
    samples = sample_contacts(part.vertices_part, part.faces, body, lines, center=center, config=config, rng=rng)
    pairs = antipodal_pairs(samples, body, max_opening=gripper.max_opening, center=center, radius=radius, config=config)
    if off_edges and len(pairs):
        kept = steady_pairs(body, pairs.points, pairs.normals)
        pairs = replace(pairs, points=pairs.points[kept], normals=pairs.normals[kept])
    return GraspCandidates(pairs, gripper=gripper, center=center, radius=radius, lines=lines, config=config)


def congruence(part: Part, other: Part, tolerance: float = 1e-6) -> Float[np.ndarray, "4 4"] | None:
    """Return the rigid motion that takes the first part's mesh to the other's, vertex by vertex, or None.

    Kabsch (1976). The tolerance is a fraction of the part's size.
    """
    a, b = part.vertices_part, other.vertices_part
    if a.shape != b.shape or not np.array_equal(part.faces, other.faces):
        return None
    a_mean, b_mean = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((b - b_mean).T @ (a - a_mean))
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    T = se3.make(R, b_mean - R @ a_mean)
    return T if np.abs(se3.apply(T, a) - b).max() <= tolerance * np.ptp(a, axis=0).max() else None

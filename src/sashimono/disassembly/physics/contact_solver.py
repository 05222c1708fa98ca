"""Which way a pushed part moves: quasi-static contact with Coulomb friction, solved for one instant.

The part is overdamped: it moves along the applied wrench plus the contact impulses, in units in which mass and
turning inertia are one. Impulses lie in the friction cones and act only where the motion would close the contact
(projected Gauss-Seidel over the contacts; Jourdan, Alart & Jean, 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numba import njit


@dataclass(frozen=True, eq=False)
class Contacts:
    """Where a part touches others, as seen from its centre; lengths over its radius."""

    normals: Float[np.ndarray, "contact 3"]
    """Unit normals that point into the part, world frame."""
    arms: Float[np.ndarray, "contact 3"]
    """From the centre to the contact."""
    gaps: Float[np.ndarray, "contact"]
    """Clearance; negative where the surfaces overlap."""

    def __len__(self) -> int:
        return len(self.gaps)

    @cached_property
    def rows(self) -> Float[np.ndarray, "contact 6"]:
        """Normal velocity of each contact for a unit twist (v, ω) about the centre: ``(n, r × n)``."""
        return np.concatenate([self.normals, np.cross(self.arms, self.normals)], axis=1)


def sliding_twist(
    contacts: Contacts,
    push: Float[np.ndarray, "6"],
    *,
    friction: float,
    iterations: int,
    tolerance: float,
) -> Float[np.ndarray, "6"]:
    """Return the twist by which a part answers a push; both as (v, ω) about its centre, lengths over its radius.

    No contact closes by more than its gap; one that overlaps opens. Stops once no impulse changes by more than
    ``tolerance``, or after so many iterations.
    """
    twist = np.array(push, dtype=np.float64)
    if len(contacts):
        across = _tangents(contacts.normals)
        rows = [contacts.rows, *(np.concatenate([t, np.cross(contacts.arms, t)], axis=1) for t in across)]
        _relax(np.stack(rows, axis=1), contacts.gaps, friction, iterations, tolerance, twist)
    return twist


def _tangents(
    normals: Float[np.ndarray, "contact 3"],
) -> tuple[Float[np.ndarray, "contact 3"], Float[np.ndarray, "contact 3"]]:
    helper = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normals, first)


@njit(cache=True, nogil=True)
def _relax(rows, gaps, friction, iterations, tolerance, twist):  # pragma: no cover - compiled
    count = rows.shape[0]
    impulses = np.zeros((count, 3))
    inverse = np.empty((count, 3))
    for c in range(count):
        for k in range(3):
            inverse[c, k] = 1.0 / (rows[c, k] ** 2).sum()
    wanted = np.empty(3)
    for _ in range(iterations):
        change = 0.0
        for c in range(count):
            for k in range(3):
                speed = gaps[c] if k == 0 else 0.0
                for m in range(6):
                    speed += rows[c, k, m] * twist[m]
                wanted[k] = impulses[c, k] - speed * inverse[c, k]
                if k == 0:
                    wanted[0] = max(0.0, wanted[0])
                    delta = wanted[0] - impulses[c, 0]
                    impulses[c, 0] = wanted[0]
                    change = max(change, abs(delta))
                    for m in range(6):
                        twist[m] += delta * rows[c, 0, m]
                    if wanted[0] == 0.0 and impulses[c, 1] == 0.0 and impulses[c, 2] == 0.0:
                        break
            else:
                size = np.sqrt(wanted[1] ** 2 + wanted[2] ** 2)
                cone = friction * wanted[0]
                shrink = cone / size if size > cone else 1.0
                for k in range(1, 3):
                    delta = shrink * wanted[k] - impulses[c, k]
                    impulses[c, k] += delta
                    change = max(change, abs(delta))
                    for m in range(6):
                        twist[m] += delta * rows[c, k, m]
        if change < tolerance:
            break

"""What is not to be penetrated: a body, or a half space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float


@runtime_checkable
class Target(Protocol):
    """What is not to be penetrated."""

    def box_distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]: ...

    def distance(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "n"]: ...

    def contains(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpace:
    """Everything below the plane ``normal · x = offset``."""

    normal: Float[np.ndarray, "3"]
    offset: float

    def distance(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "n"]:
        """Return the height of each point over the plane [m]."""
        return points @ self.normal - self.offset

    def box_distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the height, 0 below."""
        return np.maximum(self.distance(points), 0.0)

    def contains(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Return which points are below."""
        return self.distance(points) < 0.0


def signed_distance(
    target: Target, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"], limit: float
) -> Float[np.ndarray, "n"]:
    """Return the signed distance of each point [m], as far as ``beyond``; what is deeper than the limit surely is.

    Where the surface meets itself, the nearest face can tell the wrong side: there the whole of it is asked.
    """
    s = target.distance(points, beyond) if len(points) else np.empty(0)
    deep = np.flatnonzero(s < -limit)
    if len(deep):
        s[deep] = np.where(target.contains(points[deep]), s[deep], -s[deep])
    return s

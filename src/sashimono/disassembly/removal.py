"""A removal: the witness motion by which a part leaves the parts around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.assembly import frozen_array
from sashimono.geometry import se3


@dataclass(frozen=True, kw_only=True, eq=False)
class Removal:
    """How one part leaves its assembled pose; reversed, how it is inserted.

    Between two waypoints the motion is a geodesic. The last leg is a straight
    translation along ``exit_direction``, and may be continued to infinity without
    hitting the parts that stay.
    """

    displacements: Float[np.ndarray, "waypoint 4 4"]
    """World-frame displacements D_k from the assembled pose: ``T_world_part = D_k @ T_assembled``; D_0 = identity."""
    exit_direction: Float[np.ndarray, "3"]
    """Unit vector of the last leg, in the world frame."""

    def __post_init__(self) -> None:
        displacements = frozen_array(self.displacements, np.float64)
        direction = np.asarray(self.exit_direction, dtype=np.float64)
        assert displacements.shape[1:] == (4, 4), "waypoints are 4x4 displacements"
        assert np.allclose(displacements[0], np.eye(4), atol=1e-12), "a removal starts in the assembled pose"
        assert abs(np.linalg.norm(direction) - 1.0) < 1e-6, "the exit direction is a unit vector"
        object.__setattr__(self, "displacements", displacements)
        object.__setattr__(self, "exit_direction", frozen_array(direction / np.linalg.norm(direction), np.float64))

    @classmethod
    def straight(cls, direction: Float[np.ndarray, "3"], length: float) -> Removal:
        """Return the removal by one translation of this length [m] along a direction (made unit)."""
        unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
        displacements = np.stack([np.eye(4), np.eye(4)])
        displacements[1, :3, 3] = length * unit
        return cls(displacements=displacements, exit_direction=unit)

    def of_the_other(self) -> Removal:
        """Return the same motion with the part in place and what it leaves moving instead: two parts come apart."""
        inverse = np.stack([se3.inverse(D) for D in self.displacements])
        inverse[0] = np.eye(4)
        return Removal(displacements=inverse, exit_direction=-(inverse[-1, :3, :3] @ self.exit_direction))

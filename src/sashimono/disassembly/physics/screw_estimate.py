"""The screw that a part follows, told from all the stretches that it has turned so far."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import between


class ScrewEstimate:
    """The screw that all turning stretches so far agree on: their mean, each weighed by its contacts.

    Stretches of one helix have one spatial twist, wherever on it they begin.
    """

    def __init__(self, turn: float) -> None:
        """Take in how far a whole stretch turns [rad]."""
        self._turn = turn
        self.twist: np.ndarray | None = None
        """The mean twist of a whole stretch; None before there is one."""
        self._sum = np.zeros(6)
        self._weight = 0.0
        self._others = False

    def follow(self, twist: Float[np.ndarray, "6"], contacts: int) -> None:
        """Take in a stretch, and the number of contacts by which its end was fitted."""
        turn = float(np.linalg.norm(twist[3:]))
        if turn < 0.02 * self._turn:
            self._others = True
        else:
            self._sum = self._sum + contacts * twist
            self._weight += contacts * turn
            self.twist = self._sum * (self._turn / self._weight) if self._weight > 0.0 else None

    def smoothed(
        self, paths: Paths, poses: list[np.ndarray], direction: Float[np.ndarray, "3"]
    ) -> tuple[list[np.ndarray], Float[np.ndarray, "3"]] | None:
        """The poses, all stretches replaced by the mean one, an exit along its axis at the end; None if it hits.

        If it can, the part follows the screw for one stretch more: out of the last turn, straight exits graze.
        """
        twist = self.twist
        if twist is None or self._others:
            return None
        axis = twist[3:] / np.linalg.norm(twist[3:])
        direction = axis if float(axis @ direction) > 0.0 else -axis
        turn = sum(float(np.linalg.norm(between(a, b)[3:])) for a, b in pairwise(poses)) / self._turn
        for whole, count in ((turn + 1.0, len(poses)), (turn, len(poses) - 1)):
            smooth = [se3.exp(twist * (k * whole / count)) @ poses[0] for k in range(count + 1)]
            end = paths.exit(smooth[-1], direction)
            if end is not None and paths.check(np.array(smooth)):
                return [*smooth, end], direction
        return None

"""Single motions checked: a part's way to its assembled pose past parts in theirs, without table or tray."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.plan import Contact, Motion
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.fingertips import tip_problems
from sashimono.verify.overlap import AssembledOverlaps
from sashimono.verify.pairs import check_pair, pair_tolerance
from sashimono.verify.sweep import Screws


class MotionCheck:
    """Checks motions of the parts of one assembly."""

    def __init__(self, assembly: Assembly, *, config: VerifyConfig | None = None) -> None:
        self._assembly = assembly
        self._config = config or VerifyConfig()
        self._bodies = {
            part.name: SampledBody(part.name, part.vertices_part, part.faces, samples=self._config.samples)
            for part in assembly.parts
        }
        self._overlaps = AssembledOverlaps(
            self._bodies, {part.name: part.T_world_part for part in assembly.parts}, self._config
        )

    def problems(self, part: int, fixed: Sequence[int], T_world_part: Float[np.ndarray, "pose 4 4"]) -> list[str]:
        """Return what is wrong with a part's way (its assembled pose last) past fixed parts; nothing if it holds."""
        parts = self._assembly.parts
        own = parts[part].name
        path, body, out = Screws.between(T_world_part), self._bodies[own], []
        for k in fixed:
            name = parts[k].name
            found = check_pair(
                body,
                self._bodies[name],
                path,
                parts[k].T_world_part,
                overlaps=self._overlaps,
                tolerance=pair_tolerance(body, self._bodies[name], self._config),
                config=self._config,
            )
            out += [found.problem] if found.problem else []
        return out

    def tip_problems(
        self, part: int, fixed: Sequence[int], T_world_part: Float[np.ndarray, "pose 4 4"], contact: Contact
    ) -> list[str]:
        """Return which of a contact's fingertips meet the part itself, or fixed parts on this way."""
        parts = self._assembly.parts
        around = {parts[k].name: (self._bodies[parts[k].name], parts[k].T_world_part) for k in fixed}
        motion = Motion(T_world_part=T_world_part, segments=())
        return tip_problems(contact, motion, self._bodies[parts[part].name], around, None, self._config)

"""The paper's ``isExec``: is there a collision-free grasp with which a robot can take this part out?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sashimono.assembly import Assembly
from sashimono.contact.candidates import GraspCandidates, find_candidates
from sashimono.contact.clearance import Obstacle
from sashimono.contact.config import ContactConfig
from sashimono.contact.grasp import choose_contact
from sashimono.contact.gripper import Gripper, proportionate_gripper
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal
from sashimono.geometry.body import Body
from sashimono.plan import Motion, Segment


class Executability:
    """Answers whether a removal can be held by a grasp, along all of it; few candidates are looked at.

    Called with (part, mask of the other remaining parts, removal). Table and parts laid down are left out: they
    are known only once all parts are out. Depends on the arguments only, not on what was asked before.
    """

    def __init__(
        self,
        assembly: Assembly,
        bodies: Mapping[str, Body],
        *,
        gripper: Gripper | None,
        config: ContactConfig,
        rng: np.random.Generator,
        max_candidates: int = 40,
    ) -> None:
        self._assembly, self._bodies, self._gripper = assembly, bodies, gripper
        self._config = replace(config, max_candidates=min(max_candidates, config.max_candidates))
        self._streams = rng.spawn(len(assembly))
        self._candidates: dict[int, GraspCandidates] = {}

    def __call__(self, part: int, others: int, removal: Removal) -> bool:
        candidates = self._of(part)
        moving = self._assembly.parts[part]
        poses = removal.displacements[::-1] @ moving.T_world_part
        last = len(poses) - 1
        obstacles = [
            Obstacle(body=self._bodies[other.name], T_world_part=other.T_world_part)
            for other in (self._assembly.parts[k] for k in bits(others))
        ]
        choice = choose_contact(
            moving,
            Motion(T_world_part=poses, segments=(Segment(kind="insertion", start=0, stop=last),)),
            obstacles,
            None,
            gripper=candidates.gripper,
            config=self._config,
            rng=self._streams[part],
            body=self._bodies[moving.name],
            candidates=candidates,
        )
        return choice.contact is not None

    def _of(self, part: int) -> GraspCandidates:
        if part not in self._candidates:
            moving = self._assembly.parts[part]
            body = self._bodies[moving.name]
            jaw = self._gripper or proportionate_gripper(body)
            rng = self._streams[part]
            self._candidates[part] = find_candidates(moving, body, gripper=jaw, config=self._config, rng=rng)
        return self._candidates[part]

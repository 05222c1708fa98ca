"""The paper's ``isExec``: is there a collision-free grasp with which a robot can take this part out?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sashimono.assembly import Assembly
from sashimono.contact.candidates import GraspCandidates, find_candidates
from sashimono.contact.config import ContactConfig
from sashimono.contact.grasp import choose_contact
from sashimono.contact.gripper import FingertipTool, Gripper, Tool, proportionate_gripper
from sashimono.contact.tip_contact import TipGrasps, choose_tip_contact, find_tip_grasps
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Segment


class Executability:
    """Answers whether a removal can be held by a grasp, along all of it; few candidates are looked at.

    Called with (part, mask of the other remaining parts, removal). Table and parts laid down are left out: they
    are known only once all parts are out. With fingertips a push counts as well; it leans on the parts around, so that
    more of them can help. Depends on the arguments only, not on what was asked before.
    """

    def __init__(
        self,
        assembly: Assembly,
        bodies: Mapping[str, Body],
        *,
        gripper: Tool,
        config: ContactConfig,
        rng: np.random.Generator,
        max_candidates: int = 40,
    ) -> None:
        self._assembly, self._bodies, self._gripper = assembly, bodies, gripper
        self._config = replace(config, max_candidates=min(max_candidates, config.max_candidates))
        self._streams = rng.spawn(len(assembly))
        self._candidates: dict[int, GraspCandidates[Gripper]] = {}
        self._tips: dict[int, TipGrasps] = {}

    def __call__(self, part: int, others: int, removal: Removal) -> bool:
        moving = self._assembly.parts[part]
        poses = removal.displacements[::-1] @ moving.T_world_part
        motion = Motion(T_world_part=poses, segments=(Segment(kind="insertion", start=0, stop=len(poses) - 1),))
        obstacles = [
            Obstacle(body=self._bodies[other.name], T_world_part=other.T_world_part)
            for other in (self._assembly.parts[k] for k in bits(others))
        ]
        body = self._bodies[moving.name]
        if isinstance(self._gripper, FingertipTool):
            grasps = self._tip_grasps(part)
            return (
                choose_tip_contact(motion, obstacles, (), None, body=body, grasps=grasps, config=self._config).contact
                is not None
            )
        candidates = self._of(part)
        choice = choose_contact(
            moving,
            motion,
            obstacles,
            None,
            gripper=candidates.gripper,
            config=self._config,
            rng=self._streams[part],
            body=body,
            candidates=candidates,
        )
        return choice.contact is not None

    def _tip_grasps(self, part: int) -> TipGrasps:
        if part not in self._tips:
            moving = self._assembly.parts[part]
            body, rng = self._bodies[moving.name], self._streams[part]
            self._tips[part] = find_tip_grasps(moving, body, config=self._config, rng=rng)
        return self._tips[part]

    def _of(self, part: int) -> GraspCandidates[Gripper]:
        if part not in self._candidates:
            moving = self._assembly.parts[part]
            body = self._bodies[moving.name]
            jaw = proportionate_gripper(body) if isinstance(self._gripper, FingertipTool | None) else self._gripper
            rng = self._streams[part]
            self._candidates[part] = find_candidates(moving, body, gripper=jaw, config=self._config, rng=rng)
        return self._candidates[part]

"""The motion of one part: lift, transit, insertion, each at its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from sashimono.geometry.body import Body, path_length
from sashimono.motion.config import MotionConfig
from sashimono.motion.insertion import Insertion
from sashimono.motion.pure_rrt import TolerantScene
from sashimono.motion.rrt_connect import pose_metric, pose_sampler, rrt_connect
from sashimono.motion.scene import EdgeCheck, Obstacle, Scene
from sashimono.motion.smoothing import smooth
from sashimono.motion.trajectory import time_path
from sashimono.motion.transit import Transit, plan_transit
from sashimono.motion.workspace import Rest
from sashimono.plan import Answer, Motion, Segment, Table, Unsolved

Pose = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """What all motions of an assembly share."""

    bodies: Mapping[str, Body]
    assembled: Mapping[str, Float[np.ndarray, "4 4"]]
    rest: Rest
    table: Table
    R_table: Float[np.ndarray, "3 3"]
    directions: Float[np.ndarray, "direction 3"]
    fixture_height: float
    """How far above the table the base part is held [m]."""

    def scene(
        self,
        name: str,
        fixed: Sequence[str],
        loose: Sequence[str],
        config: MotionConfig,
        waiting: Mapping[str, Pose] = MappingProxyType({}),
    ) -> Scene:
        """Return what the part moves among: fixed parts as assembled, loose ones at rest, waiting ones where given."""
        poses = [(n, self.assembled[n]) for n in fixed] + [(n, self.rest.poses[n]) for n in loose]
        obstacles = [Obstacle(body=self.bodies[n], T_world_part=T) for n, T in (*poses, *waiting.items())]
        body = self.bodies[name]
        return Scene(
            body,
            obstacles,
            self.table,
            self.directions,
            clearance=config.min_clearance * body.size,
            max_checks=config.max_edge_checks,
        )


def plan_motion(
    name: str,
    insertion: Insertion,
    fixed: Sequence[str],
    loose: Sequence[str],
    setting: Setting,
    *,
    config: MotionConfig,
    rng: np.random.Generator,
    simultaneous: Mapping[str, Pose | None] = MappingProxyType({}),
) -> Motion | Unsolved:
    """Return the part's motion from resting to assembled pose, or why there is none.

    Args:
        name: The part that moves.
        insertion: Its last stretch.
        fixed: Parts already placed.
        loose: Parts that still rest on the table, those that are inserted at the same time aside.
        setting: Geometry, poses and table.
        config: Options.
        rng: The part's own generator.
        simultaneous: Parts that are inserted at the same time, each with where it waits for that already, if it does;
            else it still rests. During the insertion nothing is asked of them.
    """
    body = setting.bodies[name]
    waiting = {other: setting.rest.poses[other] if T is None else T for other, T in simultaneous.items()}
    scene = setting.scene(name, fixed, loose, config, waiting)
    resting = setting.rest.poses[name]
    lifted = resting.copy()
    lifted[:3, 3] += config.lift * body.size * setting.table.normal
    lift = scene.check_edge(resting, lifted, table=False)
    if not lift.free:
        return _unsolved(name, (lift.blocked_by,), "cannot be lifted off the table")
    if config.insertion == "rrt" and not simultaneous:
        return _pure_rrt(name, scene, resting, lifted, fixed, setting, config, rng)
    among_loose = setting.scene(name, (), loose, config).with_clearance(0.0)
    for T_a, T_b in pairwise(insertion.poses):
        # the table was put below every insertion; fixed parts were looked at by level 1
        if not (edge := among_loose.check_edge(T_b, T_a, table=False)).free:
            return _unsolved(name, (edge.blocked_by,), "the insertion meets a part at rest")
    reach = 2.0 * body.radius
    transit = plan_transit(
        scene,
        lifted,
        insertion.poses[0],
        insertion.exit_direction,
        setting.R_table,
        box=(setting.rest.box_low - reach, setting.rest.box_high + reach),
        config=config,
        rng=rng,
    )
    if transit.path is None:
        return _unsolved(name, transit.blocked_by, "no transit from resting to pre-insertion pose")
    stop = len(transit.path)
    return _timed(
        np.array([resting, *transit.path, *insertion.poses[1:]]),
        stop,
        body,
        config,
        {
            **_transit_evidence(scene, lift, transit.path, transit),
            "preinsertion_gap": insertion.gap,
            "tipping_angle": setting.rest.stable[name].tipping_angle,
            "resting_probability": setting.rest.stable[name].probability,
        },
    )


def _timed(
    poses: Float[np.ndarray, "pose 4 4"], stop: int, body: Body, config: MotionConfig, evidence: Mapping[str, object]
) -> Motion:
    """The motion along these poses, the transit up to pose ``stop``, with its times."""
    segments = (
        Segment(kind="transit", start=0, stop=stop),
        Segment(kind="insertion", start=stop, stop=len(poses) - 1),
    )
    trajectory = time_path(poses, segments, body, config.trajectory)
    return Motion(
        T_world_part=poses,
        segments=segments,
        evidence={**evidence, **trajectory.evidence()},
        times=trajectory.times,
    )


def _transit_evidence(scene: Scene, lift: EdgeCheck, path: Sequence[Pose], transit: Transit) -> dict[str, object]:
    """What a last look at the finished transit shows."""
    # a shortcut may cut an edge where its gap is down to half the clearance: ask for a little less
    final = scene.with_clearance(0.4 * transit.clearance)
    edges = [final.check_edge(a, b) for a, b in pairwise(path)]
    return {
        "transit_certified": all(edge.free for edge in edges),
        "transit_min_gap": min([lift.min_gap, *(edge.min_gap for edge in edges)]),
        "transit_clearance": transit.clearance,
        "edges_checked": transit.work.edges,
        "poses_checked": transit.work.poses,
        "mesh_distances": transit.work.distances,
        "rrt_nodes": transit.work.rrt_nodes,
    }


def _pure_rrt(
    name: str,
    scene: Scene,
    resting: Pose,
    lifted: Pose,
    fixed: Sequence[str],
    setting: Setting,
    config: MotionConfig,
    rng: np.random.Generator,
) -> Motion | Unsolved:
    """RRT-Connect straight to the assembled pose, as the paper has it."""
    body, assembled = scene.moving, setting.assembled[name]
    tolerant = TolerantScene(scene, assembled, fixed, config)
    reach = 2.0 * body.radius
    box = (setting.rest.box_low - reach, setting.rest.box_high + reach)
    result = rrt_connect(
        lifted,
        assembled,
        edge_is_free=tolerant.edge_is_free,
        sample=pose_sampler(*box, setting.R_table, body.center, lifted, assembled, config.rrt),
        metric=pose_metric(body.center, body.radius),
        step=config.rrt.step * body.radius,
        config=config.rrt,
        rng=rng,
    )
    if result.path is None:
        return _unsolved(name, (), f"RRT-Connect found no path in {result.iterations} iterations")
    path = smooth(
        list(result.path),
        edge_is_free=tolerant.edge_is_free,
        length=lambda a, b: path_length(body, a, b),
        config=config.smoothing,
        rng=rng,
    )
    poses = np.array([resting, *path])
    return _timed(
        poses,
        1,
        body,
        config,
        {
            "transit_certified": False,
            "max_penetration": tolerant.max_penetration([resting, *path]),
            "tolerance": tolerant.tolerance,
            "tipping_angle": setting.rest.stable[name].tipping_angle,
            "resting_probability": setting.rest.stable[name].probability,
            "edges_checked": result.edge_checks,
            "rrt_nodes": result.nodes,
        },
    )


def _unsolved(name: str, blocked_by: Sequence[str | None], reason: str) -> Unsolved:
    parts = tuple(other for other in blocked_by if other is not None)
    named = f", met {', '.join(parts)}" if parts else ""
    return Unsolved(
        part=name,
        answer=Answer.UNKNOWN,
        blocked_by=tuple(other for other in parts if other != "table"),
        reason=reason + named,
    )

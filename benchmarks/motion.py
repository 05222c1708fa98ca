"""Level 2 on real assemblies: seconds for all motions, and the same steps by RRT-Connect alone, ours and OMPL's.

    python benchmarks/motion.py --json benchmarks/results/motion.json
    python benchmarks/motion.py --truth --json benchmarks/results/motion_truth.json
    python benchmarks/motion.py --rrt 6 --json benchmarks/results/motion.json     (`pip install ompl` for its row)

Each assembly is planned as `sashimono plan` does it. Counted are the steps of its plan, and the parts without one for
want of a motion; seconds are of all attempts, subassemblies included. With
``--rrt N`` the same steps of assemblies of at most N parts, from the same lifted resting poses, are given to
RRT-Connect with the collision rule that `--motion rrt` has (no deeper than assembled, plus 2 %), for ``--seconds``
each, by the clock: ours, and OMPL's.
"""

from __future__ import annotations

import itertools
import os
import statistics
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json

import sashimono
from sashimono import tree
from sashimono.geometry.body import Body
from sashimono.motion import MotionConfig, RRTConfig, rrt_connect
from sashimono.motion.pure_rrt import TolerantScene
from sashimono.motion.rrt_connect import pose_metric, pose_sampler
from sashimono.motion.scene import Obstacle, Scene, slab_directions
from sashimono.motion.table import frame
from sashimono.pipeline import PipelineConfig, plan_assembly


class OutOfTime(Exception):
    """A search has used up its seconds."""


def main() -> None:
    options = parser(__doc__, "motion.json")
    options.add_argument(
        "--rrt",
        type=int,
        default=0,
        metavar="N",
        help="assemblies of at most N parts: also RRT-Connect, ours and OMPL's",
    )
    options.add_argument("--seconds", type=float, default=5.0, help="time of each such search")
    options.add_argument("--truth", action="store_true", help="the truth set instead of real CAD")
    arguments = options.parse_args()
    assemblies, steps = [], []
    for folder in chosen(SHARED / ("truth" if arguments.truth else "assemblies"), arguments.names):
        row, own = measure(folder, arguments)
        assemblies.append(row)
        steps += own
        print(f"{row['name']}: {row['moved']} of {row['steps']} in {row['seconds']} s", file=sys.stderr, flush=True)
    summary = summarise(assemblies, steps, arguments)
    write_json(arguments.json, {"machine": machine(), "summary": summary, "assemblies": assemblies, "steps": steps})
    print(table(("figure", "value"), list(summary.items())))


def measure(folder: Path, arguments: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Plan one assembly; return its row, and with ``--rrt`` a row for each step on its top level."""
    calls: list[tuple[float, Any, tuple, dict]] = []
    plan_motions = tree.plan_motions

    def timed(*arguments: Any, **options: Any) -> Any:
        start = time.process_time()
        found = plan_motions(*arguments, **options)
        calls.append((time.process_time() - start, found, arguments, options))
        return found

    assembly = sashimono.read_assembly(folder, unit="mm")
    tree.plan_motions = timed
    try:
        plan = plan_assembly(assembly, config=PipelineConfig(contacts=False))
    finally:
        tree.plan_motions = plan_motions
    steps = [step for step in plan.all_steps if len(step.motion.T_world_part) > 1]
    missed = {entry.part: entry.reason for _, found, *_ in calls for entry in found.unsolved}
    failed = [f"{entry.part}: {missed[entry.part]}" for entry in plan.unsolved if entry.part in missed]
    row = {
        "name": folder.name,
        "kind": kind_of(folder.name, len(assembly)),
        "parts": len(assembly),
        "steps": len(steps) + len(failed),
        "moved": len(steps),
        "seconds": round(sum(seconds for seconds, *_ in calls), 3),
        "calls": len(calls),
        "failed": failed,
    }
    return row, step_rows(folder.name, calls[-1], arguments.seconds) if calls and len(assembly) <= arguments.rrt else []


def step_rows(name: str, call: tuple, seconds: float) -> list[dict[str, Any]]:
    """Return what ours and OMPL's RRT-Connect do on each step of one call of `plan_motions`."""
    _, found, (level, order, _), options = call
    bodies, config, rows = options["bodies"], MotionConfig(insertion="rrt"), []
    R_table = frame(found.table.normal)
    for k, part in enumerate(order):
        if part not in found.resting:
            continue
        fixed = [*options["in_place"], *order[:k]]
        obstacles = [Obstacle(body=bodies[n], T_world_part=level.part(n).T_world_part) for n in fixed]
        obstacles += [
            Obstacle(body=bodies[n], T_world_part=found.resting[n]) for n in order[k + 1 :] if n in found.resting
        ]
        body = bodies[part]
        scene = Scene(
            body,
            obstacles,
            found.table,
            slab_directions(R_table),
            clearance=config.min_clearance * body.size,
            max_checks=config.max_edge_checks,
        )
        tolerant = TolerantScene(scene, level.part(part).T_world_part, fixed, config)
        start, goal = found.resting[part].copy(), level.part(part).T_world_part
        start[:3, 3] += config.lift * body.size * found.table.normal
        reach = 2.0 * body.radius
        corners = np.array(
            [bodies[n].support(o.T_world_part, R_table.T) for n, o in zip(fixed, obstacles, strict=False)]
        )
        corners = np.concatenate([corners, np.array([body.support(T, R_table.T) for T in (start, goal)])])
        box = (corners[:, 0].min(axis=0) - reach, corners[:, 1].max(axis=0) + reach)
        row = {"assembly": name, "part": part, "planned": part in found.motions}
        for label, search in (("ours", ours), ("ompl", ompl_search if find_spec("ompl") else None)):
            if search is not None:
                begin = time.perf_counter()
                solved = search(tolerant, body, start, goal, R_table, box, seconds)
                row |= {label: solved, f"{label}_seconds": round(time.perf_counter() - begin, 3)}
        rows.append(row)
    return rows


def within(seconds: float, check: Callable[..., bool]) -> Callable[..., bool]:
    """Return the check, which raises `OutOfTime` once so much time has passed."""
    end = time.perf_counter() + seconds

    def timed(*arguments: Any) -> bool:
        if time.perf_counter() > end:
            raise OutOfTime
        return check(*arguments)

    return timed


def ours(tolerant: TolerantScene, body: Body, start: Any, goal: Any, R_table: Any, box: Any, seconds: float) -> bool:
    """Return whether our RRT-Connect finds a way."""
    config = RRTConfig(max_iterations=10**9, max_nodes=10**9)
    try:
        result = rrt_connect(
            start,
            goal,
            edge_is_free=within(seconds, tolerant.edge_is_free),
            sample=pose_sampler(*box, R_table, body.center, start, goal, config),
            metric=pose_metric(body.center, body.radius),
            step=config.step * body.radius,
            config=config,
            rng=np.random.default_rng(0),
        )
    except OutOfTime:
        return False
    return result.path is not None


def ompl_search(
    tolerant: TolerantScene, body: Body, start: Any, goal: Any, R_table: Any, box: Any, seconds: float
) -> bool:
    """Return whether OMPL's RRT-Connect finds a way: its own space, sampler and metric; our check of a pose."""
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou
    from scipy.spatial.transform import Rotation

    ou.setLogLevel(ou.LogLevel.LOG_ERROR)
    # OMPL weighs a turn by a number: lengths are given in radii of the part, its position is that of its centre
    space = ob.SE3StateSpace()
    bounds = ob.RealVectorBounds(3)
    corners = np.array(list(itertools.product(*zip(*box, strict=True)))) @ R_table.T
    for axis in range(3):
        bounds.setLow(axis, float(corners[:, axis].min() / body.radius))
        bounds.setHigh(axis, float(corners[:, axis].max() / body.radius))
    space.setBounds(bounds)

    def pose(state: Any) -> np.ndarray:
        q = state.rotation()
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        T[:3, 3] = np.array([state.getX(), state.getY(), state.getZ()]) * body.radius - T[:3, :3] @ body.center
        return T

    def put(state: Any, T: np.ndarray) -> None:
        center = (T[:3, :3] @ body.center + T[:3, 3]) / body.radius
        state.setX(float(center[0]))
        state.setY(float(center[1]))
        state.setZ(float(center[2]))
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        q = state.rotation()
        q.x, q.y, q.z, q.w = float(x), float(y), float(z), float(w)

    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(ob.StateValidityCheckerFn(lambda state: bool(tolerant.pose_is_free(pose(state)))))
    setup.getSpaceInformation().setStateValidityCheckingResolution(
        MotionConfig().max_displacement / float(space.getMaximumExtent())
    )
    first, last = ob.State(space), ob.State(space)
    put(first(), start)
    put(last(), goal)
    setup.setStartAndGoalStates(first, last)
    setup.setPlanner(og.RRTConnect(setup.getSpaceInformation()))
    return bool(setup.solve(seconds)) and setup.haveExactSolutionPath()


def summarise(assemblies: list[dict[str, Any]], steps: list[dict[str, Any]], arguments: Any) -> dict[str, Any]:
    """Return counts and times; whoever failed counts."""
    seconds = sorted(row["seconds"] for row in assemblies)
    total, moved = sum(row["steps"] for row in assemblies), sum(row["moved"] for row in assemblies)
    out = {
        "assemblies": len(assemblies),
        "steps with a removal": total,
        "steps with a motion": moved,
        "median s an assembly": statistics.median(seconds),
        "p90 s": seconds[int(0.9 * (len(seconds) - 1))],
        "p99 s": seconds[int(np.ceil(0.99 * (len(seconds) - 1)))],
        "worst s": seconds[-1],
    }
    for label in ("ours", "ompl"):
        rows = [row for row in steps if label in row]
        if rows:
            out[f"steps given to RRT-Connect ({label}), {arguments.seconds} s each"] = len(rows)
            out[f"found by RRT-Connect ({label})"] = sum(row[label] for row in rows)
            out[f"median s ({label})"] = statistics.median(row[f"{label}_seconds"] for row in rows)
    return out


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # OMPL's Python bindings crash when the interpreter takes them down

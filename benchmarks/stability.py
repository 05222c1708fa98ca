"""Which plans can be carried out, and does a rigid-body simulation agree on what stands?

    python benchmarks/stability.py [NAME ...]                   executable with two hands and with one, by kind
    python benchmarks/stability.py --simulate 200 [NAME ...]    partial assemblies of these plans against MuJoCo

With ``--plans FOLDER``, plans are read from NAME.json there; those that are missing are made and written. Besides hands
are counted: placed parts that touch nothing and that nobody holds, and pairs of which a fastener comes before what it
clamps, or a nut before its bolt.

The simulation needs ``pip install mujoco coacd``. Every part is a set of convex pieces (CoACD), each shrunk by a
hundredth of the part's smallest extent; what the plan says is joined is one body; what it holds, and the fixture, does
not move. A part counts as fallen if its centre sinks, within two seconds, by more than a fifth of its smallest extent.
Cases, spread over the assemblies and their steps: a step with what it holds, which should stand, and one that holds
something with nobody holding, in which something should fall. Where pieces of two parts start inside one another by
more than a twentieth of the smaller one's smallest extent, they are not the parts any more (they fill holes): such a
case is counted apart, and what the simulation says of it is not asked.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.geometry import se3
from sashimono.io.plan_json import read_plan, write_plan
from sashimono.io.read import read_assembly
from sashimono.pipeline import plan_assembly
from sashimono.plan import AssemblyPlan, Step, Subassembly, Table, step_tables
from sashimono.stability import StabilityConfig, Touching

SECONDS = 2.0
"""Of simulated time; the model is about a metre large, so that even a slow tipping is seen."""
SUNK = 0.2
"""Of a part's smallest extent: how far its centre sinks if it counts as fallen."""
SHRUNK = 0.01
"""Of a part's smallest extent: how far the faces of its pieces are moved inwards."""
INSIDE = 0.05
"""Of the smaller part's smallest extent: how deep pieces may start in one another."""


def main() -> None:
    arguments = parser(__doc__, "stability.json")
    arguments.add_argument("--plans", type=Path, help="folder of plans to read, or to write where they are missing")
    arguments.add_argument("--simulate", type=int, default=0, metavar="N", help="at most N cases for MuJoCo")
    arguments.add_argument("--each", type=int, default=6, help="at most so many cases of one assembly")
    options = arguments.parse_args()
    rows: list[dict[str, Any]] = []
    cases: list[dict[str, Any]] = []
    folders = chosen(SHARED / "assemblies", options.names)
    for k, folder in enumerate(folders):
        parts = read_assembly(folder, unit="mm")
        if len(parts) < 3:
            continue
        plan = plan_of(folder.name, parts, options.plans)
        rows.append(row_of(folder, plan, parts))
        print(f"{folder.name}: {plan.verdict}", file=sys.stderr, flush=True)
        due = -(-(options.simulate - len(cases)) // (len(folders) - k))
        if options.simulate and plan.table is not None:
            cases += simulated(folder.name, plan, parts, most=min(options.each, due))
    compared = [case for case in cases if case["agrees"] is not None]
    agreed = sum(case["agrees"] for case in compared)
    simulation = {
        "cases": len(compared),
        "agree": agreed,
        "not_comparable": len(cases) - len(compared),
        "disagreements": [case for case in compared if not case["agrees"]],
    }
    summary = summarise(rows)
    write_json(options.json, {"machine": machine(), "summary": summary, "simulation": simulation, "assemblies": rows})
    heads = ("kind", *next(iter(summary.values())))
    print(table(heads, ([kind, *values.values()] for kind, values in summary.items())))
    if options.simulate:
        print(f"simulation: {agreed} of {len(compared)} cases agree; {len(cases) - len(compared)} not comparable")
    for case in simulation["disagreements"]:
        print(f"- {case['name']}, step {case['step']}, {case['expected']} expected; fallen: {case['fallen']}")


def plan_of(name: str, parts: Assembly, plans: Path | None) -> AssemblyPlan:
    """Return the plan of an assembly: the one that is kept, or a new one."""
    path = None if plans is None else plans / f"{name}.json"
    if path is not None and path.exists():
        return read_plan(path)
    plan = plan_assembly(parts)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_plan(plan, path)
    return plan


def row_of(folder: Path, plan: AssemblyPlan, parts: Assembly) -> dict[str, Any]:
    """Return what one plan says of hands."""
    most = max((step.hands or 0 for step in plan.all_steps), default=0)
    return {
        "name": folder.name,
        "kind": kind_of(folder.name, len(plan.parts)),
        "parts": len(plan.parts),
        "complete": plan.status == "complete",
        "two_hands": bool(plan.executable),
        "one_hand": bool(plan.executable) and most <= 1,
        "held": max((len(step.held) for step in plan.all_steps), default=0),
        "hands": most,
        "fixture": plan.fixture is not None,
        "turned_over": sum(step.turned for step in plan.all_steps),
        "close_fits": sum(bool(step.close_fits) for step in plan.all_steps),
        "floating": floating(plan, parts),
        "out_of_turn": 0.0 if plan.cost is None else plan.cost.terms["fasteners_out_of_turn"],
        "cost": None if plan.cost is None else plan.cost.total,
        "terms": {} if plan.cost is None else dict(plan.cost.terms),
    }


def floating(plan: AssemblyPlan, parts: Assembly) -> list[str]:
    """Return the placed parts that touch neither table, fixture nor what is in place, and that nobody holds."""
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=StabilityConfig())
    out: list[str] = []

    def look(level: AssemblyPlan | Subassembly) -> None:
        fixed = () if level.fixture is None else level.fixture.parts
        for step, on in zip(level.steps, step_tables(level.steps, level.table), strict=True):
            near = any(len(touching.between(a, b).points) for a in step.members for b in step.fixed)
            joined = any(touching.fastened(a, b) for a in step.members for b in step.fixed)
            stands = on is not None and any(len(touching.on_table(a, on).points) for a in step.members)
            if not (near or joined or stands or {*step.members} & {*step.held, *fixed}):
                out.append(step.part)
            if step.subassembly is not None:
                look(step.subassembly)

    look(plan)
    return out


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the shares by kind."""
    by_kind = defaultdict(list)
    for row in rows:
        by_kind[row["kind"]].append(row)
        by_kind["all"].append(row)
    return {
        kind: {
            "assemblies": len(found),
            "complete": sum(row["complete"] for row in found),
            "two hands": sum(row["two_hands"] for row in found),
            "one hand": sum(row["one_hand"] for row in found),
            "mean most held": round(float(np.mean([row["held"] for row in found])), 2),
            "fixture": sum(row["fixture"] for row in found),
            "turned over": sum(row["turned_over"] for row in found),
            "close fits": sum(row["close_fits"] for row in found),
            "floating": sum(len(row["floating"]) for row in found),
            "out of turn": sum(row["out_of_turn"] for row in found),
        }
        for kind, found in sorted(by_kind.items())
    }


def simulated(name: str, plan: AssemblyPlan, parts: Assembly, *, most: int) -> list[dict[str, Any]]:
    """Return the cases of one plan's top level: what was expected, and what fell."""
    tables = step_tables(plan.steps, plan.table)
    possible = [
        (k, step, held)
        for k, step in enumerate(plan.steps)
        for held in ([{*step.held}, set()] if step.held else [set()])
    ]
    picked = np.unique(np.linspace(0, len(possible) - 1, min(most, len(possible))).round().astype(int))
    scene = Scene(plan, parts)
    cases: list[dict[str, Any]] = []
    for k, step, held in (possible[place] for place in picked):
        on = tables[k]
        assert on is not None
        stands = held == set(step.held)
        fallen = scene.fallen((*step.fixed, *step.members), {*held, *fixture_at(plan, step)}, on)
        expected = "to stand" if stands else "to fall"
        agrees = None if fallen is None else stands == (not fallen)
        cases.append({"name": name, "step": k + 1, "expected": expected, "fallen": fallen, "agrees": agrees})
    return cases


def fixture_at(plan: AssemblyPlan, step: Step) -> tuple[str, ...]:
    """Return what the fixture holds at a step of the top level: nothing once the product was turned over."""
    before = plan.steps[: plan.steps.index(step) + 1]
    return () if plan.fixture is None or any(each.turned for each in before) else plan.fixture.parts


class Scene:
    """The parts of a plan as convex pieces, of which MuJoCo models are made."""

    def __init__(self, plan: AssemblyPlan, parts: Assembly) -> None:
        self._bodies = make_bodies(parts)
        self._poses = {part.name: part.T_world_part for part in parts.parts}
        joined = [(step.part, step.declared.other) for step in plan.all_steps if step.declared is not None]
        joined += [(step.part, other) for step in plan.all_steps if step.fastener for other in step.fastener.joins]
        joined += [(fit.part, fit.other) for step in plan.all_steps for fit in step.close_fits]
        self._touching = Touching(self._bodies, self._poses, config=StabilityConfig(), fastened=joined)
        self._pieces: dict[str, list[np.ndarray]] = {}

    def fallen(self, placed: Sequence[str], still: Collection[str], on: Table) -> list[str] | None:
        """Return the placed parts that sink; those in ``still``, and what is joined to them, do not move.

        None where the pieces are not the parts: they start too deep in one another.
        """
        import mujoco

        groups = self._groups(placed)
        owners: list[str] = []
        model = mujoco.MjModel.from_xml_string(self._document(groups, still, on, owners))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            pair = [owners[geom - 1] for geom in contact.geom if geom > 0]
            if contact.dist < -INSIDE * self._scale * min(self._bodies[name].smallest_extent for name in pair):
                return None
        before = data.xipos.copy()
        while data.time < SECONDS:
            mujoco.mj_step(model, data)
        out = []
        for k, group in enumerate(groups):
            row = model.body(f"g{k}").id
            sunk = before[row, 2] - data.xipos[row, 2]
            if sunk > SUNK * self._scale * min(self._bodies[name].smallest_extent for name in group):
                out += group
        return out

    def _pieces_of(self, name: str) -> list[np.ndarray]:
        if name not in self._pieces:
            body = self._bodies[name]
            points, volume = body.vertices, body.mass_properties.volume
            pieces = [points] if ConvexHull(points).volume < 1.001 * volume else convex_pieces(points, body.faces)
            shrunk = [shrunken(piece, SHRUNK * body.smallest_extent) for piece in pieces]
            self._pieces[name] = [piece for piece in shrunk if piece is not None]
        return self._pieces[name]

    def _groups(self, placed: Sequence[str]) -> list[list[str]]:
        groups: list[list[str]] = []
        for name in placed:
            joined = [group for group in groups if any(self._touching.fastened(name, other) for other in group)]
            groups = [group for group in groups if group not in joined]
            groups.append([*(other for group in joined for other in group), name])
        return groups

    @property
    def _scale(self) -> float:
        """Metres of the model in one metre of the product: MuJoCo is tuned for things of about this size."""
        return 1.0 / max(body.radius for body in self._bodies.values())

    def _document(self, groups: Sequence[Sequence[str]], still: Collection[str], on: Table, owners: list[str]) -> str:
        """Return the MJCF, with up along +z and the table at z = 0; add to ``owners`` the part of each geom."""
        up = on.normal
        x = np.cross(np.eye(3)[int(np.abs(up).argmin())], up)
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(up, x), up])
        assets, bodies = [], []
        for k, group in enumerate(groups):
            geoms = []
            for name in group:
                for piece in self._pieces_of(name):
                    points = se3.apply(self._poses[name], piece) @ R.T - [0.0, 0.0, on.offset]
                    mesh = f"m{len(assets)}"
                    numbers = " ".join(f"{value:.9g}" for value in (self._scale * points).reshape(-1))
                    assets.append(f'<mesh name="{mesh}" vertex="{numbers}"/>')
                    geoms.append(f'<geom type="mesh" mesh="{mesh}"/>')
                    owners.append(name)
            joint = "" if set(group) & set(still) else "<freejoint/>"
            bodies.append(f'<body name="g{k}">{joint}{"".join(geoms)}</body>')
        return (
            '<mujoco><option timestep="0.002" cone="elliptic" integrator="implicitfast"/>'
            '<default><geom friction="0.3 0.001 0.0001" density="1000" condim="3"/></default>'
            f'<asset>{"".join(assets)}</asset><worldbody><geom type="plane" size="50 50 1"/>{"".join(bodies)}'
            "</worldbody></mujoco>"
        )


def convex_pieces(points: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """Return the corners of convex pieces that make up a body."""
    import coacd

    coacd.set_log_level("error")
    scale = 1.0 / float(np.ptp(points, axis=0).max())  # it works in lengths of about one
    search = {"preprocess_resolution": 40, "resolution": 1000, "mcts_iterations": 60, "mcts_max_depth": 2, "seed": 0}
    found = coacd.run_coacd(coacd.Mesh(points * scale, faces), threshold=0.02, **search)
    return [np.asarray(corners) / scale for corners, _ in found if len(corners) >= 4]


def shrunken(corners: np.ndarray, by: float) -> np.ndarray | None:
    """Return the corners of a convex body whose faces are moved inwards; None if nothing of it is left."""
    try:
        sides = ConvexHull(corners).equations
        middle = corners[ConvexHull(corners).vertices].mean(axis=0)
        sides[:, 3] += by
        if (sides[:, :3] @ middle + sides[:, 3] >= -1e-3 * by).any():
            return None
        return HalfspaceIntersection(sides, middle).intersections
    except QhullError:
        return None


if __name__ == "__main__":
    main()

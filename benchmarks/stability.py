"""Support and gravity: which plans can be carried out, and does a rigid-body simulation agree on what stands?

    python benchmarks/stability.py [NAME ...]                   plans executable with two hands and with one, by kind
    python benchmarks/stability.py --simulate 200 [NAME ...]    partial assemblies of these plans against MuJoCo

The simulation needs ``pip install mujoco coacd``. Every part is a set of convex pieces (CoACD); fastened parts are one
body; what the plan holds, and the fixture, does not move. A part counts as fallen if its centre sinks, within two
seconds, by more than a fifth of its smallest extent. Cases: each step with what it holds, which should stand, and each
step that holds something with nobody holding, in which something should fall. Convex pieces fill small clearances and
thread flanks, so that parts can start inside one another and are pushed out: each disagreement is listed.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.geometry import se3
from sashimono.io.read import read_assembly
from sashimono.pipeline import plan_assembly
from sashimono.plan import AssemblyPlan
from sashimono.stability import StabilityConfig, Touching

SECONDS = 2.0
"""Of simulated time; the model is about a metre large, so that even a slow tipping is seen."""
SUNK = 0.2
"""Of a part's smallest extent: how far its centre sinks if it counts as fallen."""


def main() -> None:
    arguments = parser(__doc__, "stability.json")
    arguments.add_argument("--simulate", type=int, default=0, metavar="N", help="at most N cases for MuJoCo")
    options = arguments.parse_args()
    rows: list[dict[str, Any]] = []
    cases: list[dict[str, Any]] = []
    for folder in chosen(SHARED / "assemblies", options.names):
        parts = read_assembly(folder, unit="mm")
        plan = plan_assembly(parts)
        rows.append(row_of(folder, plan))
        print(f"{folder.name}: {plan.verdict}", file=sys.stderr, flush=True)
        if len(cases) < options.simulate:
            cases += simulated(folder.name, plan, parts, most=options.simulate - len(cases))
    summary = summarise(rows)
    agreed = sum(case["agrees"] for case in cases)
    simulation = {"cases": len(cases), "agree": agreed, "disagreements": [c for c in cases if not c["agrees"]]}
    write_json(options.json, {"machine": machine(), "summary": summary, "simulation": simulation, "assemblies": rows})
    heads = ("kind", "assemblies", "complete", "executable, two hands", "executable, one hand", "mean most held")
    print(table(heads, ([kind, *values.values()] for kind, values in summary.items())))
    print(f"simulation: {agreed} of {len(cases)} cases agree")
    for case in simulation["disagreements"]:
        print(
            f"- {case['name']}, step {case['step']}, {case['expected']} expected; fallen: {', '.join(case['fallen'])}"
        )


def row_of(folder: Path, plan: AssemblyPlan) -> dict[str, Any]:
    """Return what one plan says of hands."""
    most = max((step.hands or 0 for step in plan.all_steps), default=0)
    return {
        "name": folder.name,
        "kind": kind_of(folder.name, len(plan.parts)),
        "parts": len(plan.parts),
        "status": plan.status,
        "executable": bool(plan.executable),
        "one_hand": bool(plan.executable) and most <= 1,
        "held": max((len(step.held) for step in plan.all_steps), default=0),
        "hands": most,
        "fixture": plan.fixture is not None,
        "seconds": plan.timings,
    }


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the shares by kind, over assemblies of three and more parts."""
    by_kind = defaultdict(list)
    for row in rows:
        if row["parts"] >= 3:
            by_kind[row["kind"]].append(row)
            by_kind["all"].append(row)
    return {
        kind: {
            "assemblies": len(found),
            "complete": sum(row["status"] == "complete" for row in found),
            "two_hands": sum(row["executable"] for row in found),
            "one_hand": sum(row["one_hand"] for row in found),
            "held": round(float(np.mean([row["held"] for row in found])), 2),
        }
        for kind, found in by_kind.items()
    }


def simulated(name: str, plan: AssemblyPlan, parts: Assembly, *, most: int) -> list[dict[str, Any]]:
    """Return the cases of one plan's top level: what was expected, and what fell."""
    scene = Scene(plan, parts)
    fixed = () if plan.fixture is None else plan.fixture.parts
    cases: list[dict[str, Any]] = []
    for k, step in enumerate(plan.steps):
        placed = (*step.fixed, *step.members)
        for held in ({*step.held}, set()) if step.held else (set(),):
            if len(cases) == most:
                return cases
            stands = held == set(step.held)
            fallen = scene.fallen(placed, {*held, *fixed})
            expected = "to stand" if stands else "to fall"
            cases.append(
                {"name": name, "step": k, "expected": expected, "fallen": fallen, "agrees": stands == (not fallen)}
            )
    return cases


class Scene:
    """The parts of a plan as convex pieces, of which MuJoCo models are made."""

    def __init__(self, plan: AssemblyPlan, parts: Assembly) -> None:
        import coacd

        assert plan.table is not None
        coacd.set_log_level("error")
        self._table = plan.table
        self._bodies = make_bodies(parts)
        self._poses = {part.name: part.T_world_part for part in parts.parts}
        screwed = [(step.part, step.declared.other) for step in plan.all_steps if step.declared is not None]
        self._touching = Touching(self._bodies, self._poses, config=StabilityConfig(), fastened=screwed)
        self._pieces = {}
        for part in parts.parts:
            mesh = coacd.Mesh(part.vertices_part, part.faces)
            found = coacd.run_coacd(mesh, threshold=0.03, seed=0)
            self._pieces[part.name] = [vertices for vertices, _ in found if len(vertices) >= 4]

    def fallen(self, placed: Sequence[str], still: Collection[str]) -> list[str]:
        """Return the placed parts that sink; those in ``still``, and what is fastened to them, do not move."""
        import mujoco

        groups = self._groups(placed)
        model = mujoco.MjModel.from_xml_string(self._document(groups, still))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
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

    def _document(self, groups: Sequence[Sequence[str]], still: Collection[str]) -> str:
        """Return the MJCF, with up along +z and the table at z = 0."""
        up = self._table.normal
        x = np.cross(np.eye(3)[int(np.abs(up).argmin())], up)
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(up, x), up])
        assets, bodies = [], []
        for k, group in enumerate(groups):
            geoms = []
            for name in group:
                for piece in self._pieces[name]:
                    points = se3.apply(self._poses[name], piece) @ R.T - [0.0, 0.0, self._table.offset]
                    mesh = f"m{len(assets)}"
                    numbers = " ".join(f"{value:.9g}" for value in (self._scale * points).reshape(-1))
                    assets.append(f'<mesh name="{mesh}" vertex="{numbers}"/>')
                    geoms.append(f'<geom type="mesh" mesh="{mesh}"/>')
            joint = "" if set(group) & set(still) else "<freejoint/>"
            bodies.append(f'<body name="g{k}">{joint}{"".join(geoms)}</body>')
        return (
            '<mujoco><option timestep="0.001" cone="elliptic" integrator="implicitfast"/>'
            '<default><geom friction="0.3 0.001 0.0001" density="1000" condim="3"/></default>'
            f'<asset>{"".join(assets)}</asset><worldbody><geom type="plane" size="50 50 1"/>{"".join(bodies)}'
            "</worldbody></mujoco>"
        )


if __name__ == "__main__":
    main()

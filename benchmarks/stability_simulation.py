"""Does a rigid-body simulation agree on what stands? Partial assemblies of real plans against MuJoCo.

    python benchmarks/stability_simulation.py [NAME ...] [--cases 200] [--each 10] [--plans FOLDER]

It needs ``pip install mujoco coacd``. Cases, spread over the steps of each plan: a step with what it holds, which
should stand, and one that holds something with nobody holding, in which something should fall. What the plan says is
joined is one body, with the mass, centre and inertia of its parts; what it holds, and the fixture, does not move. The
table is not there where nothing stands on it: it would catch what falls. For contact, every part is a set of convex
pieces (CoACD), each shrunk by a hundredth of the part's smallest extent, an eighth of its own thickness at most.

A part counts as fallen if its centre sinks, within two seconds, by more than a tenth of the smaller smallest extent for
each touch on the way from what does not move up to it. Half of that is the gap at which parts count as touching, and
what was shrunk: so far they settle.

Where pieces of two parts start inside one another by more than a twentieth of the smaller one's smallest extent, they
are not the parts any more (they fill holes): such a case is counted apart, and what the simulation says is not asked.

With ``--plans``, plans are read from NAME.json there; those that are missing are made and written. Assemblies that the
result file has are not simulated again: remove it to begin anew. Disagreements are explained in
``stability_explained.json`` beside the results, by hand.
"""

from __future__ import annotations

import heapq
import json
import sys
from collections.abc import Collection, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import REPOSITORY, SHARED, chosen, machine, parser, write_json
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError
from stability import plan_of

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.io.read import read_assembly
from sashimono.plan import AssemblyPlan, Step, Table, step_tables
from sashimono.stability import StabilityConfig, Touching

SECONDS = 2.0
"""Of simulated time; the model is about a metre large, so that even a slow tipping is seen."""
SHRUNK = 0.01
"""Of a part's smallest extent: how far the faces of its pieces are moved inwards."""
THIN = 0.125
"""Of a piece's thickness: how far they are moved at most."""
SUNK = 0.1
"""Of the smaller of two touching parts' smallest extents: how far one may come down on the other without falling."""
FAR = 30.0
"""How far below the table is where nothing stands on it, in metres of the model: farther than anything falls."""
INSIDE = 0.05
"""Of the smaller part's smallest extent: how deep pieces may start in one another."""
EXPLAINED = REPOSITORY / "benchmarks" / "results" / "stability_explained.json"


def main() -> None:
    arguments = parser(__doc__, "stability_simulation.json")
    arguments.add_argument("--plans", type=Path, help="folder of plans to read, or to write where they are missing")
    arguments.add_argument("--cases", type=int, default=200, help="stop when there are so many that can be compared")
    arguments.add_argument("--each", type=int, default=10, help="at most so many cases of one assembly")
    options = arguments.parse_args()
    known = json.loads(options.json.read_text())["cases"] if options.json.exists() else {}
    cases: dict[str, list[dict[str, Any]]] = dict(known)
    folders = sorted(chosen(SHARED / "assemblies", options.names), key=_size)
    for folder in folders:
        if folder.name in cases or sum(_is_compared(case) for rows in cases.values() for case in rows) >= options.cases:
            continue
        parts = read_assembly(folder, unit="mm")
        if len(parts) < 3:
            continue
        plan = plan_of(folder.name, parts, options.plans)
        cases[folder.name] = [] if plan.table is None else simulated(plan, parts, most=options.each)
        write_json(options.json, content(cases))
        said = [f"{case['step']}{'' if case['expected'] == 'to stand' else 'f'}" for case in cases[folder.name]]
        wrong = [case for case in cases[folder.name] if case["agrees"] is False]
        print(f"{folder.name}: {' '.join(said)}; disagree: {wrong}", file=sys.stderr, flush=True)
    write_json(options.json, content(cases))
    summary = content(cases)["summary"]
    print(f"{summary['agree']} of {summary['cases']} cases agree; {summary['not_comparable']} not comparable")
    for case in content(cases)["disagreements"]:
        print(f"- {case['name']}, step {case['step']}, {case['expected']}; fallen: {case['fallen']}; {case['why']}")


def content(cases: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    """Return what is written: cases by assembly, their counts, and each disagreement with its explanation."""
    explained = json.loads(EXPLAINED.read_text()) if EXPLAINED.exists() else {}
    rows = [{"name": name, **case} for name, found in cases.items() for case in found]
    compared = [case for case in rows if _is_compared(case)]
    wrong = [case for case in compared if not case["agrees"]]
    summary = {
        "assemblies": sum(any(map(_is_compared, found)) for found in cases.values()),
        "cases": len(compared),
        "expected_to_fall": sum(case["expected"] == "to fall" for case in compared),
        "agree": len(compared) - len(wrong),
        "not_comparable": len(rows) - len(compared),
    }
    said = [{**case, "why": explained.get(case["name"], "not explained")} for case in wrong]
    return {"machine": machine(), "summary": summary, "disagreements": said, "cases": cases}


def _is_compared(case: dict[str, Any]) -> bool:
    return case["agrees"] is not None


def _size(folder: Path) -> tuple[int, str]:
    return sum(path.stat().st_size for path in folder.glob("*.obj")), folder.name


def simulated(plan: AssemblyPlan, parts: Assembly, *, most: int) -> list[dict[str, Any]]:
    """Return the cases of one plan's top level: what was expected, and what fell."""
    tables = step_tables(plan.steps, plan.table)
    possible = [
        (k, step, held)
        for k, step in enumerate(plan.steps)
        for held in ([{*step.held}, set()] if step.held else [set()])
    ]
    scene = Scene(plan, parts)
    possible = [
        (k, step, held)
        for k, step, held in possible
        if scene.is_loose((*step.fixed, *step.members), {*held, *fixture_at(plan, step)})
    ]
    picked = np.unique(np.linspace(0, len(possible) - 1, min(most, len(possible))).round().astype(int))
    cases: list[dict[str, Any]] = []
    for k, step, held in (possible[place] for place in picked):
        on = tables[k]
        assert on is not None
        stands = held == set(step.held)
        sunk = scene.sunk((*step.fixed, *step.members), {*held, *fixture_at(plan, step)}, on)
        fallen = None if sunk is None else [name for name, share in sunk.items() if share > 1.0]
        cases.append(
            {
                "step": k + 1,
                "expected": "to stand" if stands else "to fall",
                "sunk": None if sunk is None else round(max(sunk.values()), 3),
                "fallen": fallen,
                "agrees": None if fallen is None else stands == (not fallen),
            }
        )
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

    def is_loose(self, placed: Sequence[str], still: Collection[str]) -> bool:
        """Return whether any of the placed parts is neither in ``still`` nor joined to what is."""
        return any(not set(group) & set(still) for group in self._groups(placed))

    def sunk(self, placed: Sequence[str], still: Collection[str], on: Table) -> dict[str, float] | None:
        """Return of each loose part how far its centre sinks, over what settling explains.

        Parts in ``still``, and what is joined to them, do not move. None where the pieces are not the parts: they start
        too deep in one another.
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
        settled = self._settled(groups, still, on)
        out = {}
        for k, group in enumerate(groups):
            if not set(group) & set(still):
                row = model.body(f"g{k}").id
                fell = float(before[row, 2] - data.xipos[row, 2]) / self._scale
                out[group[0]] = fell / settled[k]
        return out

    def _settled(self, groups: Sequence[Sequence[str]], still: Collection[str], on: Table) -> list[float]:
        """By group, how far it may come down [m] without anything having fallen: from touch to touch, the least way."""
        extent = {name: SUNK * self._bodies[name].smallest_extent for group in groups for name in group}
        out = [np.inf] * len(groups)
        queue = [(0.0, k) for k, group in enumerate(groups) if set(group) & set(still)]
        for k, group in enumerate(groups):
            queue += [(extent[name], k) for name in group if len(self._touching.on_table(name, on).points)]
        heapq.heapify(queue)
        while queue:
            way, k = heapq.heappop(queue)
            if way >= out[k]:
                continue
            out[k] = way
            for m, group in enumerate(groups):
                for a, b in product(groups[k], group) if way < out[m] else ():
                    if len(self._touching.between(a, b).points):
                        heapq.heappush(queue, (way + min(extent[a], extent[b]), m))
        return [way if np.isfinite(way) else min(map(extent.__getitem__, groups[k])) for k, way in enumerate(out)]

    def _pieces_of(self, name: str) -> list[np.ndarray]:
        if name not in self._pieces:
            body = self._bodies[name]
            shrunk = [shrunken(piece, SHRUNK * body.smallest_extent) for piece in convex_pieces(body)]
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
        T = se3.make(np.stack([x, np.cross(up, x), up]), np.array([0.0, 0.0, -on.offset]))
        assets, bodies = [], []
        for k, group in enumerate(groups):
            geoms = []
            for name in group:
                for piece in self._pieces_of(name):
                    points = self._scale * se3.apply(T @ self._poses[name], piece)
                    mesh = f"m{len(assets)}"
                    assets.append(f'<mesh name="{mesh}" vertex="{_numbers(points)}"/>')
                    geoms.append(f'<geom type="mesh" mesh="{mesh}"/>')
                    owners.append(name)
            joint = "" if set(group) & set(still) else f"<freejoint/>{self._inertial(group, T)}"
            bodies.append(f'<body name="g{k}">{joint}{"".join(geoms)}</body>')
        stands = any(len(self._touching.on_table(name, on).points) for group in groups for name in group)
        plane = f'<geom type="plane" size="50 50 1" pos="0 0 {0.0 if stands else -FAR}"/>'
        return (
            '<mujoco><option timestep="0.002" cone="elliptic" integrator="implicitfast" impratio="10"/>'
            '<default><geom friction="0.3 0.001 0.0001" condim="3" solref="0.005 1" solimp="0.95 0.99 0.001"/>'
            "</default>"
            f"<asset>{''.join(assets)}</asset><worldbody>{plane}{''.join(bodies)}</worldbody></mujoco>"
        )

    def _inertial(self, group: Sequence[str], T_model_world: np.ndarray) -> str:
        """The mass, centre and inertia of joined parts, of density 1000, from their surfaces and not their pieces."""
        masses, centers, inertias = [], [], []
        for name in group:
            mass, T = self._bodies[name].mass_properties, T_model_world @ self._poses[name]
            masses.append(1000.0 * self._scale**3 * mass.volume)
            centers.append(self._scale * se3.apply(T, mass.center[None])[0])
            inertias.append(1000.0 * self._scale**5 * T[:3, :3] @ mass.inertia @ T[:3, :3].T)
        center = np.average(centers, axis=0, weights=masses)
        inertia = np.zeros((3, 3))
        for mass, own, about in zip(masses, centers, inertias, strict=True):
            arm = own - center
            inertia += about + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial mass="{sum(masses):.9g}" pos="{_numbers(center)}" fullinertia="{_numbers(full)}"/>'


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.9g}" for value in values.reshape(-1))


def convex_pieces(body: Body) -> list[np.ndarray]:
    """Return the corners of convex pieces that make up a body.

    What the decomposition takes for no manifold it first draws anew on a grid. Where pieces then stick out so far that
    no case could be compared, the body is cut as it is, which can take minutes.
    """
    import coacd

    coacd.set_log_level("error")
    scale = 1.0 / float(np.ptp(body.vertices, axis=0).max())  # it works in lengths of about one
    search = {"preprocess_resolution": 40, "resolution": 1000, "mcts_iterations": 60, "mcts_max_depth": 2, "seed": 0}
    mesh = coacd.Mesh(scale * body.vertices, body.faces)
    pieces: list[np.ndarray] = []
    for mode in ("auto", "off"):
        found = coacd.run_coacd(mesh, threshold=0.02, preprocess_mode=mode, **search)
        pieces = [np.asarray(corners) / scale for corners, _ in found if len(corners) >= 4]
        if float(body.signed_distance.query(np.concatenate(pieces)).max()) <= INSIDE * body.smallest_extent:
            break
    return pieces


def shrunken(corners: np.ndarray, by: float) -> np.ndarray | None:
    """Return the corners of a convex body whose faces are moved inwards; None if it is flat, or nothing is left."""
    try:
        hull = ConvexHull(corners)
        sides = hull.equations
        middle = corners[hull.vertices].mean(axis=0)
        thickness = float(np.ptp(corners @ sides[:, :3].T, axis=0).min())
        by = min(by, THIN * thickness)
        sides[:, 3] += by
        if (sides[:, :3] @ middle + sides[:, 3] >= -1e-3 * by).any():
            return None
        return HalfspaceIntersection(sides, middle).intersections
    except QhullError:
        return None


if __name__ == "__main__":
    main()

"""Nuts on bolts with truth by construction: each comes off by its thread, and no other way.

    python benchmarks/nuts.py [--count 200] [--inserts 20] [--seed 0] [--limit 120] [--json FILE]

M4 to M24, coarse and fine pitch, right- and left-hand; profiles of ISO, square, tapered by 1 : 16 as pipes have them,
or with two or three starts; with a radial clearance of 0 to 5 % of the diameter, 12 to 64 facets a turn, any length,
any phase of the nut (where there is no clearance, ridges are then drawn into each other), and the whole turned at
random. Solved is one whose plan is complete, verified, and turns.

And heat-set inserts: a threaded sleeve whose knurls are drawn into a boss, with a screw in it. Solved is one whose
screw is turned out, and whose insert is pulled, not turned.
"""

from __future__ import annotations

import argparse
import itertools
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import manifold3d
import numpy as np
from common import REPOSITORY, machine, table, write_json

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan, Step

COARSE = {4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 16: 2.0, 20: 2.5, 24: 3.0}
"""Nominal diameter and pitch of ISO 261 [mm]."""
FINE = {4: 0.5, 5: 0.5, 6: 0.75, 8: 1.0, 10: 1.25, 12: 1.25, 16: 1.5, 20: 1.5, 24: 2.0}


KINDS = {"iso": 0.55, "square": 0.15, "tapered": 0.15, "two starts": 0.08, "three starts": 0.07}
"""Profiles, and how often each is drawn."""
TAPER = 1.0 / 32.0
"""Radius lost along the axis: that of pipe threads, 1 : 16 of the diameter."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--inserts", type=int, default=20)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--limit", type=float, default=120.0, help="processor time allowed for one [s]")
    options.add_argument("--only", type=int, default=None, metavar="K", help="the nut of this number")
    options.add_argument("--json", type=Path, default=REPOSITORY / "benchmarks" / "results" / "nuts.json")
    arguments = options.parse_args()
    numbers = range(arguments.count) if arguments.only is None else [arguments.only]
    inserts = range(arguments.inserts if arguments.only is None else 0)
    nuts = [said(measure(k, arguments.seed, draw, is_unscrewed, arguments.limit)) for k in numbers]
    pulled = [said(measure(k, arguments.seed, draw_insert, is_pulled, arguments.limit)) for k in inserts]
    summary = {"nuts": summed(nuts)} | ({"inserts": summed(pulled)} if pulled else {})
    if arguments.only is None:
        summary["nuts by kind, solved"] = {
            kind: f"{sum(r['solved'] for r in nuts if r['kind'] == kind)}/{sum(r['kind'] == kind for r in nuts)}"
            for kind in KINDS
        }
        write_json(arguments.json, {"machine": machine(), "summary": summary, "nuts": nuts, "inserts": pulled})
    for name, figures in summary.items():
        print(table((name, "figure"), figures.items()))


def said(row: dict[str, object]) -> dict[str, object]:
    """Print a row, and return it."""
    print(row, file=sys.stderr, flush=True)
    return row


def summed(rows: list[dict[str, object]]) -> dict[str, object]:
    """Return how many are solved, how long they took, and why the others are not."""
    solved = sum(bool(row["solved"]) for row in rows)
    seconds = sorted(float(str(row["cpu_s"])) for row in rows)
    return {
        "drawn": len(rows),
        "solved": solved,
        "share": round(solved / len(rows), 3),
        "median cpu s": round(float(np.median(seconds)), 2),
        "p90 cpu s": round(float(np.quantile(seconds, 0.9)), 2),
        "worst cpu s": seconds[-1],
        "not solved, by cause": dict(Counter(str(row["reason"]) for row in rows if not row["solved"])),
    }


class OutOfTime(Exception):
    """The time allowed for one is spent."""


def measure(
    number: int,
    seed: int,
    drawing: Callable[[np.random.Generator, np.random.Generator], tuple[dict[str, object], Assembly]],
    is_solved: Callable[[AssemblyPlan], bool],
    limit: float,
) -> dict[str, object]:
    """Draw one, plan it, and return what came of it."""
    size, assembly = drawing(np.random.default_rng([seed, number]), np.random.default_rng([seed, number, 1]))

    def stop(signal_number: int, frame: object) -> None:
        raise OutOfTime

    signal.signal(signal.SIGPROF, stop)
    start = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        plan = plan_assembly(assembly, config=PipelineConfig(contacts=False))
        solved = plan.status == "complete" and is_solved(plan)
        reason = "" if solved else plan.unsolved[0].reason if plan.unsolved else "not by its thread"
    except OutOfTime:
        solved, reason = False, f"more than {limit:g} s"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return {
        "number": number,
        **size,
        "solved": solved,
        "cpu_s": round(time.process_time() - start, 2),
        "reason": reason,
    }


def is_unscrewed(plan: AssemblyPlan) -> bool:
    """Return whether a part is turned in."""
    return max(turned_in(step) for step in plan.steps) > 1.0


def is_pulled(plan: AssemblyPlan) -> bool:
    """Return whether insert and screw are turned into one another, and insert and boss are not."""
    turned = {step.part: turned_in(step) for step in plan.steps}
    screwed, pressed = (max(pair, key=plan.order.index) for pair in (("insert", "screw"), ("boss", "insert")))
    return turned[screwed] > 1.0 and turned[pressed] < 0.1


def turned_in(step: Step) -> float:
    """Return by how many turns a part is turned on the last stretch of its path."""
    segments = step.motion.segments
    return turns(step.motion.T_world_part[segments[-1].start :]) if segments else 0.0


def turns(poses: np.ndarray) -> float:
    """Return by how many turns a path turns in all."""
    return float(sum(np.linalg.norm(se3.log(se3.inverse(a) @ b)[3:]) for a, b in itertools.pairwise(poses))) / 2 / np.pi


def draw(rng: np.random.Generator, rng_kind: np.random.Generator) -> tuple[dict[str, object], Assembly]:
    """Return what is drawn, and a nut on its bolt."""
    diameter = int(rng.choice(list(COARSE)))
    pitch = (COARSE if rng.random() < 0.7 else FINE)[diameter]
    hand = -1 if rng.random() < 0.2 else 1
    clearance = 0.0 if rng.random() < 0.3 else float(rng.uniform(0.0, 0.05))
    facets = int(rng.integers(12, 65))
    length = float(rng.uniform(1.5, 4.0)) * diameter
    height = float(rng.uniform(0.6, 1.0)) * diameter
    phase = float(rng.uniform(0.0, 360.0))
    at = float(rng.uniform(0.0, max(length - height, 0.0)))
    kind = str(rng_kind.choice(list(KINDS), p=list(KINDS.values())))
    starts = {"two starts": 2, "three starts": 3}.get(kind, 1)
    lead = starts * pitch
    options = {"starts": starts, "square": kind == "square", "taper": TAPER if kind == "tapered" else 0.0}
    shaft = thread(diameter, pitch, hand, facets, length, 0.0, **options)
    head = hexagon(1.6 * diameter, 0.65 * diameter).translate((0.0, 0.0, -0.65 * diameter))
    # a nut of a tapered thread is as wide as the bolt where it sits
    wider = clearance * diameter / 2.0 - options["taper"] * (at - pitch)
    gap = min(clearance * diameter / 2.0, 0.1 * pitch)
    hole = thread(diameter, pitch, hand, facets, height + 2.0 * pitch, wider, **options, gap=gap)
    # where it stands along the bolt and how it is turned belong together; the phase is what CAD gets wrong
    hole = hole.translate((0.0, 0.0, -pitch)).rotate((0.0, 0.0, hand * 360.0 * (at - pitch) / lead + phase))
    nut = (hexagon(1.7 * diameter, height) - hole).translate((0.0, 0.0, at))
    T = se3.make(rotation(rng), rng.uniform(-0.1, 0.1, 3))
    drawn = {
        "kind": kind,
        "thread": f"M{diameter}x{pitch}{'-LH' if hand < 0 else ''}",
        "clearance": round(clearance, 4),
        "facets": facets,
        "phase": round(phase, 1),
    }
    return drawn, Assembly(parts=(part("bolt", head + shaft, T), part("nut", nut, T)))


def draw_insert(rng: np.random.Generator, rng_kind: np.random.Generator) -> tuple[dict[str, object], Assembly]:
    """Return what is drawn, and a heat-set insert in a boss, with a screw in it.

    Its knurls run along it, or at 30° to it, as the two bands of real ones do; they are drawn into the boss.
    """
    diameter = int(rng.choice([3, 4, 5, 6, 8]))
    pitch = (COARSE | {3: 0.5})[diameter]
    facets = int(rng.integers(24, 65))
    clearance = float(rng.uniform(0.0, 0.05))
    phase = float(rng.uniform(0.0, 360.0))
    tilt = 0.0 if rng_kind.random() < 0.5 else 30.0
    height, radius, ribs = 1.5 * diameter, 0.75 * diameter, 3 * diameter + 6
    depth = float(rng.uniform(0.02, 0.04)) * diameter
    core = manifold3d.Manifold.cylinder(height, radius - depth, radius - depth, 64)
    turn = np.degrees(0.4 * height * np.tan(np.radians(tilt)) / radius)
    star = np.array(
        [
            [r * np.cos(a), r * np.sin(a)]
            for k in range(ribs)
            for r, a in ((radius - 1.5 * depth, 2 * np.pi * k / ribs), (radius, 2 * np.pi * (k + 0.5) / ribs))
        ]
    )
    bands = [
        manifold3d.CrossSection([star]).extrude(0.4 * height, 12, sign * turn).translate((0.0, 0.0, z * height))
        for sign, z in ((1.0, 0.05), (-1.0, 0.55))
    ]
    hole = thread(diameter, pitch, 1, facets, height + 2.0 * pitch, clearance * diameter / 2.0)
    hole = hole.translate((0.0, 0.0, -pitch)).rotate((0.0, 0.0, -360.0 + phase))
    insert = core + bands[0] + bands[1] - hole
    boss = manifold3d.Manifold.cylinder(height + diameter, 1.6 * diameter, 1.6 * diameter, 48).translate(
        (0.0, 0.0, -diameter)
    ) - manifold3d.Manifold.cylinder(height + diameter, radius - depth, radius - depth, 64).translate(
        (0.0, 0.0, -0.5 * diameter)
    )
    shaft = thread(diameter, pitch, 1, facets, 1.25 * height, 0.0)
    head = manifold3d.Manifold.cylinder(diameter, 0.9 * diameter, 0.9 * diameter, 48)
    screw = shaft + head.translate((0.0, 0.0, 1.2 * height))
    T = se3.make(rotation(rng), rng.uniform(-0.1, 0.1, 3))
    drawn = {
        "kind": "insert",
        "thread": f"M{diameter}x{pitch}",
        "clearance": round(clearance, 4),
        "facets": facets,
        "knurls": f"{ribs} at {tilt:g} deg",
    }
    return drawn, Assembly(parts=(part("boss", boss, T), part("insert", insert, T), part("screw", screw, T)))


def thread(
    diameter: float,
    pitch: float,
    hand: int,
    facets: int,
    length: float,
    wider: float,
    *,
    starts: int = 1,
    square: bool = False,
    taper: float = 0.0,
    gap: float = 0.0,
) -> manifold3d.Manifold:
    """Return a threaded rod [mm] from z = 0 on: ridges wound about a core, facets as CAD has them.

    The basic ISO profile has a crest of 1/8 and a root of 1/4 of the pitch, flanks of 60° between them; a square one is
    as high as wide, half a pitch.

    Args:
        diameter: Of the crests, at z = 0.
        pitch: From one ridge to the next.
        hand: 1 for a right-hand thread, -1 for a left-hand one.
        facets: A turn.
        length: Of the rod.
        wider: Added to the radius.
        starts: Ridges side by side.
        square: Whether the profile is square.
        taper: Radius lost along the axis.
        gap: Added to either flank of a square ridge, which stays where it is when the rod is wider.
    """
    depth = 0.5 * pitch if square else 5.0 / 8.0 * 0.866 * pitch
    outer = diameter / 2.0 + wider
    inner, sunk = outer - depth, 0.05 * depth
    if starts > 1:  # corners of one ridge are over facets of the core
        sunk += inner * (1.0 - np.cos(np.pi / facets))
    foot, crest = (0.25 * pitch + gap,) * 2 if square else ((3.0 / 8.0 + 0.01) * pitch, pitch / 16.0)
    # radius and height of the ridge's corners; it is sunk a little into the core
    profile = np.array([[inner - sunk, -foot], [outer, -crest], [outer, crest], [inner - sunk, foot]])
    lead = starts * pitch
    steps = np.arange(int(np.ceil(facets * (length / lead + 2.0))) + 1)
    angles, rise = 2.0 * np.pi * steps / facets, lead * steps / facets - lead
    heights = profile[None, :, 1] + rise[:, None]
    radii = profile[None, :, 0] - taper * heights
    vertices = np.stack([radii * np.cos(angles)[:, None], radii * np.sin(angles)[:, None], heights], axis=2)
    vertices = vertices.reshape(-1, 3)
    corner = np.arange(4)
    here = (4 * steps[:-1, None] + corner).reshape(-1)
    beside = (4 * steps[:-1, None] + (corner + 1) % 4).reshape(-1)
    faces = np.concatenate(
        [
            np.stack([here, here + 4, beside], axis=1),
            np.stack([beside, here + 4, beside + 4], axis=1),
            [[0, 1, 2], [0, 2, 3]],
            4 * steps[-1] + np.array([[0, 2, 1], [0, 3, 2]]),
        ]
    )
    ridge = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices, tri_verts=faces.astype(np.uint64)))
    if ridge.volume() < 0.0 or ridge.status() != manifold3d.Error.NoError:
        raise AssertionError(f"the ridge is no solid: {ridge.status()}, {ridge.volume()} mm³")
    rod = manifold3d.Manifold.cylinder(length, inner, inner - taper * length, facets)
    within = manifold3d.Manifold.cylinder(length, 2.0 * outer, 2.0 * outer, 8)
    for k in range(starts):
        rod += ridge.rotate((0.0, 0.0, 360.0 * k / starts)) ^ within
    return rod if hand > 0 else rod.mirror((1.0, 0.0, 0.0))


def hexagon(width: float, height: float) -> manifold3d.Manifold:
    """Return a hexagonal prism [mm] of this width across flats, from z = 0 on."""
    return manifold3d.CrossSection.circle(width / np.sqrt(3.0), 6).extrude(height)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a rotation, all equally likely (Shoemake 1992)."""
    w, x, y, z = (quaternion := rng.normal(size=4)) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def part(name: str, solid: manifold3d.Manifold, T: np.ndarray) -> Part:
    """Return a part in place, in metres."""
    mesh = solid.to_mesh64()
    vertices = 1e-3 * np.asarray(mesh.vert_properties)[:, :3]
    return Part(name=name, vertices_part=vertices, faces=np.asarray(mesh.tri_verts).astype(np.int32), T_world_part=T)


if __name__ == "__main__":
    main()

"""Parts that must tilt: the tilt set solved, its blocked twins not, and what each takes.

    python benchmarks/tilt.py [NAME ...] [--growth est rrt] [--seeds 5]

Each case of `tilt_set.py` is asked of the whole cascade as it is (open) and with the way blocked, and turned as a
whole by one rotation drawn at random. Every motion found is checked by `verify`. Then the search alone is asked of the
open ones with several seeds, by each way of growing its tree: how often it succeeds, and in how many tracing steps.
"""

from __future__ import annotations

import statistics
import time
from fnmatch import fnmatch

import numpy as np
from common import machine, parser, table, write_json
from scipy.spatial.transform import Rotation
from tilt_set import CASES, TiltCase, moved
from witnesses import Witnesses

from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.tilting.search import TiltConfig, search_tilt
from sashimono.geometry import se3

MOVING = 1
"""Position of the part that has to leave; the other one stays."""


def main() -> None:
    arguments = parser(__doc__, "tilt.json")
    arguments.add_argument("--growth", nargs="+", choices=("est", "rrt"), default=["est", "rrt"], help="of the tree")
    arguments.add_argument("--seeds", type=int, default=5, help="runs of the search alone, each with its own draws")
    options = arguments.parse_args()
    cases = [case for case in CASES if any(fnmatch(case.name, name) for name in options.names or ["*"])]
    if not cases:
        raise SystemExit(f"nothing in the tilt set matches {' '.join(options.names)}")
    T = se3.make(Rotation.random(rng=np.random.default_rng(0)).as_matrix())
    asked, searched = [], []
    for case in cases:
        for pose in (np.eye(4), T):
            for is_open in (True, False):
                asked.append(ask(case, pose, is_open=is_open))
                print(*asked[-1].values(), sep=" | ", flush=True)
        searched += [search(case, growth, options.seeds) for growth in options.growth]
    write_json(options.json, {"machine": machine(), "cascade": asked, "search": searched})
    for rows in (asked, searched):
        print("\n" + table(rows[0], [row.values() for row in rows]))
    for turned in (False, True):
        for is_open in (True, False):
            rows = [row for row in asked if row["open"] == is_open and row["turned"] == turned]
            free = sum(row["answer"] == "FREE" for row in rows)
            wrong = sum(bool(row["refuted"]) for row in rows)
            spent = sorted(row["cpu_s"] for row in rows)
            print(
                f"{'open' if is_open else 'blocked'}{', turned' if turned else ''}: {free} of {len(rows)} free, "
                f"{wrong} refuted, processor time median {statistics.median(spent)} s, worst {spent[-1]} s"
            )


def ask(case: TiltCase, T: np.ndarray, *, is_open: bool) -> dict:
    """Return what the cascade says of one case, moved as a whole by T."""
    assembly = moved(case.assembly(is_open=is_open), T)
    cascade = Cascade(assembly, make_bodies(assembly), config=SeparateConfig(tilting=True))
    start = time.process_time()
    found = cascade.separate(MOVING, cascade.parts.all_parts)
    spent = time.process_time() - start
    refuted = []
    if found.removal is not None:
        refuted = Witnesses(assembly).problems(MOVING, 1, found.removal)
    return {
        "name": case.name,
        "kind": case.kind,
        "open": is_open,
        "turned": not np.array_equal(T, np.eye(4)),
        "answer": str(found.answer),
        "stage": found.stage,
        "refuted": refuted,
        "cpu_s": round(spent, 2),
    }


def search(case: TiltCase, growth: str, seeds: int) -> dict:
    """Return how the search alone does on an open case, over some seeds."""
    assembly = case.assembly(is_open=True)
    cascade = Cascade(assembly, make_bodies(assembly), config=SeparateConfig(tilting=True))
    start = time.process_time()
    found = [
        search_tilt(
            cascade.parts, MOVING, [0], config=TiltConfig(growth="rrt" if growth == "rrt" else "est", seed=seed)
        )
        for seed in range(seeds)
    ]
    spent = time.process_time() - start
    return {
        "name": case.name,
        "growth": growth,
        "solved": f"{sum(each.removal is not None for each in found)}/{seeds}",
        "median tracing steps": int(statistics.median(each.traced for each in found)),
        "median slides": int(statistics.median(each.slides for each in found)),
        "mean cpu_s": round(spent / seeds, 2),
    }


if __name__ == "__main__":
    main()

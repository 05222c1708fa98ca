"""Groups that must move at once, each in a direction of its own: the set planned, its blocked twins not.

    python benchmarks/simultaneous.py [NAME ...]

Each case of `simultaneous_set.py` is planned whole as it is (open) and with the way blocked, and turned as a whole by
one rotation drawn at random. Every plan is checked by `verify`, the relative motion of each pair included. Contacts are
left out: none are looked for of what goes in at the same time.
"""

from __future__ import annotations

import statistics
import time
from fnmatch import fnmatch

import numpy as np
from common import machine, parser, table, write_json
from scipy.spatial.transform import Rotation
from simultaneous_set import CASES, SimultaneousCase
from tilt_set import moved

from sashimono.geometry import se3
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import verify_plan


def main() -> None:
    arguments = parser(__doc__, "simultaneous.json")
    options = arguments.parse_args()
    cases = [case for case in CASES if any(fnmatch(case.name, name) for name in options.names or ["*"])]
    if not cases:
        raise SystemExit(f"nothing in the set matches {' '.join(options.names)}")
    T = se3.make(Rotation.random(rng=np.random.default_rng(0)).as_matrix())
    rows = []
    for case in cases:
        for pose in (np.eye(4), T):
            for is_open in (True, False):
                rows.append(planned(case, pose, is_open=is_open))
                print(*rows[-1].values(), sep=" | ", flush=True)
    write_json(options.json, {"machine": machine(), "plans": rows})
    print("\n" + table(rows[0], [row.values() for row in rows]))
    for turned in (False, True):
        for is_open in (True, False):
            some = [row for row in rows if row["open"] == is_open and row["turned"] == turned]
            spent = sorted(row["cpu_s"] for row in some)
            print(
                f"{'open' if is_open else 'blocked'}{', turned' if turned else ''}: "
                f"{sum(row['complete'] for row in some)} of {len(some)} complete, "
                f"{sum(row['as_meant'] for row in some)} by the parts that must move at once, "
                f"{sum(row['refuted'] for row in some)} refuted, "
                f"processor time median {statistics.median(spent)} s, worst {spent[-1]} s"
            )


def planned(case: SimultaneousCase, T: np.ndarray, *, is_open: bool) -> dict:
    """Return what a plan of one case is like, moved as a whole by T."""
    assembly = moved(case.assembly(is_open=is_open), T)
    start = time.process_time()
    plan = plan_assembly(assembly, config=PipelineConfig(contacts=False))
    spent = time.process_time() - start
    at_once = {name for step in plan.steps if step.simultaneous for name in step.members}
    return {
        "name": case.name,
        "open": is_open,
        "turned": not np.array_equal(T, np.eye(4)),
        "complete": plan.status == "complete",
        "as_meant": at_once == set(case.movers),
        "refuted": not verify_plan(plan, assembly).ok,
        "cpu_s": round(spent, 2),
    }


if __name__ == "__main__":
    main()

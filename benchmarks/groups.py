"""Groups that must move as one along several legs, or at once in different ways: planned; with the way blocked, not.

    python benchmarks/groups.py [NAME ...]

Each case of `cartridge_set.py` (one group, several legs) and of `simultaneous_set.py` (several groups at once) is
planned whole as it is (open) and with the way blocked, and turned as a whole by one rotation drawn at random. Every
plan is checked by `verify`, the relative motion of each pair included. Contacts are left out: none are looked for of
what goes in at the same time.
"""

from __future__ import annotations

import statistics
import time
from fnmatch import fnmatch
from itertools import product

import numpy as np
from cartridge_set import CASES as AS_ONE
from common import machine, parser, table, write_json
from scipy.spatial.transform import Rotation
from simultaneous_set import CASES as AT_ONCE
from simultaneous_set import GroupCase
from tilt_set import moved

from sashimono.geometry import se3
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import verify_plan


def main() -> None:
    arguments = parser(__doc__, "groups.json")
    options = arguments.parse_args()
    cases = [case for case in (*AS_ONE, *AT_ONCE) if any(fnmatch(case.name, name) for name in options.names or ["*"])]
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
    for at_once, turned, is_open in product((False, True), (False, True), (True, False)):
        some = [row for row in rows if (row["at_once"], row["turned"], row["open"]) == (at_once, turned, is_open)]
        if some:
            spent = sorted(row["cpu_s"] for row in some)
            print(
                f"{'several at once' if at_once else 'as one, several legs'}, {'open' if is_open else 'blocked'}"
                f"{', turned' if turned else ''}: "
                f"{sum(row['complete'] for row in some)} of {len(some)} complete, "
                f"{sum(row['as_meant'] for row in some)} by the parts that must move together, "
                f"{sum(row['refuted'] for row in some)} refuted, "
                f"processor time median {statistics.median(spent)} s, worst {spent[-1]} s"
            )


def planned(case: GroupCase, T: np.ndarray, *, is_open: bool) -> dict:
    """Return what a plan of one case is like, moved as a whole by T."""
    assembly = moved(case.assembly(is_open=is_open), T)
    start = time.process_time()
    plan = plan_assembly(assembly, config=PipelineConfig(contacts=False))
    spent = time.process_time() - start
    if case.at_once:
        together = {name for step in plan.steps if step.simultaneous for name in step.members}
    else:
        together = {name for step in plan.steps if len(step.members) > 1 for name in step.members}
    return {
        "name": case.name,
        "at_once": case.at_once,
        "open": is_open,
        "turned": not np.array_equal(T, np.eye(4)),
        "complete": plan.status == "complete",
        "as_meant": together == set(case.movers),
        "refuted": not verify_plan(plan, assembly).ok,
        "cpu_s": round(spent, 2),
    }


if __name__ == "__main__":
    main()

"""Elastic parts: the elastic set planned and flagged, and nothing elastic seen in the rigid ones that look alike.

    python benchmarks/elastic.py [NAME ...]

Each elastic case of `elastic_set.py` is planned as it is, and turned as a whole by one rotation drawn at random; the
plan must be complete, declare one fit of the kind that it was built with, and hold to `verify`; without declared fits
it must be partial. Each rigid one is asked for fits directly, with all parts in place: none may be found.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from fnmatch import fnmatch

import numpy as np
from common import machine, parser, table, write_json
from elastic_set import ELASTIC, RIGID, FitCase
from scipy.spatial.transform import Rotation
from tilt_set import moved

from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade
from sashimono.fits.config import FitConfig
from sashimono.fits.find import FitFinder
from sashimono.geometry import se3
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import verify_plan


def main() -> None:
    options = parser(__doc__, "elastic.json").parse_args()
    cases = [case for case in (*ELASTIC, *RIGID) if any(fnmatch(case.name, name) for name in options.names or ["*"])]
    if not cases:
        raise SystemExit(f"nothing in the elastic set matches {' '.join(options.names)}")
    turned = se3.make(Rotation.random(rng=np.random.default_rng(0)).as_matrix())
    planned, asked = [], []
    for case in cases:
        for T in (np.eye(4), turned):
            rows = planned if case.elastic else asked
            rows.append(plan(case, T) if case.elastic else ask(case, T))
            print(*rows[-1].values(), sep=" | ", flush=True)
    write_json(options.json, {"machine": machine(), "elastic": planned, "rigid": asked})
    for rows in filter(None, (planned, asked)):
        print("\n" + table(list(rows[0]), [row.values() for row in rows]))
    good = sum(row["status"] == "complete" and row["as built"] and row["verified"] for row in planned)
    alone = sum(row["rigid"] == "complete" for row in planned)
    print(f"elastic: {good} of {len(planned)} planned with the fit they were built with, and verified; {alone} without")
    wrong = [row for row in asked if row["fits"]]
    print(f"rigid: {len(wrong)} of {len(asked)} seen as elastic")
    if spent := sorted(row["fits_s"] for row in planned):
        print(f"fits found in median {statistics.median(spent)} s, worst {spent[-1]} s")


def plan(case: FitCase, T: np.ndarray) -> dict:
    """Return what becomes of an elastic case, moved as a whole by T, with fits and without."""
    assembly, config = moved(case.assembly(), T), PipelineConfig(contacts=False)
    start = time.process_time()
    found = plan_assembly(assembly, config=config)
    spent = time.process_time() - start
    without = plan_assembly(assembly, config=replace(config, fits=FitConfig(enabled=False)))
    return {
        "name": case.name,
        "turned": not np.array_equal(T, np.eye(4)),
        "status": found.status,
        "fits": [f"{fit.kind} {1e3 * fit.depth:.3f} mm" for fit in found.fits],
        "as built": [fit.kind for fit in found.fits] == [case.kind],
        "needs_mm": case.depth,
        "verified": verify_plan(found, assembly).ok,
        "rigid": without.status,
        "fits_s": round(found.timings.get("fits", 0.0), 2),
        "cpu_s": round(spent, 2),
    }


def ask(case: FitCase, T: np.ndarray) -> dict:
    """Return which fits are seen in a rigid case, moved as a whole by T."""
    assembly = moved(case.assembly(), T)
    config = PipelineConfig()
    cascade = Cascade(assembly, make_bodies(assembly), config=config.separate)
    start = time.process_time()
    found = FitFinder(cascade.parts, config=config.fits).find(cascade.parts.all_parts)
    return {
        "name": case.name,
        "kind": case.kind,
        "turned": not np.array_equal(T, np.eye(4)),
        "fits": [f"{fit.kind} {1e3 * fit.depth:.3f} mm: {fit.reason}" for fit in found],
        "cpu_s": round(time.process_time() - start, 2),
    }


if __name__ == "__main__":
    main()

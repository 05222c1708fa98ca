"""Hashes of plans, to see that they stay what they are: on this machine, on another, after a change.

python tests/plan_hashes.py            print them
python tests/plan_hashes.py --write    renew plan_hashes.json, where a change of the plans is meant
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

from truth_set import read_truth

from sashimono.io.plan_json import plan_to_json
from sashimono.pipeline import plan_assembly
from sashimono.plan import AssemblyPlan

FILE = Path(__file__).resolve().parent / "plan_hashes.json"
NAMES = ("bolted_lid", "hinge_pin", "ring_stack")
DIGITS = 9
"""Significant digits: linear algebra differs in the last of sixteen between types of processors."""
TINY = 1e-12
"""Numbers below are rounding [m, rad, 1]."""
LEFT_OUT = {"timings", "sashimono_version", "config", "source", "mesh_distances", "direction", "length", "turns"}
"""Seconds, what says nothing of the plan, a count of queries, which a last digit may change by one, and what follows
from the path."""


def plan_hash(plan: AssemblyPlan) -> str:
    """Return the SHA-256 of a plan, its numbers rounded, without what is `LEFT_OUT`."""
    text = json.dumps(_rounded(json.loads(plan_to_json(plan))), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return 0.0 if abs(value) < TINY else float(f"{value:.{DIGITS - 1}e}")
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items() if key not in LEFT_OUT}
    return [_rounded(inner) for inner in value] if isinstance(value, list) else value


def hashes() -> dict[str, str]:
    """Return the hash of each assembly's plan, with seed 0."""
    return {name: plan_hash(plan_assembly(read_truth(name).parts)) for name in NAMES}


if __name__ == "__main__":
    text = json.dumps(hashes(), indent=1) + "\n"
    if "--write" in sys.argv:
        FILE.write_text(text, encoding="utf-8")
    sys.stdout.write(text)

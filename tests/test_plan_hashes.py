"""The same plan on any machine, but for the last digits: the hashes of three plans are committed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from plan_hashes import FILE, NAMES, plan_hash
from solids import peg_in_plate
from truth_set import read_truth

from sashimono.pipeline import PipelineConfig, plan_assembly

EXPECTED = json.loads(FILE.read_text(encoding="utf-8"))
HERE = Path(__file__).resolve().parent
RENEW = "plans changed: if that is meant, run python tests/plan_hashes.py --write and say why in the commit"


@pytest.mark.parametrize("name", NAMES)
def test_plans_are_what_they_were(name: str) -> None:
    assert plan_hash(plan_assembly(read_truth(name).parts)) == EXPECTED[name], RENEW


def test_an_older_type_of_processor_makes_the_same_plans() -> None:
    """OpenBLAS takes other kernels. What numba and NumPy compile for other instructions was seen to change nothing."""
    older = {"OPENBLAS_CORETYPE": "Nehalem"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(HERE / "plan_hashes.py")],
        env=os.environ | older, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert json.loads(done.stdout) == EXPECTED


def test_a_hash_sees_a_move_and_not_the_seconds() -> None:
    plan = plan_assembly(peg_in_plate(), config=PipelineConfig(contacts=False))
    assert plan_hash(replace(plan, timings={"sequence": 1.0}, version="9")) == plan_hash(plan)
    last = plan.steps[-1]
    poses = last.motion.T_world_part.copy()
    poses[0, 0, 3] += 1e-7
    moved = replace(last, motion=replace(last.motion, T_world_part=poses))
    assert plan_hash(replace(plan, steps=(*plan.steps[:-1], moved))) != plan_hash(plan)
    assert plan_hash(replace(plan, order=plan.order[::-1])) != plan_hash(plan)

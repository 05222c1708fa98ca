"""Ask of each step which real grippers can take the part all the way.

python examples/04_grippers.py [INPUT]
"""

from __future__ import annotations

import sys

import common

import sashimono

assembly = sashimono.read_assembly(sys.argv[1]) if len(sys.argv) > 1 else common.screwed_lid()
config = sashimono.PipelineConfig(grippers=("robotiq-2f85", "franka-hand"))
plan = sashimono.plan_assembly(assembly, config=config)
for step in plan.steps:
    for gripper, reason in step.grippers.items():
        sys.stdout.write(f"{step.part}: {gripper} {'can take it' if reason is None else f'cannot: {reason}'}\n")

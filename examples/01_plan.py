"""Plan an assembly, look at each step, check the plan, and write the pages.

    python examples/01_plan.py [INPUT] [--out FOLDER]

Without an input, this plans a screwed lid that it draws itself.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import common

import sashimono

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("input", nargs="?", type=Path, help=".step, .3mf, .glb, or a folder of meshes in place")
parser.add_argument("--out", type=Path, default=Path("plan"), help="folder to write into")
options = parser.parse_args()

assembly = sashimono.read_assembly(options.input) if options.input else common.screwed_lid()
plan = sashimono.plan_assembly(assembly, seed=0)

say = sys.stdout.write
say(f"{plan}\n")
for step in plan.steps:
    held = f"quality {step.contact.quality:.3f}" if step.contact else step.contact_reason
    say(f"  {step.part}: {len(step.motion.T_world_part)} poses, {held}\n")
for entry in plan.unsolved:
    say(f"  {entry.part}: {entry.verdict}, held by {', '.join(entry.blocked_by)}: {entry.reason}\n")

report = sashimono.verify_plan(plan, assembly)  # with none of the code that made the plan
say("\n".join(report.lines()) + "\n")
for path in sashimono.write_results(plan, assembly, options.out):
    say(f"written: {path}\n")

"""Look at an input before it is planned, and at what a change in CAD does to a plan.

python examples/06_doctor_and_diff.py [INPUT [NEW_INPUT]]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import common

import sashimono

say = sys.stdout.write
with tempfile.TemporaryDirectory() as folder:
    drawn = Path(folder)
    given = [Path(argument) for argument in sys.argv[1:3]]
    old = given[0] if given else common.write_parts(common.screwed_lid(), drawn / "old")
    found = sashimono.doctor(old, unit=None if given else "m")
    say(f"{found!r}\n")
    for finding in found.findings:
        say(f"  {finding.severity}: {finding.message} {finding.way_out}\n")

    # the same product with a lid that is a little shorter, unless another one is given
    new = given[1] if len(given) > 1 else common.write_parts(common.screwed_lid(lid_length=0.076), drawn / "new")
    assembly = sashimono.read_assembly(old, unit=None if given else "m")
    sashimono.write_results(sashimono.plan_assembly(assembly), assembly, drawn / "plan")
    changed = sashimono.diff(drawn / "plan" / "plan.json", new)
    say(f"{changed!r}\n")
    for change in changed.parts:
        if change.kinds:
            say(f"  {change.new or change.old}: {' and '.join(change.kinds)}\n")
    for reason in changed.reasons:
        say(f"  {reason}\n")

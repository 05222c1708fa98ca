"""Find what must be gone before each part can leave, and how many orders of assembly that allows.

python examples/02_conditions.py [INPUT]
"""

from __future__ import annotations

import sys
from itertools import islice

import common

import sashimono

assembly = sashimono.read_assembly(sys.argv[1]) if len(sys.argv) > 1 else common.screwed_lid()
conditions = sashimono.find_conditions(assembly)

say = sys.stdout.write
for name in assembly.names:
    clauses = [" and ".join(sorted(clause)) for clause in conditions.blockers(name)]
    if "" in clauses:
        say(f"{name} can leave at once\n")
    else:
        say(f"{name} can leave without {', or without '.join(clauses) or '(no motion found)'}\n")
for k in conditions.cut_short:
    say(f"{assembly.names[k]} may have more clauses\n")

counted = sashimono.count_orders(conditions)
say(f"orders: {counted.reason if counted.count is None else counted.count}\n")
for order in islice(sashimono.iterate_orders(conditions), 3):
    say(f"  assemble {', then '.join(assembly.names[k] for k in reversed(order))}\n")

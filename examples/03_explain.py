"""Say why a part is stuck: what stops it along each direction, what must go first, what change would free it.

python examples/03_explain.py [INPUT PART]
"""

from __future__ import annotations

import sys

import common

import sashimono

source, name = sys.argv[1:3] if len(sys.argv) > 2 else (None, "board")
assembly = sashimono.read_assembly(source) if source else common.screwed_lid()
for explanation in sashimono.explain(assembly, name):
    sys.stdout.write("\n".join(sashimono.explanation_lines(explanation)) + "\n")

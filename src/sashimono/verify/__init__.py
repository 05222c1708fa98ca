"""Independent check of a plan: from the input geometry, with none of the code that made it.

It shares the values (assembly, plan, errors), the file readers and the SE(3) formulas with the planner, and nothing
else: distances come from a hierarchy of its own (tested against libigl), intersections from manifold3d, force closure
from a linear program.
"""

from sashimono.verify.check import Verifier, verify_file, verify_plan
from sashimono.verify.config import VerifyConfig
from sashimono.verify.report import StepReport, VerifyReport

__all__ = ["StepReport", "Verifier", "VerifyConfig", "VerifyReport", "verify_file", "verify_plan"]

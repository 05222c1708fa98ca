"""Sashimono plans robotic assembly: sequence, motion and contact, from CAD parts in their assembled poses."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sashimono.assembly import Assembly, Part
    from sashimono.contact import ContactConfig, Gripper, choose_contact, choose_contacts, named_gripper
    from sashimono.disassembly.conditions.and_or import and_or_graph
    from sashimono.disassembly.conditions.clauses import RemovalConditions
    from sashimono.disassembly.conditions.orders import count_orders, find_precedence, iterate_orders
    from sashimono.disassembly.config import SeparateConfig
    from sashimono.disassembly.explanation.explain import Explanation
    from sashimono.disassembly.explanation.report import explanation_lines
    from sashimono.errors import InputError, PlanFormatError, SashimonoError
    from sashimono.examination import Diagnosis, DoctorConfig
    from sashimono.io.plan_json import read_plan, write_plan
    from sashimono.io.raw import ReadConfig
    from sashimono.io.read import read_assembly
    from sashimono.motion import MotionConfig, RRTConfig, plan_motions, rrt_connect, stable_poses
    from sashimono.notebook import LoadedPlan, load_plan, show
    from sashimono.pipeline import PipelineConfig, plan_assembly
    from sashimono.plan import Answer, AssemblyPlan, Contact, Motion, MotionClass, Step, Unsolved
    from sashimono.revision import Revision
    from sashimono.tasks import diff, doctor, explain, find_conditions, make_cascade, read_gripper, write_results
    from sashimono.verify import VerifyConfig, VerifyReport, verify_file, verify_plan
    from sashimono.view import write_diagnosis, write_explanation, write_glb, write_html
    from sashimono.view.manual import write_manual

__version__ = "0.1.0"

_HOMES = {
    "Answer": "sashimono.plan",
    "Assembly": "sashimono.assembly",
    "AssemblyPlan": "sashimono.plan",
    "Contact": "sashimono.plan",
    "ContactConfig": "sashimono.contact",
    "Diagnosis": "sashimono.examination",
    "DoctorConfig": "sashimono.examination",
    "Explanation": "sashimono.disassembly.explanation.explain",
    "Gripper": "sashimono.contact",
    "InputError": "sashimono.errors",
    "LoadedPlan": "sashimono.notebook",
    "Motion": "sashimono.plan",
    "MotionClass": "sashimono.plan",
    "MotionConfig": "sashimono.motion",
    "Part": "sashimono.assembly",
    "PipelineConfig": "sashimono.pipeline",
    "PlanFormatError": "sashimono.errors",
    "RRTConfig": "sashimono.motion",
    "ReadConfig": "sashimono.io.raw",
    "RemovalConditions": "sashimono.disassembly.conditions.clauses",
    "Revision": "sashimono.revision",
    "SashimonoError": "sashimono.errors",
    "SeparateConfig": "sashimono.disassembly.config",
    "Step": "sashimono.plan",
    "Unsolved": "sashimono.plan",
    "VerifyConfig": "sashimono.verify",
    "VerifyReport": "sashimono.verify",
    "and_or_graph": "sashimono.disassembly.conditions.and_or",
    "choose_contact": "sashimono.contact",
    "choose_contacts": "sashimono.contact",
    "count_orders": "sashimono.disassembly.conditions.orders",
    "diff": "sashimono.tasks",
    "doctor": "sashimono.tasks",
    "explain": "sashimono.tasks",
    "explanation_lines": "sashimono.disassembly.explanation.report",
    "find_conditions": "sashimono.tasks",
    "find_precedence": "sashimono.disassembly.conditions.orders",
    "iterate_orders": "sashimono.disassembly.conditions.orders",
    "load_plan": "sashimono.notebook",
    "make_cascade": "sashimono.tasks",
    "named_gripper": "sashimono.contact",
    "plan_assembly": "sashimono.pipeline",
    "plan_motions": "sashimono.motion",
    "read_assembly": "sashimono.io.read",
    "read_gripper": "sashimono.tasks",
    "read_plan": "sashimono.io.plan_json",
    "rrt_connect": "sashimono.motion",
    "show": "sashimono.notebook",
    "stable_poses": "sashimono.motion",
    "verify_file": "sashimono.verify",
    "verify_plan": "sashimono.verify",
    "write_diagnosis": "sashimono.view",
    "write_explanation": "sashimono.view",
    "write_glb": "sashimono.view",
    "write_html": "sashimono.view",
    "write_manual": "sashimono.view.manual",
    "write_plan": "sashimono.io.plan_json",
    "write_results": "sashimono.tasks",
}
"""Public names and the module of each, imported when first asked for."""

__all__ = [
    "Answer",
    "Assembly",
    "AssemblyPlan",
    "Contact",
    "ContactConfig",
    "Diagnosis",
    "DoctorConfig",
    "Explanation",
    "Gripper",
    "InputError",
    "LoadedPlan",
    "Motion",
    "MotionClass",
    "MotionConfig",
    "Part",
    "PipelineConfig",
    "PlanFormatError",
    "RRTConfig",
    "ReadConfig",
    "RemovalConditions",
    "Revision",
    "SashimonoError",
    "SeparateConfig",
    "Step",
    "Unsolved",
    "VerifyConfig",
    "VerifyReport",
    "__version__",
    "and_or_graph",
    "choose_contact",
    "choose_contacts",
    "count_orders",
    "diff",
    "doctor",
    "explain",
    "explanation_lines",
    "find_conditions",
    "find_precedence",
    "iterate_orders",
    "load_plan",
    "make_cascade",
    "named_gripper",
    "plan_assembly",
    "plan_motions",
    "read_assembly",
    "read_gripper",
    "read_plan",
    "rrt_connect",
    "show",
    "stable_poses",
    "verify_file",
    "verify_plan",
    "write_diagnosis",
    "write_explanation",
    "write_glb",
    "write_html",
    "write_manual",
    "write_plan",
    "write_results",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sashimono' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)

"""Sashimono plans robotic assembly: sequence, motion and contact, from CAD parts in their assembled poses."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sashimono.assembly import Assembly, Part
    from sashimono.errors import SashimonoError
    from sashimono.io.plan_json import read_plan, write_plan
    from sashimono.io.read import read_assembly
    from sashimono.pipeline import PipelineConfig, plan_assembly
    from sashimono.plan import AssemblyPlan
    from sashimono.verify import verify_plan

__version__ = "0.1.0"

_HOMES = {
    "Assembly": "sashimono.assembly",
    "AssemblyPlan": "sashimono.plan",
    "Part": "sashimono.assembly",
    "PipelineConfig": "sashimono.pipeline",
    "SashimonoError": "sashimono.errors",
    "plan_assembly": "sashimono.pipeline",
    "read_assembly": "sashimono.io.read",
    "read_plan": "sashimono.io.plan_json",
    "verify_plan": "sashimono.verify",
    "write_plan": "sashimono.io.plan_json",
}
"""Public names and the module of each, imported when first asked for."""

__all__ = [
    "Assembly",
    "AssemblyPlan",
    "Part",
    "PipelineConfig",
    "SashimonoError",
    "__version__",
    "plan_assembly",
    "read_assembly",
    "read_plan",
    "verify_plan",
    "write_plan",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sashimono' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)

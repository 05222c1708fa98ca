"""Support and gravity: does a partial assembly stand by itself, and if not, what is the least that must be held?"""

from sashimono.stability.close_fits import FitAxis, close_fit
from sashimono.stability.component import Component
from sashimono.stability.config import StabilityConfig
from sashimono.stability.embracing import embraces
from sashimono.stability.holding import Holding, fewest_held
from sashimono.stability.plan_holds import hold_plan
from sashimono.stability.statics import Statics
from sashimono.stability.touching import Touch, Touching

__all__ = [
    "Component",
    "FitAxis",
    "Holding",
    "StabilityConfig",
    "Statics",
    "Touch",
    "Touching",
    "close_fit",
    "embraces",
    "fewest_held",
    "hold_plan",
]

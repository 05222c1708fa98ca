"""The families of products, a module each: a module here with a ``FAMILY`` is one."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module

from sashimono.d4pas.product import Family


@cache
def families() -> dict[str, Family]:
    """Return all families by name, in the order of their names."""
    modules = sorted(info.name for info in pkgutil.iter_modules(__path__))
    found = [import_module(f"{__name__}.{module}").FAMILY for module in modules]
    return {family.name: family for family in found}

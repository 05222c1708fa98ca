"""Where the product is turned over: which table each step has, and does what is placed stand on the new one?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Step, Table
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig


def tables_of(steps: Sequence[Step], table: Table | None) -> list[Table | None]:
    """Return the table of each of these steps: that of the level until a step brings its own, which stays."""
    tables = []
    for step in steps:
        if step.table is not None:
            table = step.table
        tables.append(table)
    return tables


def stretch_after(steps: Sequence[Step], k: int) -> range:
    """Return the numbers of the steps after number ``k`` that come before the product is next turned over.

    Parts of later steps are laid out only when it has been turned: until then they are in nobody's way.
    """
    stop = k + 1
    while stop < len(steps) and steps[stop].table is None:
        stop += 1
    return range(k + 1, stop)


def turn_problems(
    placed: Sequence[str],
    bodies: Mapping[str, SampledBody],
    poses: Mapping[str, Float[np.ndarray, "4 4"]],
    table: Table,
    config: VerifyConfig,
) -> list[str]:
    """Return why the placed parts cannot stand on the table that they are turned onto: below it, or off it.

    Whether they topple or fall there is asked with what is held.
    """
    problems = []
    lowest, nearest = np.inf, 0.0
    for name in placed:
        tolerance = config.relative_tolerance * bodies[name].smallest_extent
        low = float((se3.apply(poses[name], bodies[name].vertices) @ table.normal).min()) - table.offset
        if low < -tolerance:
            problems.append(f"{name} is {-low * 1e3:.4g} mm below the table that the product is turned onto")
        if low < lowest:
            lowest, nearest = low, tolerance
    if lowest > nearest:
        problems.append(f"the product floats {lowest * 1e3:.4g} mm over the table that it is turned onto")
    return problems

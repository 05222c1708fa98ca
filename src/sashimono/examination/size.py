"""How large the product is, and whether its unit can be right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.assembly import size_words
from sashimono.examination.config import DoctorConfig
from sashimono.examination.findings import Finding
from sashimono.fasteners.recognise import Fastener
from sashimono.fasteners.sizes import shank_size
from sashimono.io.checks import is_likely, likely_units
from sashimono.io.raw import METRES


def size_and_unit(
    bounds: Float[np.ndarray, "2 3"], unit: str, *, stated: bool, config: DoctorConfig
) -> tuple[str, list[Finding]]:
    """Return the size in words, with what is to be thought of the unit, and a warning if that is implausible."""
    words, edges = size_words(bounds), bounds[1] - bounds[0]
    source = f"{unit}, as the file states" if stated else f"{unit}, as none is stated" if unit == "mm" else unit
    if is_likely(float(np.linalg.norm(edges)), config.reading, stated=stated):
        return f"{words}: plausible for {source}", []
    others = [
        f"{size_words(bounds * METRES[other] / METRES[unit])} in {other}"
        for other in likely_units(edges / METRES[unit], config.reading)
    ]
    hint = f"It would be {', or '.join(others)}." if others else "No common unit makes it a product."
    way_out = "Export it again in the right unit." if stated else "Give --unit."
    finding = Finding(
        kind="unit",
        severity="warning",
        parts=(),
        message=f"{words} is an unlikely size ({source}). {hint}",
        way_out=way_out,
    )
    return f"{words}: unlikely for {source}", [finding]


def metric_doubt(fasteners: Sequence[Fastener], unit: str, config: DoctorConfig) -> list[Finding]:
    """Return a warning if the screws have no metric sizes in this unit, but would have in another."""
    threaded = [each for each in fasteners if each.kind in ("screw", "bolt", "nut")]
    if len(threaded) < 3 or any(each.size for each in threaded):
        return []
    for other in ("mm", "m", "in", "cm"):
        factor = METRES[other] / METRES[unit]
        metric = sum(bool(shank_size(factor * each.diameter)) for each in threaded)
        if other != unit and metric >= config.metric_share * len(threaded):
            return [
                Finding(
                    kind="unit",
                    severity="warning",
                    parts=tuple(each.part for each in threaded),
                    message=f"no screw has a metric size in {unit}; in {other}, {metric} of {len(threaded)} would.",
                    way_out=f"Give --unit {other} if the file states no unit; else export it again.",
                )
            ]
    return []

"""Colours of the parts."""

from __future__ import annotations

from sashimono.assembly import Assembly
from sashimono.plan import AssemblyPlan

BASE_COLOR = "#bcc3cb"
"""The base part: neutral, so that what comes to it stands out."""
UNSOLVED_COLOR = "#d64550"
"""Parts without a step. The palette has nothing near it, nor near the orange of the moving part."""
PALETTE = (
    "#6f94bd", "#7fb3a5", "#c9b26b", "#9a8bbf", "#8aa868", "#b08d78", "#5f8f9c", "#c294ab",
    "#98a2b3", "#6d7fb3", "#b3b38a", "#7d9a8c",
)  # fmt: skip


def part_colors(plan: AssemblyPlan, assembly: Assembly) -> dict[str, str]:
    """Return the sRGB colour "#rrggbb" of each part; identical parts have the same one."""
    class_of = {name: names[0] for names in assembly.identical for name in names}
    colors: dict[str, str] = {}
    by_class: dict[str, str] = {}
    for k, name in enumerate(plan.placed):
        kind = class_of.get(name, name)
        if k == 0:
            colors[name] = BASE_COLOR
        else:
            colors[name] = by_class.setdefault(kind, PALETTE[len(by_class) % len(PALETTE)])
    return {name: colors.get(name, UNSOLVED_COLOR) for name in assembly.names}


def linear_rgb(color: str) -> tuple[float, float, float]:
    """Return the linear RGB values in [0, 1] of an sRGB colour "#rrggbb"."""
    values = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    r, g, b = (v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values)
    return r, g, b


def srgb_hex(rgb: tuple[float, float, float]) -> str:
    """Return linear RGB values in [0, 1] as an sRGB colour "#rrggbb"."""
    encoded = (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055 for v in rgb)
    return "#" + "".join(f"{round(255 * min(max(v, 0.0), 1.0)):02x}" for v in encoded)

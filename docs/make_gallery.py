"""Make the pictures of the gallery: products of D4PAS planned, checked, and drawn step by step.

python docs/make_gallery.py [FAMILY ...]      (needs the `dataset` and `render` extras)
"""

from __future__ import annotations

import sys
from pathlib import Path

import sashimono
from sashimono.d4pas import Blueprint, load
from sashimono.d4pas.recipe import ONLY
from sashimono.view.clip import ClipConfig, clip_steps, render_clip

IMAGES = Path(__file__).resolve().parent / "images"
FAMILIES = ("ball_valve", "gear_pump", "planetary", "toggle_clamp", "vise", "wheel_hub")
FEWEST, MOST = 5, 12
"""Parts of a product that is shown."""
CLIP = ClipConfig(width=420, height=300, frames=10, hold=3, per_second=10.0, quality=62)


def chosen(family: str) -> Blueprint:
    """Return the whole product of a family with the most parts that a small picture can show."""
    whole = [b for b in load("v1") if b.family == family and ONLY not in b.params and FEWEST <= len(b) <= MOST]
    return max(whole, key=len)


def main() -> int:
    """Plan, check and draw; return the exit status."""
    for family in sys.argv[1:] or FAMILIES:
        blueprint = chosen(family)
        assembly = blueprint.assembly()
        plan = sashimono.plan_assembly(assembly, seed=0)
        report = sashimono.verify_plan(plan, assembly)
        sys.stdout.write(f"{family}: {plan!r}, {'verified' if report.ok and report.complete else 'NOT verified'}\n")
        (IMAGES / f"gallery_{family}.webp").write_bytes(
            render_clip(plan, assembly, clip_steps(plan, assembly), config=CLIP)
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())

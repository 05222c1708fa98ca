"""The viewer inside a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass, field

from sashimono.assembly import Assembly, Source
from sashimono.plan import AssemblyPlan, Motion, Step
from sashimono.view.config import ViewConfig
from sashimono.view.html import SCRIPTS, render_html, render_page
from sashimono.view.scene import ViewerScene, make_scene


@dataclass(frozen=True, kw_only=True, eq=False)
class Page:
    """A page that a notebook shows in place."""

    content: str = field(repr=False)
    """The page as HTML; it needs no network."""
    height: int
    """Of the frame in the notebook [pixels]."""

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.content)}" width="100%" height="{self.height}" '
            'style="border: 0" allow="fullscreen"></iframe>'
        )


def show(assembly: Assembly, plan: AssemblyPlan | None = None, *, height: int = 520) -> Page:
    """Return the viewer page of a plan, or of an assembly alone, as a notebook shows it in place.

    Args:
        assembly: The geometry.
        plan: Its plan; without one, all parts stand in their assembled poses.
        height: Of the frame in the notebook [pixels].
    """
    if plan is not None:
        return Page(content=render_html(plan, assembly), height=height)
    scene = make_scene(_in_place(assembly), assembly, ViewConfig())
    scene = ViewerScene(json={**scene.json, "status": "in place"}, geometry=scene.geometry)
    return Page(content=render_page(scene, title="assembly", scripts=SCRIPTS), height=height)


def _in_place(assembly: Assembly) -> AssemblyPlan:
    """Return steps without motion: every part is there from the start."""
    names = assembly.names
    return AssemblyPlan(
        status="partial",
        source=assembly.source or Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in assembly.parts},
        order=names,
        steps=tuple(
            Step(
                part=part.name,
                fixed=names[:k],
                motion=Motion(T_world_part=part.T_world_part[None], segments=()),
                contact=None,
                contact_reason="shown in place",
            )
            for k, part in enumerate(assembly.parts)
        ),
        identical=assembly.identical,
        notes=assembly.notes,
    )

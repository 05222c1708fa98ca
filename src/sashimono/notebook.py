"""The viewer inside a notebook."""

from __future__ import annotations

import html
from dataclasses import dataclass, field
from pathlib import Path

from sashimono.assembly import Assembly, Source
from sashimono.exports import read_plan_and_input
from sashimono.plan import AssemblyPlan, Motion, Step
from sashimono.view.config import ViewConfig
from sashimono.view.glb import write_glb
from sashimono.view.html import SCRIPTS, render_html, render_page, write_html
from sashimono.view.manual import write_manual
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


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadedPlan:
    """A plan together with the geometry of its parts. A notebook shows it in 3D."""

    plan: AssemblyPlan
    assembly: Assembly

    def __repr__(self) -> str:
        return f"LoadedPlan({self.plan!r})"

    def _repr_html_(self) -> str:
        return show(self.assembly, self.plan)._repr_html_()

    @property
    def steps(self) -> tuple[Step, ...]:
        """The plan's steps, base part first."""
        return self.plan.steps

    def save_html(self, path: str | Path) -> Path:
        """Write the viewer page, and return its path; see `write_html`."""
        return write_html(self.plan, self.assembly, path)

    def save_glb(self, path: str | Path) -> Path:
        """Write the animated glTF file, and return its path; see `write_glb`."""
        return write_glb(self.plan, self.assembly, path)

    def save_manual(self, path: str | Path, *, language: str = "en") -> Path:
        """Write the work instructions as a page, and return its path; see `write_manual`."""
        return write_manual(self.plan, self.assembly, path, language=language)


def load_plan(path: str | Path, source: str | Path | None = None) -> LoadedPlan:
    """Return a plan.json and the geometry of its parts, read again from the plan's input.

    Args:
        path: The plan.json.
        source: The plan's input, where it has moved.

    Raises PlanFormatError for a broken plan, InputError where its input is missing, and SashimonoError where that has
    other parts.
    """
    plan, assembly = read_plan_and_input(Path(path), None if source is None else Path(source))
    return LoadedPlan(plan=plan, assembly=assembly)

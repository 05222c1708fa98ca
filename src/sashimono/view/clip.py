"""A moving picture of a step's way in, drawn without a GPU: animated WebP."""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, UInt8

from sashimono.assembly import Assembly
from sashimono.errors import SashimonoError
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan
from sashimono.view.appearance import linear_rgb, part_colors
from sashimono.view.config import ViewConfig
from sashimono.view.lookout import step_lookouts
from sashimono.view.manual.drawing import Solid, draw_picture, fit_view
from sashimono.view.playback import UP, PlayedStep, played_steps

if TYPE_CHECKING:
    from PIL.Image import Image

MOVING = "#f07d1a"
"""What comes; nothing else is orange."""
PLACED = "#d3d8de"
"""What stands, before its own colour is mixed in."""


@dataclass(frozen=True, kw_only=True)
class ClipConfig:
    """How a clip is made."""

    width: int = 640
    height: int = 420
    frames: int = 28
    """Of a step's way in."""
    hold: int = 8
    """Frames before and after it."""
    per_second: float = 14.0
    supersample: int = 2
    """Pixels drawn for each one of the image, along each side."""
    quality: int = 80
    """Of the WebP."""


def clip_steps(plan: AssemblyPlan, assembly: Assembly, wanted: str | None = None) -> tuple[PlayedStep, ...]:
    """Return the played steps that move: all, or the one with this number ("3", or "3.1" inside a subassembly).

    Raises SashimonoError for a number that no step has, or whose step moves nothing.
    """
    moving = tuple(entry for entry in played_steps(plan, assembly, ViewConfig()) if entry.step.moves)
    if wanted is None:
        moving = tuple(entry for entry in moving if not entry.waits)  # shown with those that it waits for
        if not moving:
            raise SashimonoError("no step of this plan moves anything. There is nothing to show.")
        return moving
    found = tuple(entry for entry in moving if entry.label == wanted)
    if not found:
        known = ", ".join(entry.label for entry in moving)
        raise SashimonoError(f"--step {wanted}: no step that moves. Choose one of: {known}.")
    return found


def render_clip(
    plan: AssemblyPlan,
    assembly: Assembly,
    steps: Sequence[PlayedStep],
    *,
    config: ClipConfig | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> bytes:
    """Return an animated WebP of the ways in of played steps (see `clip_steps`), one after the other.

    Each is seen from where it is best seen, what would hide it as glass; what comes is orange. Raises SashimonoError
    if Pillow is missing.
    """
    config = config or ClipConfig()
    try:
        from PIL import Image
    except ImportError:
        raise SashimonoError("clips need Pillow; install the extra: pip install 'sashimono[render]'") from None
    images: list[Image] = []
    total = len(steps) * config.frames
    for number, frame in enumerate(_frames(plan, assembly, steps, config)):
        images.append(Image.fromarray(frame))
        if progress is not None:
            progress(number + 1, total)
    millisecond = 1e3 / config.per_second
    durations = []
    for _ in steps:
        own = [millisecond] * config.frames
        own[0] = own[-1] = (1 + config.hold) * millisecond
        durations += [round(value) for value in own]
    out = io.BytesIO()
    images[0].save(
        out,
        "WEBP",
        save_all=True,
        append_images=images[1:],
        duration=durations,
        loop=0,
        quality=config.quality,
        method=4,
    )
    return out.getvalue()


def _frames(
    plan: AssemblyPlan, assembly: Assembly, steps: Sequence[PlayedStep], config: ClipConfig
) -> Iterator[UInt8[np.ndarray, "row column 3"]]:
    colors = {name: np.array(linear_rgb(color)) for name, color in part_colors(plan, assembly).items()}
    up = np.array(UP) if plan.table is None else plan.table.normal / np.linalg.norm(plan.table.normal)
    orange, grey = np.array(linear_rgb(MOVING)), np.array(linear_rgb(PLACED))

    def solid(name: str, T: Float[np.ndarray, "4 4"], color: np.ndarray, glass: bool = False) -> Solid:
        part = assembly.part(name)
        points = se3.apply(T @ plan.parts[name], part.vertices_part)
        return Solid(points=points, faces=part.faces, color=color, glass=glass)

    every: dict[str, PlayedStep] = {}
    if any(entry.step.simultaneous for entry in steps):
        every = {entry.step.part: entry for entry in played_steps(plan, assembly, ViewConfig()) if entry.step.moves}
    for entry, lookout in zip(steps, step_lookouts(plan, steps, assembly), strict=True):
        assert lookout is not None, "each of the steps moves"
        # a subassembly is put together on a bench: where its world frame is shown
        T_page = entry.poses[-1] @ se3.inverse(plan.parts[entry.step.part])
        fixed = [
            solid(name, T_page, 0.72 * grey + 0.28 * colors[name], name in lookout.hiding) for name in entry.step.fixed
        ]
        together = (entry, *(every[name] for name in entry.step.simultaneous if name in every))
        ways = [(each, se3.inverse(plan.parts[each.step.part]), _way(each, config.frames)) for each in together]
        frames = [
            [solid(name, poses[k] @ back, orange) for each, back, poses in ways for name in each.step.members]
            for k in range(config.frames)
        ]
        ends = (*frames[0], *frames[-1])
        R = _look_toward(lookout.toward, up)
        shown = np.concatenate([each.points for each in (*fixed, *ends)])
        view = fit_view(shown, R, config.width, config.height)
        for moving in frames:
            yield draw_picture([*fixed, *moving], view, times=config.supersample)


def _way(entry: PlayedStep, count: int) -> list[Float[np.ndarray, "4 4"]]:
    """Poses along the way in, evenly by travel and turn; along all of the motion where there is no way in."""
    starts = [segment.start for segment in entry.segments if segment.kind == "insertion"]
    poses = entry.poses[min(starts, default=0) :]
    twists = [se3.log(se3.inverse(a) @ b) for a, b in itertools.pairwise(poses)]
    size = max(float(np.linalg.norm(poses[0][:3, 3] - poses[-1][:3, 3])), 1e-6)
    lengths = np.array([np.linalg.norm(t[:3]) + 0.2 * size * np.linalg.norm(t[3:]) for t in twists])
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    out = []
    for at in np.linspace(0.0, along[-1], count):
        k = int(np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(twists) - 1))
        share = 0.0 if lengths[k] <= 0.0 else float(np.clip((at - along[k]) / lengths[k], 0.0, 1.0))
        out.append(poses[k] @ se3.exp(share * twists[k]))
    return out


def _look_toward(toward: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rows right, up, towards the viewer."""
    right = np.cross(up, toward)
    right = right / np.linalg.norm(right)
    return np.array([right, np.cross(toward, right), toward])

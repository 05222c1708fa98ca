"""A plan as the viewer page reads it: one JSON value and one block of bytes with the geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part, Source
from sashimono.plan import AssemblyPlan, Contact
from sashimono.view.appearance import BASE_COLOR, part_colors, srgb_hex
from sashimono.view.config import ViewConfig
from sashimono.view.display_mesh import DisplayMesh
from sashimono.view.explode import explode
from sashimono.view.lookout import Lookout, step_lookouts
from sashimono.view.playback import UP, PlayedStep, played_steps
from sashimono.view.shapes import ShapeUse, make_shapes
from sashimono.view.timeline import StepTiming, make_timeline
from sashimono.view.words import ENGLISH, way_words


@dataclass(frozen=True, kw_only=True)
class ViewerScene:
    """What the page shows."""

    json: Mapping[str, Any]
    """Plain values only, every number finite; poses are the upper three rows, row by row."""
    geometry: bytes
    """Positions, normals and indices, at the offsets that ``json["shapes"]`` gives."""


def pack_octahedral(normals: Float[np.ndarray, "n 3"]) -> np.ndarray:
    """Return unit vectors as two int16 each (Cigolle et al. 2014, *Independent unit vectors*)."""
    flat = normals / np.abs(normals).sum(axis=1, keepdims=True)
    xy = flat[:, :2]
    signs = np.where(xy >= 0.0, 1.0, -1.0)
    folded = np.where(flat[:, 2:] < 0.0, (1.0 - np.abs(xy[:, ::-1])) * signs, xy)
    return np.rint(folded * 32767.0).astype("<i2")


class Packer:
    """Appends arrays to one block of bytes, each at a multiple of 4."""

    def __init__(self) -> None:
        self._blocks: list[bytes] = []
        self._size = 0

    def add(self, array: np.ndarray) -> int:
        """Append the array and return its offset [bytes]."""
        offset = self._size
        data = array.tobytes()
        data += b"\0" * (-len(data) % 4)
        self._blocks.append(data)
        self._size += len(data)
        return offset

    def content(self) -> bytes:
        """Return the whole block."""
        return b"".join(self._blocks)


def pack_mesh(mesh: DisplayMesh, packer: Packer) -> dict[str, Any]:
    """Return where the packed mesh is and how it is to be read."""
    lower = mesh.positions.min(axis=0)
    cell = np.maximum(np.ptp(mesh.positions, axis=0), 1e-12) / 65535.0
    wide = len(mesh.positions) > 65536
    index_type = "<u4" if wide else "<u2"
    return {
        "vertices": len(mesh.positions),
        "faces": len(mesh.faces),
        "edges": len(mesh.edges),
        "wide": wide,
        "origin": lower.tolist(),
        "cell": cell.tolist(),
        "positionAt": packer.add(np.rint((mesh.positions - lower) / cell).astype("<u2")),
        "normalAt": packer.add(pack_octahedral(mesh.normals)),
        "faceAt": packer.add(mesh.faces.astype(index_type)),
        "edgeAt": packer.add(mesh.edges.astype(index_type)),
    }


def pose_rows(T: Float[np.ndarray, "4 4"]) -> list[float]:
    """Return the upper three rows, row by row."""
    return T[:3].reshape(-1).tolist()


def still_product(source: Source | None, parts: tuple[Part, ...], config: ViewConfig, packer: Packer) -> dict[str, Any]:
    """Return what a page needs to show parts where they are assembled, grey, without a table and steps."""
    shapes = make_shapes(parts, config)
    return {
        "title": "assembly" if source is None else PurePath(source.path.replace("\\", "/")).name,
        "up": list(UP),
        "table": None,
        "steps": [],
        "shapes": [pack_mesh(mesh, packer) for mesh in shapes.meshes],
        "parts": [
            {
                "name": part.name,
                "shape": use.shape,
                "shapePose": pose_rows(use.T_part_shape),
                "assembled": pose_rows(part.T_world_part),
                "color": BASE_COLOR,
            }
            for part, use in zip(parts, shapes.uses, strict=True)
        ],
    }


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _contact(contact: Contact, pose_times: Float[np.ndarray, "pose"]) -> dict[str, Any]:
    """Describe a contact; ``pose_times`` are those of the motion's own poses."""
    details, last = contact.details, len(pose_times) - 1
    when = np.interp([details.get("from_pose", 0.0), details.get("to_pose", last)], np.arange(last + 1), pose_times)
    supports = details.get("supports", {})
    return {
        "kind": contact.kind,
        "from": float(when[0]),
        "to": float(when[1]),
        "tipRadius": _finite(details.get("fingertips", {}).get("radius")),
        "force": None if contact.force_part is None else contact.force_part.tolist(),
        "supports": {"points": supports.get("points_part", []), "forces": supports.get("forces_part", [])},
        "points": contact.points_part.tolist(),
        "normals": contact.normals_part.tolist(),
        "quality": _finite(contact.quality),
        "gripper": None if contact.T_part_gripper is None else pose_rows(contact.T_part_gripper),
    }


def _step(
    played: PlayedStep, timing: StepTiming, lookout: Lookout | None, up: Float[np.ndarray, "3"], assembly: Assembly
) -> dict[str, Any]:
    step = played.step
    evidence = step.motion.evidence
    turned = played.poses[-1][:3, :3] @ assembly.part(step.part).T_world_part[:3, :3].T
    own_times = timing.pose_times[-len(step.motion.T_world_part) :]
    return {
        "part": assembly.index(step.part),
        "moving": [assembly.index(name) for name in step.members],
        "product": step.product,
        "label": played.label,
        "depth": played.depth,
        "fixed": len(step.fixed),
        "start": timing.start,
        "stop": timing.stop,
        "times": timing.pose_times.tolist(),
        "poses": [pose_rows(T) for T in played.poses],
        "segments": [{"kind": s.kind, "start": s.start, "stop": s.stop} for s in played.segments],
        "declaredPitch": None if step.declared is None else _finite(step.declared.pitch),
        "contact": None if step.contact is None else _contact(step.contact, own_times),
        "carry": None if step.carry is None else _contact(step.carry, own_times),
        "contactReason": step.contact_reason,
        "simultaneous": list(step.simultaneous),
        "held": list(step.held),
        "closeFits": [*dict.fromkeys(fit.other for fit in step.close_fits)],
        "turns": played.turns,
        "tool": None if step.tool is None else step.tool.name,
        "toolBlocked": None if step.tool is None else step.tool.reason,
        # on a bench what is up may be turned
        "way": way_words(step.insertion, turned.T @ up, ENGLISH) if step.insertion else "",
        "look": None if lookout is None else lookout.toward.tolist(),
        "hiding": [] if lookout is None else [assembly.index(name) for name in lookout.hiding],
        "penetration": _finite(evidence.get("max_penetration")),
        "tolerance": _finite(evidence.get("tolerance")),
    }


def _parts(
    plan: AssemblyPlan, assembly: Assembly, played: Sequence[PlayedStep], uses: tuple[ShapeUse, ...], config: ViewConfig
) -> list[dict[str, Any]]:
    colors = part_colors(plan, assembly)
    explosion = explode(plan, assembly, config)
    # the whole stands as it was last turned
    turns = [entry for entry in played if entry.turns and entry.depth == 0]
    turned = np.eye(3)
    if turns:
        turned = turns[-1].poses[-1][:3, :3] @ plan.parts[turns[-1].step.part][:3, :3].T
    solved = set(plan.placed)
    return [
        {
            "name": part.name,
            "shape": use.shape,
            "shapePose": pose_rows(use.T_part_shape),
            "assembled": pose_rows(plan.parts[part.name]),
            "color": colors[part.name],
            "cadColor": None if part.color is None else srgb_hex(part.color),
            "explode": [{"turn": p.turn, "by": (turned @ p.vector).tolist()} for p in explosion.pulls[part.name]],
            "solved": part.name in solved,
        }
        for part, use in zip(assembly.parts, uses, strict=True)
    ]


def _unsolved(plan: AssemblyPlan, assembly: Assembly) -> list[dict[str, Any]]:
    stated = {item.part: item for item in plan.unsolved}
    solved = set(plan.placed)
    rows = []
    for k, name in enumerate(assembly.names):
        if name in solved:
            continue
        item = stated.get(name)
        rows.append(
            {
                "part": k,
                "answer": str(item.answer) if item else "UNKNOWN",
                "provenFor": str(item.proven_for) if item and item.proven_for else None,
                "blockedBy": list(item.blocked_by) if item else [],
                "reason": item.reason if item else "the plan says nothing about this part",
            }
        )
    return rows


def make_scene(plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> ViewerScene:
    """Return the plan and its geometry, ready to be put into the page."""
    shapes = make_shapes(assembly.parts, config)
    played = played_steps(plan, assembly, config)
    timeline = make_timeline(plan, played, assembly, config)
    packer = Packer()
    notes = [*assembly.notes, *(note for note in plan.notes if note not in assembly.notes)]
    notes += [f"Fit declared: {' and '.join(fit.parts)}, {fit.kind}; {fit.reason}" for fit in plan.fits]
    if shapes.decimated:
        notes.append("Meshes are simplified in this view; the plan was made with the full ones.")
    up = np.array(UP) if plan.table is None else plan.table.normal / np.linalg.norm(plan.table.normal)
    json = {
        "title": PurePath(plan.source.path.replace("\\", "/")).name or "assembly",
        "status": plan.status,
        "verdict": plan.verdict,
        "version": plan.version,
        "up": list(UP) if plan.table is None else plan.table.normal.tolist(),
        "table": None if plan.table is None else plan.table.offset,
        "duration": timeline.duration,
        "shapes": [pack_mesh(mesh, packer) for mesh in shapes.meshes],
        "parts": _parts(plan, assembly, played, shapes.uses, config),
        "steps": [
            _step(step, timing, lookout, up, assembly)
            for step, timing, lookout in zip(played, timeline.steps, step_lookouts(plan, played, assembly), strict=True)
        ],
        "unsolved": _unsolved(plan, assembly),
        "notes": notes,
    }
    return ViewerScene(json=json, geometry=packer.content())

"""Parts that are several solids in one mesh: whether they are one thing or several."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from sashimono.assembly import Part
from sashimono.geometry.mesh import measures, topology
from sashimono.io.names import unique_names
from sashimono.io.raw import ReadConfig


def split_parts(
    parts: Sequence[Part], *, config: ReadConfig, whole: Collection[str] = ()
) -> tuple[list[Part], list[str], list[str]]:
    """Return the parts, those of several solids taken apart as ``config.split`` says, the name of the part that each
    was in before, and notes on them.

    The solids of ``name`` become ``name_1``, ``name_2``, ... in its place, the largest first, cavities with the solid
    around them, all in the frame of the part. Those named in ``whole`` stay as they are.
    """
    out: list[tuple[str, list[Part]]] = []
    notes = []
    for part in parts:
        pieces = [part.faces]
        if part.name not in whole and topology.shells(part.faces).max() > 0:
            pieces = _pieces(part, config)
            notes.append(_note(part, pieces, config))
        out.append((part.name, [_piece(part, faces) for faces in pieces] if len(pieces) > 1 else [part]))
    names = unique_names([name for name, members in out for _ in members])
    flat = [piece for _, members in out for piece in members]
    split = [replace(piece, name=name) for name, piece in zip(names, flat, strict=True)]
    return split, [name for name, members in out for _ in members], [note for note in notes if note]


def _pieces(part: Part, config: ReadConfig) -> list[Int[np.ndarray, "_ 3"]]:
    if config.split == "none":
        return [part.faces]
    take_apart = topology.split_solids if config.split == "all" else topology.split_apart
    pieces = take_apart(part.vertices_part, part.faces)
    volumes = np.array([measures.volume(part.vertices_part[np.unique(faces)], _renumbered(faces)) for faces in pieces])
    return [pieces[k] for k in np.argsort(-np.round(volumes / volumes.max(), 9), kind="stable")]


def _note(part: Part, pieces: Sequence[Int[np.ndarray, "_ 3"]], config: ReadConfig) -> str:
    if len(pieces) > 1:
        apart = "lie apart" if config.split == "auto" else "are separate"
        return f"{part.name}: {len(pieces)} solids that {apart}; each was taken as a part (--split none: as one)"
    count = len(topology.split_solids(part.vertices_part, part.faces))
    if count < 2:
        return ""
    return f"{part.name}: {count} separate bodies, kept together as one rigid part (--split all: as {count} parts)"


def _piece(part: Part, faces: Int[np.ndarray, "_ 3"]) -> Part:
    return replace(part, vertices_part=part.vertices_part[np.unique(faces)], faces=_renumbered(faces))


def _renumbered(faces: Int[np.ndarray, "_ 3"]) -> Int[np.ndarray, "_ 3"]:
    return np.unique(faces, return_inverse=True)[1].reshape(-1, 3)

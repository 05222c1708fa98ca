"""Resting poses from a file: of their own form, or those of a plan."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.plan import RestingPoses, Table


def read_resting_poses(path: str | Path) -> RestingPoses:
    """Return the resting poses in a JSON file, world frame, metres.

    ``{"table": {"normal": [x, y, z], "offset": d}, "parts": {name: T_world_part, ...}}`` with 4x4 matrices, row by row;
    or a plan.json: the resting poses of its top level. InputError, naming file and field, for anything else.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON: {error}") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: not one JSON object with a table and parts.")
    poses = document.get("parts")
    if isinstance(document.get("steps"), list):
        poses = {step["part"]: step["path"]["T_world_part"][0] for step in document["steps"] if _moves(step)}
    if not isinstance(poses, dict) or not poses:
        raise InputError(f"{path}: parts is missing or empty. Give the pose of each part by its name.")
    return RestingPoses(
        table=_table(document.get("table"), path), poses={name: _pose(poses[name], name, path) for name in poses}
    )


def _moves(step: Any) -> bool:
    try:
        return len(step["path"]["T_world_part"]) > 1 and isinstance(step["part"], str)
    except (KeyError, TypeError):
        return False


def _table(entry: Any, path: Path) -> Table:
    try:
        normal, offset = np.array(entry["normal"], dtype=np.float64), float(entry["offset"])
    except (KeyError, TypeError, ValueError):
        raise InputError(f'{path}: table is missing. Give {{"normal": [x, y, z], "offset": d}}.') from None
    if normal.shape != (3,) or not abs(np.linalg.norm(normal) - 1.0) < 1e-6 or not np.isfinite(offset):
        raise InputError(f"{path}: the table's normal is no unit vector, or its offset no number.")
    return Table(normal=normal / np.linalg.norm(normal), offset=offset)


def _pose(entry: Any, name: str, path: Path) -> np.ndarray:
    try:
        T = np.array(entry, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.zeros(0)
    if T.shape != (4, 4) or not np.isfinite(T).all() or not se3.is_pose(T):
        raise InputError(f"{path}: the pose of {name} is no rigid 4x4 matrix.")
    return T

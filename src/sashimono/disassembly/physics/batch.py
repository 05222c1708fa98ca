"""Many pushes simulated at once, on a GPU or the processor (NVIDIA Warp; the ``gpu`` extra).

The contact model is that of `simulate`, stepped in time instead of followed from event to event: every step, the
samples of the moving and of the fixed parts find the contacts, and the push is projected onto what they let happen.
Thousands of attempts take each step together. It runs in single precision and decides nothing: every path that it
returns has been cut to what the exact check passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.push import SimulateConfig, Simulated
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.errors import SashimonoError
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import between

if TYPE_CHECKING:
    import warp as wp


@dataclass(frozen=True, kw_only=True)
class BatchConfig:
    """Steps and contact model of the stepped simulation; lengths over the smaller part's smallest extent."""

    contact: SimulateConfig = field(default_factory=SimulateConfig)
    """Friction, gap, facing and rest, as in the simulation from event to event, which is the oracle of this one."""
    stride: float = 0.05
    """Way of a part's far points in one step, unhindered."""
    slack: float = 0.002
    """Depth at which a contact bears."""
    steps: int = 400
    """Steps of one push."""
    iterations: int = 12
    """Rounds of the contact solver in each step."""
    samples: int = 256
    """Points taken from each part's surface."""
    max_contacts: int = 256
    """Contacts of one attempt that the solver takes, evenly chosen where there are more."""
    batch: int = 4096
    """Attempts side by side; changes memory and time only."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Push:
    """One attempt: a part pushed from a displacement among others."""

    part: int
    others: tuple[int, ...]
    displacement: Float[np.ndarray, "4 4"]
    """From the assembled pose, world frame."""
    wrench: Float[np.ndarray, "6"]
    """(force, torque) about the part's centre, world frame, lengths over its radius, of unit size."""


class BatchSimulator:
    """Simulates pushes of one assembly's parts; the parts' surfaces are put on the device once."""

    def __init__(self, parts: PlacedParts, *, config: BatchConfig, device: str | None = None) -> None:
        """Put the parts on a Warp device: ``"cuda:0"``, ``"cpu"``; the first GPU, else the processor, if None.

        SashimonoError if Warp is not installed or has no such device.
        """
        wp = self._wp = _warp()
        self.device = find_device(device)
        self.parts, self.config = parts, config
        self._scale = 1.0 / float(
            np.ptp(np.concatenate([part.bounds_world for part in parts.assembly.parts]), axis=0).max()
        )
        self._meshes = [self._mesh(body.vertices, body.faces) for body in parts.bodies]
        picks = [np.linspace(0, len(b.samples) - 1, config.samples).astype(int) for b in parts.bodies]
        samples = [b.samples[p] * self._scale for b, p in zip(parts.bodies, picks, strict=True)]
        normals = [b.sample_normals[p] for b, p in zip(parts.bodies, picks, strict=True)]
        self._samples = self._array(samples, wp.vec3)
        self._normals = self._array(normals, wp.vec3)
        self._ids = wp.array([mesh.id for mesh in self._meshes], dtype=wp.uint64, device=self.device)
        self._assembled = self._transforms(parts.poses)
        self._centers = self._array([b.center * self._scale for b in parts.bodies], wp.vec3)
        self._radii = self._array([b.radius * self._scale for b in parts.bodies], float)
        self._sizes = self._array(parts.sizes * self._scale, float)
        self._overlaps = self._array(parts.overlaps * self._scale, float)

    def simulate(self, pushes: Sequence[Push]) -> list[Simulated]:
        """Return where each push leads: the checked part of its path, and the way out if it found one."""
        out: list[Simulated] = []
        for start in range(0, len(pushes), self.config.batch):
            some = pushes[start : start + self.config.batch]
            histories = self._run(some)
            out += [self._checked(push, poses) for push, poses in zip(some, histories, strict=True)]
        return out

    def _run(self, pushes: Sequence[Push]) -> list[list[np.ndarray]]:
        """The displacements that each push passes through, its start first; unchecked."""
        from sashimono.disassembly.physics.batch_kernels import advance, find_contacts

        wp, config, parts = self._wp, self.config, self.parts
        count, widest = len(pushes), max((len(push.others) for push in pushes), default=0)
        others = np.full((count, max(1, widest)), -1, np.int32)
        low, high = np.zeros((count, 3)), np.zeros((count, 3))
        for k, push in enumerate(pushes):
            others[k, : len(push.others)] = push.others
            boxes = np.array([parts.assembly.parts[other].bounds_world for other in push.others]).reshape(-1, 2, 3)
            center = parts.bodies[push.part].center_world(push.displacement @ parts.poses[push.part])
            low[k], high[k] = (boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)) if len(boxes) else (center, center)
        slots = config.samples * (others.shape[1] + 1)
        moving = self._array([push.part for push in pushes], int)
        displacement = self._transforms([push.displacement for push in pushes])
        push_v = self._array([push.wrench[:3] for push in pushes], wp.vec3)
        push_w = self._array([push.wrench[3:] for push in pushes], wp.vec3)
        done, steps = (wp.zeros(count, dtype=int, device=self.device) for _ in range(2))
        history = wp.zeros((count, config.steps + 1), dtype=wp.transform, device=self.device)
        gaps = wp.zeros((count, slots), dtype=float, device=self.device)
        normals, arms = (wp.zeros((count, slots), dtype=wp.vec3, device=self.device) for _ in range(2))
        contacts = wp.zeros((count, config.max_contacts), dtype=int, device=self.device)
        impulses = wp.zeros((count, config.max_contacts), dtype=wp.vec3, device=self.device)
        around = [self._array(corner * self._scale, wp.vec3) for corner in (low, high)]
        others_device = wp.array(others, dtype=int, device=self.device)
        for step in range(config.steps):
            wp.launch(
                find_contacts, dim=(count, slots), device=self.device,
                inputs=[moving, others_device, displacement, done, self._assembled, self._ids, self._centers,
                        self._sizes, self._overlaps, self._samples, self._normals, config.contact.gap,
                        config.contact.slippage.facing],
                outputs=[gaps, normals, arms],
            )  # fmt: skip
            wp.launch(
                advance, dim=count, device=self.device,
                inputs=[step, moving, push_v, push_w, self._assembled, self._centers, self._radii, self._sizes,
                        *around, config.stride, config.slack, config.contact.friction, config.contact.rest,
                        config.iterations, gaps, normals, arms, contacts, impulses],
                outputs=[displacement, done, steps, history],
            )  # fmt: skip
            if step % 32 == 31 and bool((done.numpy() != 0).all()):
                break
        return [
            [push.displacement, *(self._matrix(row) for row in rows[1 : last + 1])]
            for push, rows, last in zip(pushes, history.numpy(), steps.numpy(), strict=True)
        ]

    def _checked(self, push: Push, poses: list[np.ndarray]) -> Simulated:
        """The path in as few geodesics as pass the exact check, up to where none does; and out, where a straight
        exit along the last motion is free."""
        paths = Paths(self.parts, push.part, push.others, tolerance=self.parts.tolerances.turning)
        kept, at, reach = [poses[0]], 0, 1
        while at < len(poses) - 1:
            end = _exit(paths, kept[-1], poses[at + 1])
            if end is not None:
                direction, last = end
                return Simulated(
                    displacements=np.array([*kept, last]), exit_direction=direction, met=(), stretches=len(kept)
                )
            stop = min(at + reach, len(poses) - 1)
            if paths.advance(kept[-1], between(kept[-1], poses[stop]))[1] is None:
                kept.append(poses[stop])
                at, reach = stop, min(2 * reach, 32)
            elif reach > 1:
                reach = max(1, (stop - at) // 2)
            else:
                break
        _, stopper = paths.advance(kept[-1], between(kept[-1], poses[min(at + 1, len(poses) - 1)]))
        met = () if stopper is None else (stopper,)
        return Simulated(displacements=np.array(kept), exit_direction=None, met=met, stretches=len(kept) - 1)

    def _mesh(self, vertices: Float[np.ndarray, "vertex 3"], faces: np.ndarray) -> wp.Mesh:
        wp = self._wp
        points = wp.array((vertices * self._scale).astype(np.float32), dtype=wp.vec3, device=self.device)
        return wp.Mesh(points, wp.array(faces.astype(np.int32).reshape(-1), dtype=int, device=self.device))

    def _array(self, values: object, dtype: type) -> wp.array:
        kind = np.int32 if dtype is int else np.float32
        return self._wp.array(np.asarray(values, dtype=kind), dtype=dtype, device=self.device)

    def _transforms(self, poses: Sequence[Float[np.ndarray, "4 4"]]) -> wp.array:
        rows = [[*(T[:3, 3] * self._scale), *Rotation.from_matrix(T[:3, :3]).as_quat()] for T in poses]
        return self._array(rows, self._wp.transform)

    def _matrix(self, row: Float[np.ndarray, "7"]) -> Float[np.ndarray, "4 4"]:
        row = row.astype(np.float64)
        return se3.make(Rotation.from_quat(row[3:]).as_matrix(), row[:3] / self._scale)


def find_device(name: str | None) -> wp.Device:
    """Return a device of Warp by its name; the first GPU, else the processor, if None.

    SashimonoError if Warp is not installed or has no such device.
    """
    warp = _warp()
    try:
        return warp.get_device(name)
    except (RuntimeError, ValueError) as error:
        names = ", ".join(str(device) for device in warp.get_devices())
        raise SashimonoError(f"Warp has no device {name!r}: it has {names}") from error


def _exit(
    paths: Paths, D: Float[np.ndarray, "4 4"], D_next: Float[np.ndarray, "4 4"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4 4"]] | None:
    """A straight way out from D, along the present shift of the part's centre or the axis of its turn, and its end."""
    shift = se3.apply(D_next, paths.center[None])[0] - se3.apply(D, paths.center[None])[0]
    turn = between(D, D_next)[3:] * paths.body.radius
    ways = [shift] if np.linalg.norm(shift) > np.linalg.norm(turn) else [turn, -turn]
    lines = paths.parts.lines
    for way in ways:
        length = float(np.linalg.norm(way))
        if length < 1e-6 * paths.size:
            continue
        near = lines[int(np.argmax(np.abs(lines @ way)))]
        for direction in (near * np.sign(near @ way), way / length):
            end = paths.exit(D, direction)
            if end is not None:
                return direction, end
    return None


def _warp():
    try:
        import warp
    except ImportError as error:
        raise SashimonoError("simulating on a GPU needs NVIDIA Warp: pip install 'sashimono[gpu]'") from error
    warp.config.log_level = warp.LOG_ERROR
    return warp

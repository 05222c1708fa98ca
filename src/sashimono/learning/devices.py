"""Where a run computes: device, precision, and the processes that share its batches."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import distributed

from sashimono.errors import SashimonoError


@dataclass(frozen=True, kw_only=True)
class Place:
    """One process of a run."""

    device: str
    rank: int = 0
    """Number of this process."""
    world: int = 1
    """Number of processes."""

    @property
    def is_first(self) -> bool:
        """Whether this process writes files."""
        return self.rank == 0

    def synchronize(self) -> None:
        """Wait until the device has done what it was asked."""
        if self.device.startswith("cuda"):
            torch.cuda.synchronize(self.device)

    def agreed(self, value: float) -> float:
        """Return the first process's value on all processes."""
        if self.world == 1:
            return value
        tensor = torch.tensor([value], dtype=torch.float64, device=self.device)
        distributed.broadcast(tensor, src=0)
        return float(tensor.item())

    def autocast(self, precision: str) -> torch.autocast:
        """Return the context that products are computed in."""
        kind = self.device.split(":")[0]
        return torch.autocast(kind, dtype=torch.bfloat16, enabled=kind == "cuda" and precision == "bf16")


def refuse_device(device: str | None) -> None:
    """Raise SashimonoError for a device that PyTorch does not know or does not have here."""
    try:
        if device is not None:
            torch.empty(0, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise SashimonoError(f"--device {device}: not to be had here ({reason}). Name cpu, cuda or cuda:0.") from error


@contextmanager
def find_place(device: str | None = None) -> Iterator[Place]:
    """Yield where this process computes: a GPU if there is one, its share of the batches if started by torchrun."""
    world, rank = int(os.environ.get("WORLD_SIZE", "1")), int(os.environ.get("RANK", "0"))
    local = int(os.environ.get("LOCAL_RANK", "0"))
    if device is None:
        device = f"cuda:{local}" if torch.cuda.is_available() else "cpu"
    if device.startswith("cuda"):
        torch.cuda.set_device(device)
        torch.backends.cuda.matmul.allow_tf32 = True
        torch.backends.cudnn.allow_tf32 = True
        torch.backends.cuda.enable_cudnn_sdp(False)  # plans each new shape anew, for seconds; ours vary by batch
    if world == 1:
        yield Place(device=device)
        return
    distributed.init_process_group("nccl" if device.startswith("cuda") else "gloo")
    try:
        yield Place(device=device, rank=rank, world=world)
    finally:
        gc.collect()  # a group that something still holds ends with the interpreter, and aborts it
        distributed.destroy_process_group()

"""Many items worked off by a few processes: results as they come, and a dead worker costs one item, not the run."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, TypeVar

from sashimono.errors import SashimonoError

Item = TypeVar("Item")

DIED = "the worker died, twice: out of memory, or a crash"
"""Why an item has no result."""


def run_items(
    items: Sequence[Item], work: Callable[[Item], dict[str, Any]], *, workers: int
) -> Iterator[tuple[Item, dict[str, Any] | None]]:
    """Yield (item, result) in the order in which they are done; the result is None where the worker died twice.

    ``work`` is a function at module level, or a partial of one. With one worker all is done in a process of its own
    too, so that a crash does not take the caller with it.
    """
    waiting = deque(items)
    suspects: list[Item] = []
    while waiting:
        yield from _until_broken(waiting, suspects, work, workers)
        for item in suspects:  # one of those under way killed its worker: each gets a second chance, alone
            alone: list[Item] = []
            done = list(_until_broken(deque([item]), alone, work, 1))
            yield done[0] if done else (item, None)
        suspects.clear()


def _until_broken(
    waiting: deque[Item], suspects: list[Item], work: Callable[[Item], dict[str, Any]], workers: int
) -> Iterator[tuple[Item, dict[str, Any] | None]]:
    context = multiprocessing.get_context("spawn")
    pending: dict[Future[dict[str, Any]], Item] = {}
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_follow_parent, initargs=(os.getpid(),))
    try:
        pool.submit(os.getpid).result()  # nothing that an item does
    except BrokenProcessPool as error:
        pool.shutdown(wait=False, cancel_futures=True)
        raise SashimonoError(
            "worker processes cannot start. A script calls this under: if __name__ == '__main__':"
        ) from error
    try:
        while waiting or pending:
            while waiting and len(pending) < 2 * workers:
                item = waiting.popleft()
                pending[pool.submit(work, item)] = item
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                item = pending.pop(future)
                yield item, future.result()
    except BrokenProcessPool:
        suspects += [item, *pending.values()]
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _follow_parent(parent: int) -> None:
    """Let this process be killed when its parent is (Linux), and leave interrupts to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)

"""Many items worked off by the machines of a Ray cluster: the same results as by processes of one machine."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from sashimono.d4pas.tables import package_versions
from sashimono.errors import InputError, SashimonoError

Work = Callable[[Any], dict[str, Any]]


def ray_runner(
    address: str, *, ahead: int = 2, tries: int = 2
) -> Callable[[Sequence[Any], Work], Iterator[tuple[Any, dict[str, Any] | None]]]:
    """Return what works items off on a Ray cluster, as `sashimono.d4pas.make.Runner`.

    It yields (item, result) in the order in which they are done. An item whose worker or machine dies is tried again;
    its result is None where that happens ``tries`` times. Machines may join and leave meanwhile. InputError if the
    cluster cannot be reached, or if a machine has other versions of the packages than this one.

    Args:
        address: "host:port" of the head as a machine of the cluster sees it, "ray://host:port" from outside, or "auto".
        ahead: Items under way or waiting in the cluster, for each of its processors.
        tries: How often an item is tried.
    """

    def run(items: Sequence[Any], work: Work) -> Iterator[tuple[Any, dict[str, Any] | None]]:
        ray = _require_ray()
        ours = not ray.is_initialized()
        if ours:
            _connect(ray, address)
        try:
            yield from _work_off(ray, items, work, ahead=ahead, tries=tries)
        finally:
            if ours:
                ray.shutdown()

    return run


def _work_off(
    ray: Any, items: Sequence[Any], work: Work, *, ahead: int, tries: int
) -> Iterator[tuple[Any, dict[str, Any] | None]]:
    # tries are counted here, because Ray would retry without end where memory runs out
    task = ray.remote(num_cpus=1, max_retries=0)(_call)
    shared, versions = ray.put(work), package_versions()
    waiting = deque((item, 1) for item in items)
    pending: dict[Any, tuple[Any, int]] = {}
    while waiting or pending:
        room = ahead * max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting and len(pending) < room:
            item, attempt = waiting.popleft()
            pending[task.remote(shared, item, versions)] = item, attempt
        done, _ = ray.wait(list(pending), num_returns=1, timeout=10.0)  # now and then: has a machine joined?
        for reference in done:
            item, attempt = pending.pop(reference)
            try:
                result = ray.get(reference)
            except ray.exceptions.RayTaskError as error:  # raised by the work itself
                raise error.cause from None
            except ray.exceptions.RayError:  # the worker or its machine died, or the result with it
                if attempt < tries:
                    waiting.appendleft((item, attempt + 1))
                else:
                    yield item, None
            else:
                yield item, result


def _call(work: Work, item: Any, versions: Mapping[str, str]) -> dict[str, Any]:
    """Work one item off, on a machine of the cluster."""
    here = _versions_here()
    other = [f"{name} {here[name]} instead of {version}" for name, version in versions.items() if here[name] != version]
    if other:
        raise InputError(
            f"{socket.gethostname()}: has {', '.join(other)}, which may give other results; install the same versions"
        )
    return work(item)


@cache
def _versions_here() -> dict[str, str]:
    return package_versions()


def _connect(ray: Any, address: str) -> None:
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        if port.isdecimal():  # Ray itself would go on trying for minutes
            socket.create_connection((host.strip("[]"), int(port)), timeout=10.0).close()
        ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    except (OSError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(
            f"no Ray cluster at {address} ({reason}); start one with 'ray start --head', and run this on one of its"
            " machines"
        ) from error


def _require_ray() -> Any:
    try:
        import ray  # pyright: ignore[reportMissingImports]
        import ray.exceptions  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise SashimonoError(
            "spreading work over a Ray cluster needs Ray; install the extra: pip install 'sashimono[distributed]'"
        ) from None
    return ray

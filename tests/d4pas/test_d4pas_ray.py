"""A Ray cluster gives the same dataset as one process, also when a worker is killed in the middle."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sashimono.d4pas.make import make_dataset
from sashimono.d4pas.ray_workers import ray_runner
from sashimono.errors import InputError

BOOK = """
name = "few"
max_sequences = 4
[families]
bolted_plates = 5
"""


def children(parent: int) -> dict[int, str]:
    """Return the command lines of a process's children."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(state[1]) == parent:
                found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:  # ended meanwhile
            continue
    return found


class Nodes:
    """A head with one processor, and a second node that joins, all on this machine."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        self.cluster = Cluster()

    def add(self) -> None:
        """Start a node's processes: the head's, then the second node's."""
        self.cluster.add_node(num_cpus=1, include_dashboard=False, object_store_memory=80 << 20)

    def busy(self) -> list[int]:
        """Return the workers that work on an item now."""
        nodes = [self.cluster.head_node, *self.cluster.worker_nodes]
        raylets = [node.all_processes["raylet"][0].process.pid for node in nodes if node]
        found = [item for raylet in raylets for item in children(raylet).items()]
        return [pid for pid, command in found if command.startswith("ray::_call")]


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    pytest.importorskip("ray", reason="the extra 'distributed' is not installed")
    if not Path("/proc/self/stat").exists():
        pytest.skip("finds a worker to kill in /proc")
    folder = tempfile.mkdtemp(prefix="d4")  # short: sockets are made below it
    patch = pytest.MonkeyPatch()
    patch.setenv("RAY_TMPDIR", folder)
    patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    nodes = Nodes()
    try:
        nodes.add()
        yield nodes
    finally:
        nodes.cluster.shutdown()
        patch.undo()
        shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.slow
def test_same_dataset_with_a_worker_killed_in_the_middle(nodes: Nodes, tmp_path: Path) -> None:
    book = tmp_path / "few.toml"
    book.write_text(BOOK)
    nodes.add()
    killed: list[int] = []

    def kill_one(done: int, total: int, failed: int) -> None:
        if done == 1 and not killed:
            end = time.monotonic() + 60.0
            while not (busy := nodes.busy()) and time.monotonic() < end:
                time.sleep(0.05)
            assert busy, "a worker is at work"
            os.kill(busy[0], signal.SIGKILL)
            killed.append(busy[0])

    spread = make_dataset(str(book), tmp_path / "ray", run=ray_runner(nodes.cluster.address), progress=kill_one)
    alone = make_dataset(str(book), tmp_path / "one", workers=1)
    assert killed
    assert spread == alone
    assert (spread.blueprints, spread.failures) == (5, 0)
    for name in ("blueprints", "sequences", "steps", "failures"):
        one, ray = (tmp_path / where / f"{name}.parquet" for where in ("one", "ray"))
        assert one.read_bytes() == ray.read_bytes(), name


@pytest.mark.slow
def test_an_item_that_kills_its_workers_has_no_result(nodes: Nodes, tmp_path: Path) -> None:
    tally = tmp_path / "tally"

    def work(item: str) -> dict[str, Any]:
        if item == "poison":
            with tally.open("a") as file:
                file.write("x")
            os._exit(1)
        return {"item": item}

    items = ["a", "poison", "b"]
    results = dict(ray_runner(nodes.cluster.address)(items, work))
    assert results == {"a": {"item": "a"}, "poison": None, "b": {"item": "b"}}
    assert tally.read_text() == "xxx"


@pytest.mark.slow
def test_what_the_work_raises_comes_back(nodes: Nodes) -> None:
    def work(item: str) -> dict[str, Any]:
        raise InputError(f"{item}: no such thing")

    with pytest.raises(InputError, match=r"^a: no such thing$"):
        list(ray_runner(nodes.cluster.address)(["a"], work))


def test_no_cluster_is_one_clear_line() -> None:
    pytest.importorskip("ray", reason="the extra 'distributed' is not installed")
    with pytest.raises(InputError, match=r"^no Ray cluster at 127\.0\.0\.1:1 \(") as caught:
        list(ray_runner("127.0.0.1:1")([], lambda item: item))
    assert "\n" not in str(caught.value)

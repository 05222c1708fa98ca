"""Jobs in the database: each is taken once, none is lost, what a kill leaves behind is put in order."""

import sqlite3
import threading

import pytest

from sashimono.serve.jobs import JobStore


@pytest.fixture
def store(tmp_path):
    made = JobStore(tmp_path / "jobs")
    yield made
    made.close()


def added(store, job, name="a.step"):
    (store.new_folder(job) / name).write_text("x")
    return store.add(job, name, {"hands": 1})


def test_many_threads_take_each_job_once(store):
    for k in range(50):
        added(store, f"{k:02}")
    taken = []

    def work():
        while job := store.take():
            taken.append(job.id)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == [f"{k:02}" for k in range(50)]
    assert {job.runs for job in store.newest()} == {1}


def test_what_a_kill_leaves_behind_is_put_in_order(tmp_path):
    store = JobStore(tmp_path / "jobs")
    for job in ("waits", "runs", "ended"):
        added(store, job)
    assert {store.take().id for _ in range(2)} == {"waits", "runs"}
    store.finish("waits", "failed", "no")
    (store.new_folder("half") / "a.step").write_text("x")
    orphan = store.folder_of("orphan")
    orphan.mkdir()
    store.close()
    again = JobStore(tmp_path / "jobs")
    try:
        assert again.recover() == 1
        assert {job.id: job.state for job in again.newest()} == {
            "waits": "failed",
            "runs": "waiting",
            "ended": "waiting",
        }
        assert not orphan.exists()
        assert list((tmp_path / "jobs" / "incoming").iterdir()) == []
        assert again.take().runs == 2
    finally:
        again.close()


def test_a_second_server_on_the_same_folder_is_refused(store):
    with pytest.raises(sqlite3.OperationalError, match="locked"):
        JobStore(store.folder)


def test_a_cancelled_job_is_not_finished_and_a_removed_one_leaves_nothing(store):
    added(store, "a")
    store.take()
    assert store.cancel("a")
    assert not store.finish("a", "complete", "too late")
    assert store.find("a").state == "cancelled"
    assert not store.cancel("a")
    store.remove("a")
    assert store.find("a") is None
    assert not store.folder_of("a").exists()

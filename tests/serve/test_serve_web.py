"""The web application as a browser and as an attacker would call it."""

import time

import pytest
from serve_blocks import END, two_blocks

from sashimono.serve import web
from sashimono.serve.jobs import JobStore
from sashimono.serve.limits import Limits
from sashimono.serve.web import make_web

pytest.importorskip("starlette")
pytest.importorskip("httpx2")
from starlette.testclient import TestClient


@pytest.fixture
def client(tmp_path):
    store = JobStore(tmp_path / "jobs")
    web = make_web(store, Limits(upload=100_000, seconds=60.0), hosts=["testserver"])
    with TestClient(web) as made:
        yield made
    store.close()


def wait_for(client, job, seconds=90.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = client.get(f"/api/jobs/{job}").json()
        if found["state"] in END:
            return found
        time.sleep(0.1)
    pytest.fail(f"still {found['state']} after {seconds} s: {found}")


def send(client, content, name="two.zip", **options):
    return client.post("/api/jobs", params={"name": name, **options}, content=content)


def test_a_file_is_planned_again_with_a_wish_and_removed(client, tmp_path):
    made = send(client, two_blocks(), options='{"unit": "mm"}')
    assert made.status_code == 201
    job = made.json()["id"]
    found = wait_for(client, job)
    assert (found["state"], found["runs"]) == ("complete", 1), found
    assert set(found["files"]) == {"plan.json", "plan.html", "plan.glb", "manual.html"}
    page = client.get(f"/jobs/{job}/plan.html")
    assert page.status_code == 200
    assert "sandbox" in page.headers["content-security-policy"]
    again = client.post(f"/api/jobs/{job}/again", json={"unit": "mm", "constraints": 'base = "upper"'})
    second = wait_for(client, again.json()["id"])
    assert second["state"] == "complete", second
    assert client.get(f"/jobs/{second['id']}/plan.json").json()["order"][0] == "upper"
    assert 'base = "upper"' in client.get(f"/api/jobs/{second['id']}/constraints").text
    assert client.delete(f"/api/jobs/{job}").status_code == 200
    assert client.get(f"/api/jobs/{job}").status_code == 404
    assert client.get(f"/jobs/{second['id']}/plan.json").status_code == 200, "its file is its own"


def test_a_file_that_cannot_be_read_fails_with_its_line_and_no_path(client, tmp_path):
    found = wait_for(client, send(client, b"not a STEP file", name="x.step").json()["id"])
    assert found["state"] == "failed"
    assert found["message"]
    assert "\n" not in found["message"]
    assert str(tmp_path) not in found["message"]
    assert found["files"] == []


def test_an_archive_that_is_refused_is_told_in_its_own_words(client, caplog):
    found = wait_for(client, send(client, b"PK\x03\x04nothing", name="x.zip").json()["id"])
    assert found["state"] == "failed"
    assert found["message"].startswith("x.zip: not a readable archive")
    assert caplog.records == [], "it is no fault of the server"


@pytest.mark.parametrize("name", ["", "x.exe", "../..", "x"])
def test_bad_names_are_refused(client, name):
    answer = send(client, b"x", name=name)
    assert answer.status_code == 400
    assert "cannot be planned" in answer.json()["error"]
    assert client.get("/api/jobs").json() == []


def test_what_is_too_large_is_refused_by_its_header_and_by_its_bytes(client, tmp_path):
    huge = client.post("/api/jobs?name=x.step", content=b"x", headers={"content-length": str(2 * 10**9)})
    assert huge.status_code == 413
    pieces = (b"0" * 10_000 for _ in range(20))
    assert client.post("/api/jobs?name=x.step", content=pieces).status_code == 413
    assert list((tmp_path / "jobs" / "incoming").iterdir()) == []


@pytest.mark.parametrize(
    "path",
    ["../jobs.sqlite", "..%2Fjobs.sqlite", "%2e%2e/two.zip", "../two.zip", "/etc/passwd", "two.zip", "plan.json/.."],
)
def test_nothing_but_results_can_be_fetched(client, path):
    job = send(client, b"x", name="two.zip").json()["id"]
    wait_for(client, job)
    assert client.get(f"/jobs/{job}/{path}").status_code == 404


def test_other_sites_and_other_names_are_refused(client):
    assert client.get("/", headers={"host": "elsewhere.org"}).status_code == 400
    answer = client.post("/api/jobs?name=x.step", content=b"x", headers={"origin": "http://elsewhere.org"})
    assert answer.status_code == 400
    assert client.get("/api/jobs").json() == []


def test_a_running_job_is_cancelled_and_one_that_takes_too_long_is_stopped(tmp_path):
    store = JobStore(tmp_path / "jobs")
    with TestClient(make_web(store, Limits(seconds=0.3), hosts=["testserver"])) as client:
        late = wait_for(client, send(client, two_blocks()).json()["id"])
        assert late["state"] == "failed"
        assert "took longer" in late["message"]
        first, second = (send(client, two_blocks()).json()["id"] for _ in range(2))
        assert client.delete(f"/api/jobs/{second}").status_code == 200
        assert client.get(f"/api/jobs/{second}").json()["state"] == "cancelled"
        assert wait_for(client, first)["state"] == "failed"
    store.close()


def test_the_page_needs_nothing_from_elsewhere(client):
    page = client.get("/")
    assert page.status_code == 200
    assert "http" not in page.text.replace("http-equiv", "")
    for name in ("page.css", "page.js"):
        assert client.get(f"/static/{name}").status_code == 200
    assert client.get("/static/..%2Fweb.py").status_code == 404


def test_the_files_of_a_finished_job_are_listed_once(tmp_path, monkeypatch):
    store = JobStore(tmp_path / "jobs")
    store.new_folder("a" * 32).joinpath("x.step").write_bytes(b"x")
    job = store.add("a" * 32, "x.step", {})
    store.take()
    asked = []
    real = web.result_names
    monkeypatch.setattr(web, "result_names", lambda out: asked.append(out) or real(out))
    with TestClient(make_web(store, Limits(jobs=0), hosts=["testserver"])) as client:
        assert client.get("/api/jobs").json()[0]["files"] == []
        out = store.output_of(job.id)
        out.mkdir()
        (out / "plan.json").write_text("{}", encoding="utf-8")
        store.take()
        store.finish(job.id, "complete", "")
        for _ in range(5):
            assert client.get("/api/jobs").json()[0]["files"] == ["plan.json"]
        assert client.get(f"/jobs/{job.id}/plan.json").status_code == 200
        assert len(asked) == 2, "once while it had none, once when it had"
        assert client.delete(f"/api/jobs/{job.id}").status_code == 200
        assert client.get(f"/jobs/{job.id}/plan.json").status_code == 404
    store.close()

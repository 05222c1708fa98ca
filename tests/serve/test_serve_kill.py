"""Twenty files at once, the server killed in the middle and started again: nothing is lost, nothing is run twice."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest
from serve_blocks import END, two_blocks

pytestmark = pytest.mark.slow


def start(folder):
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "sashimono",
            "serve",
            "--out",
            str(folder),
            "--port",
            "0",
            "--jobs",
            "2",
            "--json-lines",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    with process.stdout:
        while True:
            event = json.loads(process.stdout.readline())
            if event["event"] == "serving":
                return process, event["url"]


def jobs_of(url):
    with urllib.request.urlopen(f"{url}api/jobs") as answer:
        return json.load(answer)


def test_twenty_uploads_and_a_kill(tmp_path):
    content = two_blocks()

    def send(k):
        request = urllib.request.Request(f"{url}api/jobs?name=file{k}.zip", data=content, method="POST")
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)["id"]

    server, url = start(tmp_path / "jobs")
    try:
        with ThreadPoolExecutor(20) as pool:
            accepted = set(pool.map(send, range(20)))
        while sum(job["state"] in END for job in jobs_of(url)) < 4:
            time.sleep(0.2)
        ended = {job["id"]: job["finished"] for job in jobs_of(url) if job["state"] in END}
        os.kill(server.pid, signal.SIGKILL)
        server.wait()
        server, url = start(tmp_path / "jobs")
        found = jobs_of(url)
        while not all(job["state"] in END for job in found):
            time.sleep(0.5)
            found = jobs_of(url)
    finally:
        server.kill()
        server.wait()
    assert {job["id"] for job in found} == accepted
    assert {job["state"] for job in found} == {"complete"}
    again = [job for job in found if job["runs"] > 1]
    assert len(again) <= 2, "only what was running when the server was killed is begun anew"
    assert all(job["finished"] == ended[job["id"]] and job["runs"] == 1 for job in found if job["id"] in ended)

"""Every page of the package: axe-core finds nothing, each control works by mouse and by keyboard, no network."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from chromium import axe_findings, covered_by_others, open_browser, set_size, unreached_by_tab
from solids import box, part
from view_example import stacked_blocks

from sashimono import explain
from sashimono.assembly import Assembly
from sashimono.examination import examine
from sashimono.io.read import Inspection
from sashimono.view import write_diagnosis, write_explanation, write_html
from sashimono.view.manual import write_manual

DESKTOP, PHONE = (1280, 800), (390, 844)
LONG = tuple(f"a_rather_long_name_of_a_block_with_all_its_details_{k}" for k in range(4))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser(width=DESKTOP[0], height=DESKTOP[1]) as page:
        yield page


def plan_page(folder: Path) -> Path:
    plan, assembly = stacked_blocks(LONG, unsolved=1)
    notes = ("A note that stands on the page.",)
    held = replace(plan.steps[2], held=(LONG[0],))
    return write_html(replace(plan, notes=notes, steps=(*plan.steps[:2], held)), assembly, folder / "plan.html")


def manual_page(folder: Path) -> Path:
    plan, assembly = stacked_blocks(LONG, unsolved=1)
    return write_manual(plan, assembly, folder / "manual.html")


def lidded() -> Assembly:
    """A block in a closed case, and a block that overlaps the case."""
    walls = box((0.04, 0.04, 0.04)) - box((0.03, 0.03, 0.03))
    return Assembly(
        parts=(
            part("case_of_the_product", walls),
            part("block_inside_the_case", box((0.02, 0.02, 0.02))),
            part("knob", box((0.008, 0.008, 0.008), (0.0, 0.0, 0.022))),
        )
    )


def explanation_page(folder: Path) -> Path:
    parts = lidded()
    return write_explanation(explain(parts, "block_inside_the_case"), parts, folder / "why.html")


def doctor_page(folder: Path) -> Path:
    read = Inspection(assembly=lidded(), broken=(), mended={}, folded={}, unit_stated=False, unit_given=False)
    return write_diagnosis(examine(read), folder / "doctor.html")


PAGES = {"plan": plan_page, "manual": manual_page, "explanation": explanation_page, "doctor": doctor_page}


@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing_and_all_controls_are_reached(name: str, browser: Any, tmp_path: Path) -> None:
    path = PAGES[name](tmp_path)
    browser.errors.clear()
    browser.requests.clear()
    set_size(browser, *DESKTOP)
    browser.open(path)
    for size in (DESKTOP, PHONE):
        set_size(browser, *size)
        assert axe_findings(browser) == []
        assert unreached_by_tab(browser) == []
        assert covered_by_others(browser) == []
        assert browser.evaluate("document.documentElement.scrollWidth") <= size[0]
    assert browser.errors == []
    assert [url for url in browser.requests if not url.startswith((path.as_uri(), "data:", "blob:"))] == []


@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing_in_the_dark(name: str, browser: Any, tmp_path: Path) -> None:
    path = PAGES[name](tmp_path)
    set_size(browser, *DESKTOP)
    browser.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    try:
        browser.open(path)
        browser.screenshot()
        assert axe_findings(browser) == []
    finally:
        browser.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])


def test_axe_finds_nothing_while_the_plan_page_is_used(browser: Any, tmp_path: Path) -> None:
    browser.errors.clear()
    set_size(browser, *DESKTOP)
    browser.open(plan_page(tmp_path))
    for size in (DESKTOP, PHONE):
        set_size(browser, *size)
        browser.evaluate(
            "sashimono.setView({section: true, measure: true, explode: 0.5}); sashimono.setTime(sashimono.duration);"
            f"sashimono.choose({LONG[1]!r}); sashimono.find('block_with');"
            "document.querySelectorAll('.menu').forEach((menu) => (menu.open = true))"
        )
        assert axe_findings(browser) == []
        assert unreached_by_tab(browser) == []
        browser.evaluate("document.querySelectorAll('.menu').forEach((menu) => (menu.open = false))")
        assert covered_by_others(browser) == []
    assert browser.errors == []


def test_every_switch_works_by_mouse_and_by_keyboard(browser: Any, tmp_path: Path) -> None:
    browser.errors.clear()
    set_size(browser, *DESKTOP)
    browser.open(plan_page(tmp_path))
    count = browser.evaluate("document.querySelectorAll('#tools [aria-pressed]').length")
    assert count >= 6
    for k in range(count):
        node = f"document.querySelectorAll('#tools [aria-pressed]')[{k}]"
        if browser.evaluate(f"{node}.closest('#cutter') !== null"):
            continue  # an axis is chosen, not switched
        browser.evaluate(
            f"for (let up = {node}.parentElement; up; up = up.parentElement) if (up.matches('details')) up.open = true"
        )
        before = browser.evaluate(f"{node}.getAttribute('aria-pressed')")
        for key, code in ((" ", "Space"), ("Enter", "Enter")):
            browser.evaluate(f"{node}.focus()")
            browser.press(key, code)
            now = browser.evaluate(f"{node}.getAttribute('aria-pressed')")
            assert now != before, browser.evaluate(f"{node}.textContent")
            before = now
        x, y = browser.evaluate(
            f"(() => {{ const box = {node}.getBoundingClientRect();"
            " return [box.left + box.width / 2, box.top + box.height / 2]; })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        assert browser.evaluate(f"{node}.getAttribute('aria-pressed')") != before
    # sliders and lists by their own keys
    for selector in ("#tools label input", "#track input"):
        browser.evaluate(f"document.querySelector({selector!r}).focus()")
        browser.press("Home", "Home")
        assert float(browser.evaluate(f"document.querySelector({selector!r}).value")) == 0.0
        browser.press("ArrowRight", "ArrowRight")
        assert float(browser.evaluate(f"document.querySelector({selector!r}).value")) > 0.0
    browser.evaluate("document.querySelector('#bar select').focus()")
    browser.press("ArrowDown", "ArrowDown")
    assert browser.evaluate("document.querySelector('#bar select').value") == "2"
    rows = browser.evaluate("document.querySelectorAll('button.row').length")
    browser.evaluate(f"document.querySelectorAll('button.row')[{rows - 1}].focus()")
    browser.press("Enter", "Enter")
    assert browser.evaluate("sashimono.time") == pytest.approx(browser.evaluate(f"sashimono.steps[{rows - 1}].start"))
    assert browser.errors == []


@pytest.mark.parametrize("name", ["explanation", "doctor"])
def test_lines_of_the_other_pages_are_chosen_by_keyboard(name: str, browser: Any, tmp_path: Path) -> None:
    browser.errors.clear()
    set_size(browser, *DESKTOP)
    browser.open(PAGES[name](tmp_path))
    browser.evaluate("[...document.querySelectorAll('button.row')].at(-1).focus()")
    browser.press("Enter", "Enter")
    assert (
        browser.evaluate("[...document.querySelectorAll('button.row')].at(-1).getAttribute('aria-current')") == "step"
    )
    assert browser.errors == []


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that has one plan and one failure, and runs nothing."""
    pytest.importorskip("uvicorn")
    import uvicorn

    from sashimono.io.plan_json import write_plan
    from sashimono.serve.jobs import JobStore
    from sashimono.serve.limits import Limits
    from sashimono.serve.web import make_web

    store = JobStore(tmp_path_factory.mktemp("serve") / "jobs")
    plan, assembly = stacked_blocks()
    for name in ("blocks.zip", "broken.step"):
        store.new_folder(name[:6]).joinpath(name).write_bytes(b"x")
        job = store.add(name[:6], name, {})
        assert store.take() is not None
        if name == "blocks.zip":
            out = store.output_of(job.id)
            out.mkdir()
            write_plan(plan, out / "plan.json")
            write_html(plan, assembly, out / "plan.html")
            store.finish(job.id, "complete", plan.verdict)
        else:
            store.finish(job.id, "failed", "broken.step: not a STEP file")
    web = make_web(store, Limits(jobs=0), hosts=["127.0.0.1"])
    server = uvicorn.Server(uvicorn.Config(web, port=0, log_level="error", access_log=False))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.02)
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    server.should_exit = True
    thread.join(timeout=20.0)
    store.close()


def test_the_page_of_the_server(browser: Any, served: str) -> None:
    browser.errors.clear()
    browser.requests.clear()
    browser.open(served)
    rows = "document.querySelectorAll('#jobs > li').length"
    while browser.evaluate(rows) < 2:
        time.sleep(0.05)
    browser.evaluate("document.querySelectorAll('.change')[0].focus()")
    browser.press("Enter", "Enter")
    while browser.evaluate("document.activeElement.tagName") != "TEXTAREA":
        time.sleep(0.05)
    for size in (DESKTOP, PHONE):
        set_size(browser, *size)
        assert axe_findings(browser) == []
        assert unreached_by_tab(browser) == []
        assert covered_by_others(browser) == []
        assert browser.evaluate("document.documentElement.scrollWidth") <= size[0]
    assert browser.evaluate("[...document.querySelectorAll('.links a')].map((node) => node.textContent)") == [
        "Open the plan", "plan.json",
    ]  # fmt: skip
    assert browser.errors == []
    assert [url for url in browser.requests if not url.startswith((served, "data:"))] == []

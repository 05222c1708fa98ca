"""The viewer page in a real browser: it plays, it is silent, and it shows what the plan says."""

from __future__ import annotations

import base64
import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import open_browser
from solids import peg_in_plate
from view_example import HOSTILE_NAMES, paired_blocks, stacked_blocks

from sashimono.geometry import se3
from sashimono.pipeline import plan_assembly
from sashimono.view import write_html


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser(width=700, height=450) as page:
        yield page


@pytest.fixture(scope="module")
def complete(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The page of a complete plan, opened once: software rendering makes loading the slow part."""
    plan, assembly = stacked_blocks()
    browser.open(write_html(plan, assembly, tmp_path_factory.mktemp("view") / "plan.html"))
    browser.screenshot()
    return browser


def decode_png(content: bytes) -> np.ndarray:
    """Return the 8-bit RGB(A) image of a PNG without interlacing; enough for Chromium's screenshots."""
    stream = io.BytesIO(content[8:])
    data, width, height, channels = b"", 0, 0, 0
    while header := stream.read(8):
        size, kind = struct.unpack(">I4s", header)
        body = stream.read(size)
        stream.read(4)
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", body[:10])
            assert depth == 8
            channels = {2: 3, 6: 4}[color]
        elif kind == b"IDAT":
            data += body
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + width * channels)
    image = np.zeros((height, width * channels), np.uint8)
    for y in range(height):
        method, line = rows[y, 0], rows[y, 1:].astype(int)
        above = image[y - 1].astype(int) if y else np.zeros(width * channels, int)
        if method == 0:
            image[y] = line
        elif method == 2:
            image[y] = (line + above) % 256
        else:
            current = [0] * channels
            corner = [0] * channels
            for x in range(width * channels):
                a, b, c = current[x % channels], int(above[x]), corner[x % channels]
                nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
                guess = {1: a, 3: (a + b) // 2, 4: nearest}[int(method)]
                image[y, x] = value = (int(line[x]) + guess) % 256
                current[x % channels], corner[x % channels] = value, b
    return image.reshape(height, width, channels)[:, :, :3]


def test_loads_without_errors_or_requests(complete: Any) -> None:
    assert complete.evaluate("sashimono.ready") is True
    assert complete.errors == []
    assert [url for url in complete.requests if not url.startswith("file://") or "plan.html" not in url] == []


def test_timeline_moves_the_parts_from_rest_to_assembled(complete: Any) -> None:
    plan, _ = stacked_blocks()
    for step in plan.steps:
        name = step.part
        complete.evaluate("sashimono.setTime(0)")
        assert np.allclose(complete.evaluate(f"sashimono.poseOf('{name}')"), step.motion.T_world_part[0], atol=1e-12)
        complete.evaluate("sashimono.setTime(sashimono.duration)")
        assert np.allclose(complete.evaluate(f"sashimono.poseOf('{name}')"), plan.parts[name], atol=1e-12)


def test_interpolation_is_the_geodesic(complete: Any) -> None:
    rng = np.random.default_rng(7)
    for scale in (0.0, 1e-9, 1e-3, 1.0, 3.1, np.pi - 1e-9):
        axis = rng.normal(size=3)
        twist = np.concatenate([rng.normal(size=3), scale * axis / np.linalg.norm(axis)])
        T_a = se3.exp(rng.normal(size=6))
        T_b = T_a @ se3.exp(twist)
        u = float(rng.uniform(0.1, 0.9))
        found = complete.evaluate(f"sashimono.interpolate({T_a.tolist()}, {T_b.tolist()}, {u})")
        assert np.allclose(found, se3.interpolate(T_a, T_b, u), atol=1e-6), scale


def test_picture_changes_with_time_and_has_the_part_in_it(complete: Any) -> None:
    pictures = []
    for share in (0.0, 1.0):
        complete.evaluate(f"sashimono.setTime({share} * sashimono.duration)")
        pictures.append(decode_png(complete.screenshot((10, 60, 340, 200))).astype(int))
    assert all(picture.std() > 5.0 for picture in pictures), "blank"
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 30).mean() > 0.003


def test_keyboard_steps_and_plays(complete: Any) -> None:
    complete.evaluate("sashimono.setTime(0)")
    second = complete.evaluate("sashimono.steps[1].start")
    complete.press("ArrowRight", "ArrowRight")
    assert complete.evaluate("sashimono.time") == pytest.approx(second)
    complete.press("ArrowLeft", "ArrowLeft")
    assert complete.evaluate("sashimono.time") == 0.0
    complete.press(" ", "Space")
    assert complete.evaluate("sashimono.playing") is True
    complete.screenshot()
    assert complete.evaluate("sashimono.time") > 0.0
    complete.press(" ", "Space")
    assert complete.evaluate("sashimono.playing") is False


def test_step_list_shows_and_jumps(complete: Any) -> None:
    complete.evaluate("document.querySelectorAll('button.row')[2].click()")
    complete.screenshot()
    assert complete.evaluate("sashimono.time") == pytest.approx(complete.evaluate("sashimono.steps[2].start"))
    assert complete.evaluate("document.querySelector('[aria-current=step] .name').textContent") == "block_2"
    assert "Complete & verified" in complete.evaluate("document.querySelector('.badge').textContent")


def test_exploded_view_moves_only_what_is_drawn(complete: Any) -> None:
    complete.evaluate("sashimono.setTime(sashimono.duration)")
    complete.evaluate("sashimono.setView({explode: 1})")
    drawn = np.array(complete.evaluate("sashimono.drawnPoseOf('block_1')"))
    planned = np.array(complete.evaluate("sashimono.poseOf('block_1')"))
    assert drawn[2, 3] - planned[2, 3] > 0.005
    assert np.array_equal(drawn[:3, :3], planned[:3, :3])
    complete.evaluate("sashimono.setView({explode: 0, xray: true, table: false, contacts: false})")
    assert complete.errors == []
    complete.evaluate("sashimono.setView({xray: false, table: true, contacts: true})")


def click(page: Any, x: float, y: float) -> None:
    """Press and release the mouse at a place of the page [pixels]."""
    for kind in ("mousePressed", "mouseReleased"):
        page.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    page.screenshot()


def test_a_click_chooses_a_part_and_goes_to_its_step(complete: Any) -> None:
    plan, _ = stacked_blocks()
    complete.evaluate("sashimono.choose(null); sashimono.setTime(sashimono.duration)")
    complete.screenshot()
    top = plan.parts["block_3"][:3, 3] + [0.0, 0.0, 0.0101]
    click(complete, *complete.evaluate(f"sashimono.pixelOf({top.tolist()})"))
    assert complete.evaluate("sashimono.chosen") == "block_3"
    assert complete.evaluate("sashimono.time") == pytest.approx(complete.evaluate("sashimono.steps[3].start"))
    assert complete.evaluate("location.hash") == "#step=4"
    buttons = "[...document.querySelectorAll('#choice button')]"
    complete.evaluate(f"{buttons}.find((button) => button.textContent === 'Alone').click()")
    complete.screenshot()
    names = ("block_0", "block_1", "block_2", "block_3")
    assert [complete.evaluate(f"sashimono.isShown('{name}')") for name in names] == [False, False, False, True]
    complete.press("Escape", "Escape")
    assert complete.evaluate("sashimono.chosen") is None
    complete.evaluate("sashimono.choose('block_1')")
    complete.press("h", "KeyH")
    assert [complete.evaluate(f"sashimono.isShown('{name}')") for name in names] == [True, False, True, True]
    complete.evaluate(f"{buttons}.find((button) => button.textContent === 'Show all').click()")
    assert complete.evaluate("sashimono.isShown('block_1')") is True
    assert complete.errors == []


def test_an_address_names_a_step(complete: Any) -> None:
    complete.evaluate("location.hash = '#step=3'")
    complete.screenshot()
    assert complete.evaluate("sashimono.time") == pytest.approx(complete.evaluate("sashimono.steps[2].start"))
    complete.evaluate("location.hash = '#step=99'")
    complete.screenshot()
    assert complete.evaluate("sashimono.time") == pytest.approx(complete.evaluate("sashimono.steps[2].start"))
    assert complete.errors == []


def test_every_control_has_a_name_and_its_own_keys(complete: Any) -> None:
    complete.send("Accessibility.enable")
    nodes = complete.send("Accessibility.getFullAXTree")["nodes"]
    controls = [
        node
        for node in nodes
        if node.get("role", {}).get("value") in ("button", "slider", "combobox", "DisclosureTriangle")
    ]
    assert len(controls) > 10
    assert [node["role"]["value"] for node in controls if not node.get("name", {}).get("value")] == []
    complete.evaluate("sashimono.pause(); sashimono.setTime(0); document.querySelector('#bar select').focus()")
    for key, code in ((" ", "Space"), ("ArrowRight", "ArrowRight"), ("f", "KeyF")):
        complete.press(key, code)
    assert complete.evaluate("sashimono.playing") is False
    assert complete.evaluate("sashimono.time") == 0.0
    complete.evaluate("document.activeElement.blur()")
    assert complete.evaluate("document.querySelector('.play').getAttribute('aria-label')").startswith("Play")
    complete.evaluate("sashimono.play()")
    complete.screenshot()
    assert complete.evaluate("document.querySelector('.play').getAttribute('aria-label')").startswith("Pause")
    complete.evaluate("sashimono.pause()")


def top_of(page: Any, name: str, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Return where a place on the top of a block is in the window, ``shift`` [m] from its middle in its own frame."""
    plan, _ = stacked_blocks()
    at = se3.apply(plan.parts[name], np.array([[*shift, 0.01]]))[0]
    x, y = page.evaluate(f"sashimono.pixelOf({at.tolist()})")
    return x, y


def test_a_section_cuts_and_closes_what_it_cuts(complete: Any) -> None:
    complete.evaluate("sashimono.choose(null); sashimono.setTime(sashimono.duration)")
    complete.evaluate("document.activeElement.blur()")
    before = decode_png(complete.screenshot())
    x, y = top_of(complete, "block_3")
    assert complete.evaluate(f"sashimono.partAt({x}, {y})") == "block_3"
    complete.press("s", "KeyS")
    complete.press("z", "KeyZ")
    section = complete.evaluate("sashimono.section")
    assert (section["on"], section["axis"], section["parts"]) == (True, 2, 0), "between the second and the third block"
    for _ in range(6):
        complete.press(".", "Period")
    section = complete.evaluate("sashimono.section")
    assert section["share"] == pytest.approx(0.62)
    assert section["parts"] == 1
    assert complete.evaluate("document.querySelector('#cutter output').textContent") == "z = 49.60 mm"
    # the camera stands above: the upper part is left out, and the cut is what is met there
    at = np.array(complete.evaluate("sashimono.pixelOf([0, 0, 0.0496])")).astype(int)
    assert complete.evaluate(f"sashimono.partAt({at[0]}, {at[1]})") == "block_2"
    cut = decode_png(complete.screenshot())
    patch = cut[at[1] - 8 : at[1] + 8, at[0] - 8 : at[0] + 8].astype(float)
    assert patch.std() > 5.0, "a cut face is hatched"
    assert (np.abs(cut.astype(int) - before.astype(int)).max(axis=2) > 30).mean() > 0.003
    complete.press("v", "KeyV")
    assert complete.evaluate("sashimono.section.keepUpper") is True
    # by mouse
    click_on(complete, "#cutter button:last-child")
    assert complete.evaluate("sashimono.section.keepUpper") is False
    click_on(complete, "#cutter input")
    assert complete.evaluate("sashimono.section.share") == pytest.approx(0.5, abs=0.03)
    click_on(complete, "#cutter button:first-child")
    assert complete.evaluate("[sashimono.section.axis, sashimono.section.parts]") == [0, 4]
    complete.press("s", "KeyS")
    assert complete.evaluate("sashimono.section.on") is False
    assert complete.evaluate("document.querySelector('#cutter').hidden") is True
    assert complete.errors == []


def click_on(page: Any, selector: str) -> None:
    """Press a control in its middle."""
    place = page.evaluate(
        f"(() => {{ const box = document.querySelector({selector!r}).getBoundingClientRect();"
        " return [box.left + box.width / 2, box.top + box.height / 2]; })()"
    )
    click(page, *place)
    page.evaluate("document.activeElement.blur()")


def test_two_picks_measure_distance_and_angle(complete: Any) -> None:
    complete.evaluate(
        "sashimono.choose(null); sashimono.setTime(sashimono.duration); sashimono.setView({measure: true})"
    )
    complete.evaluate("document.activeElement.blur()")

    def pick(x: float, y: float) -> dict[str, str]:
        return dict(complete.evaluate(f"sashimono.pick({x}, {y})"))

    assert pick(*top_of(complete, "block_3")) == {"1. flat face": "block_3"}
    # a corner of the lowest block's bottom is as far below as four blocks are high
    plan, _ = stacked_blocks()
    corners = [
        se3.apply(plan.parts["block_0"], np.array([[x, y, -0.01]]))[0] for x in (-0.02, 0.02) for y in (-0.015, 0.015)
    ]
    seen = [complete.evaluate(f"sashimono.pixelOf({corner.tolist()})") for corner in corners]
    x, y = max(seen, key=lambda at: at[1])
    said = pick(x, y - 1.0)
    assert said["2. corner"] == "block_0"
    assert said["Shortest distance"].startswith("8"), said
    # two picks on the sides of one block: its edges are as long as drawn, and at a right angle
    said = pick(*top_of(complete, "block_3", (0.0195, 0.0)))
    assert said == {"1. edge, 30 mm": "block_3"}
    said = pick(*top_of(complete, "block_3", (0.0, 0.0145)))
    assert said["2. edge, 40 mm"] == "block_3"
    assert said["Angle"] == "90°"
    assert said["Shortest distance"] == "0 mm"
    said = dict(complete.evaluate(f"sashimono.pick(...{list(top_of(complete, 'block_3', (0.0195, 0.0)))})"))
    said = pick(*top_of(complete, "block_3", (-0.0195, 0.0)))
    assert said["Shortest distance"] == "40 mm"
    assert said["Angle"] == "0°"
    # time passes, parts move: what was picked holds no more
    complete.evaluate("sashimono.setTime(sashimono.steps[3].start)")
    assert complete.evaluate("document.querySelectorAll('#gauge dt').length") == 0
    complete.evaluate("sashimono.setView({measure: false})")
    assert complete.errors == []


def test_measuring_by_keyboard_and_by_mouse(complete: Any) -> None:
    complete.evaluate("sashimono.choose(null); sashimono.setTime(sashimono.duration)")
    complete.evaluate("document.activeElement.blur()")
    complete.press("m", "KeyM")
    assert complete.evaluate("document.querySelector('#gauge').hidden") is False
    complete.evaluate("document.querySelector('#stage canvas').focus()")
    goal = top_of(complete, "block_3")
    complete.press("Enter", "Enter")  # shows the cross, in the middle
    for _ in range(120):
        box = complete.evaluate(
            "(() => { const box = document.querySelector('#aim').getBoundingClientRect();"
            " return [box.left + box.width / 2, box.top + box.height / 2]; })()"
        )
        off = np.subtract(goal, box)
        if np.abs(off).max() <= 4.0:
            break
        axis = int(np.abs(off).argmax())
        key = (("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown"))[axis][int(off[axis] > 0.0)]
        complete.press(key, key)
    complete.press("Enter", "Enter")
    assert complete.evaluate("document.querySelector('#gauge dt').textContent") == "1. flat face"
    click(complete, *top_of(complete, "block_3", (0.0195, 0.0)))
    assert complete.evaluate("[...document.querySelectorAll('#gauge dt')].at(-1).textContent") == "Angle"
    assert complete.evaluate("sashimono.chosen") is None, "a click measures, and chooses nothing"
    complete.press("Escape", "Escape")
    assert complete.evaluate("document.querySelectorAll('#gauge dt').length") == 0
    complete.press("Escape", "Escape")
    assert complete.evaluate("document.querySelector('#gauge').hidden") is True
    assert complete.errors == []


def test_parts_are_found_by_name(complete: Any) -> None:
    complete.evaluate("sashimono.choose(null); document.activeElement.blur()")
    complete.press("/", "Slash")
    assert complete.evaluate("document.activeElement.type") == "search"
    complete.send("Input.insertText", text="K_2")
    assert complete.evaluate("sashimono.found") == ["block_2"]
    shown = "[...document.querySelectorAll('#lists li')].filter((row) => !row.hidden).length"
    assert complete.evaluate(shown) == 1
    assert complete.evaluate("document.querySelector('#finder .note').textContent") == "1 of 4 parts"
    complete.press("Enter", "Enter")
    assert complete.evaluate("sashimono.chosen") == "block_2"
    size = complete.evaluate("document.querySelector('#choice div > span').textContent")
    vertices = stacked_blocks()[1].part("block_2").vertices_world
    for word, edge in zip(size.split(" × "), np.ptp(vertices, axis=0), strict=True):
        assert float(word.removesuffix(" mm")) == pytest.approx(1e3 * edge, rel=5e-3)
    complete.press("Escape", "Escape")
    assert complete.evaluate("document.querySelector('#finder input').value") == ""
    assert complete.evaluate(shown) == 4
    complete.evaluate("sashimono.find('nothing has this name')")
    assert complete.evaluate("document.querySelector('#finder .note').textContent") == "0 of 4 parts"
    complete.evaluate("sashimono.find(''); document.activeElement.blur(); sashimono.choose(null)")
    assert complete.errors == []


def test_the_view_is_turned_and_neared_by_keys(complete: Any) -> None:
    complete.evaluate("document.activeElement.blur()")
    complete.press("f", "KeyF")
    place = "sashimono.pixelOf([0.02, 0, 0.08])"
    start = np.array(complete.evaluate(place))
    for kind in ("rawKeyDown", "keyUp"):
        complete.send("Input.dispatchKeyEvent", type=kind, key="ArrowLeft", code="ArrowLeft", modifiers=8)
    turned = np.array(complete.evaluate(place))
    assert np.abs(turned - start).max() > 3.0
    complete.press("+", "Equal")
    assert np.abs(np.array(complete.evaluate(place)) - turned).max() > 3.0
    complete.press("f", "KeyF")
    assert complete.evaluate(place) == pytest.approx(list(start), abs=1e-6)
    complete.press("e", "KeyE")
    assert complete.evaluate("document.querySelector('#tools input').value") == "1"
    complete.press("e", "KeyE")
    assert complete.evaluate("document.querySelector('#tools input').value") == "0"
    assert complete.errors == []


def test_drawn_apart_the_last_parts_go_first(complete: Any) -> None:
    complete.evaluate("sashimono.setTime(sashimono.duration)")

    def lifted(amount: float) -> list[float]:
        complete.evaluate(f"sashimono.setView({{explode: {amount}}})")
        names = ("block_0", "block_1", "block_2", "block_3")
        drawn = [np.array(complete.evaluate(f"sashimono.drawnPoseOf('{name}')")) for name in names]
        planned = [np.array(complete.evaluate(f"sashimono.poseOf('{name}')")) for name in names]
        return [float(a[2, 3] - b[2, 3]) for a, b in zip(drawn, planned, strict=True)]

    early = lifted(0.2)
    assert early[:3] == [0.0, 0.0, 0.0]
    assert early[3] > 0.001
    whole = lifted(1.0)
    assert whole[0] == 0.0
    assert whole[1] < whole[2] < whole[3]
    complete.evaluate("sashimono.setView({explode: 0})")


def test_paper_gets_the_picture_and_every_step_in_full(complete: Any) -> None:
    complete.evaluate("sashimono.setTime(sashimono.duration)")
    pdf = base64.b64decode(complete.send("Page.printToPDF")["data"])
    assert pdf.startswith(b"%PDF")
    picture = complete.evaluate("document.querySelector('#printed').toDataURL()")
    assert decode_png(base64.b64decode(picture.split(",")[1])).std() > 3.0
    complete.send("Emulation.setEmulatedMedia", media="print")
    try:
        shown = "[...document.querySelectorAll({})].map((node) => getComputedStyle(node).display !== 'none')".format
        assert complete.evaluate(shown("'#tools, #bar, #stage > canvas:first-child'")) == [False] * 3
        assert all(complete.evaluate(shown("'#printed, .row, .more.when-current'")))
    finally:
        complete.send("Emulation.setEmulatedMedia", media="")


def test_following_looks_at_each_step(complete: Any) -> None:
    plan, _ = stacked_blocks()
    complete.evaluate("sashimono.setView({follow: true})")
    for k, step in enumerate(plan.steps[1:], start=1):
        complete.evaluate(f"sashimono.setTime(sashimono.steps[{k}].stop)")
        place = plan.parts[step.part][:3, 3].tolist()
        x, y = complete.evaluate(f"sashimono.pixelOf({place})")
        width, height = complete.evaluate(
            "[document.querySelector('#stage').clientWidth, document.querySelector('#stage').clientHeight]"
        )
        assert 0.2 * width < x < 0.8 * width
        assert 0.1 * height < y < 0.9 * height
    # while it plays, the camera goes to the next step's place by and by
    complete.evaluate("sashimono.setTime(sashimono.steps[1].stop - 0.05); sashimono.play()")
    before = complete.evaluate("sashimono.pixelOf([0, 0, 0])")
    complete.evaluate("new Promise((done) => setTimeout(done, 900))")
    complete.screenshot()
    assert complete.evaluate("sashimono.pixelOf([0, 0, 0])") != before
    complete.evaluate("sashimono.pause(); sashimono.setView({follow: false})")
    assert complete.errors == []


def test_usable_at_the_width_of_a_phone(complete: Any) -> None:
    size = {"deviceScaleFactor": 1, "mobile": False}
    complete.send("Emulation.setDeviceMetricsOverride", width=390, height=780, **size)
    try:
        complete.screenshot()
        assert complete.evaluate("document.documentElement.scrollWidth") <= 390
        outside = complete.evaluate(
            "[...document.querySelectorAll('#tools > *, #bar button, #bar select, #bar input, .row')]"
            ".filter((node) => { const box = node.getBoundingClientRect();"
            " return box.left < 0 || box.right > innerWidth + 1; }).length"
        )
        assert outside == 0
        smallest = complete.evaluate(
            "Math.min(...[...document.querySelectorAll('#bar button')].map((n) => n.getBoundingClientRect().height))"
        )
        assert smallest >= 38
        assert complete.evaluate("document.querySelector('#stage').clientHeight") > 250
    finally:
        complete.send("Emulation.setDeviceMetricsOverride", width=700, height=450, **size)


def test_words_and_lengths_are_a_readers(browser: Any, complete: Any, tmp_path: Path) -> None:
    names = tuple(f"a_rather_long_name_of_a_block_{k}" for k in range(4))
    plan, assembly = stacked_blocks(names)
    motion = replace(plan.steps[1].motion, evidence={"max_penetration": 4.85e-18, "tolerance": 1e-4})
    plan = replace(plan, steps=(plan.steps[0], replace(plan.steps[1], motion=motion), *plan.steps[2:]))
    browser.open(write_html(plan, assembly, tmp_path / "plan.html"))
    browser.screenshot()
    said = browser.evaluate("document.getElementById('side').textContent")
    assert "goes in down 50 mm" in said
    assert "no grasp: no antipodal pair is free" in said
    assert "overlap 0 mm of 0.1 mm allowed" in said
    for wrong in ("→", "no contact", "e-"):
        assert wrong not in said
    # where there is no room a long name is cut before its end, which tells it from its like
    tails = browser.evaluate("[...document.querySelectorAll('.row .name .tail')].map((node) => node.textContent)")
    assert tails == ["ck_0", "ck_1", "ck_2", "ck_3"]
    assert browser.errors == []


def test_a_subassembly_is_put_together_and_moves_as_one(browser: Any, complete: Any, tmp_path: Path) -> None:
    plan, assembly = paired_blocks()
    pair = plan.steps[-1]
    browser.open(write_html(plan, assembly, tmp_path / "pair.html"))
    steps = browser.evaluate("sashimono.steps")
    assert [step["label"] for step in steps] == ["1", "2", "3.1", "3.2", "3"]

    def shown(time: float) -> list[np.ndarray]:
        browser.evaluate(f"sashimono.setTime({time})")
        return [np.array(browser.evaluate(f"sashimono.poseOf({name!r})")) for name in pair.members]

    assert pair.subassembly is not None
    inner = pair.subassembly.steps[1].motion.T_world_part[0]
    apart = se3.inverse(plan.parts[pair.members[0]]) @ inner
    together = se3.inverse(plan.parts[pair.members[0]]) @ plan.parts[pair.members[1]]
    for time, between in (
        (0.0, apart),
        (steps[3]["start"], apart),
        (steps[3]["stop"], together),
        (0.5 * (steps[4]["start"] + steps[4]["stop"]), together),
        (steps[4]["stop"], together),
    ):
        lower, upper = shown(time)
        np.testing.assert_allclose(se3.inverse(lower) @ upper, between, atol=1e-9)
    for name, pose in zip(pair.members, shown(steps[4]["stop"]), strict=True):
        np.testing.assert_allclose(pose, plan.parts[name], atol=1e-9)
    said = browser.evaluate("document.getElementById('side').textContent")
    assert "subassembly of 2: block_2, block_3" in said
    assert "3 + 2 inside" in said
    assert browser.evaluate("document.getElementById('caption').textContent").startswith("block_2 and 1 more")
    browser.evaluate(f"sashimono.setTime({0.5 * (steps[3]['start'] + steps[3]['stop'])})")
    caption = browser.evaluate("document.getElementById('caption').textContent")
    assert "Step 3.2 of 3 · inside a subassembly" in caption
    assert browser.errors == []


def test_partial_plan_with_hostile_names(browser: Any, complete: Any, tmp_path: Path) -> None:
    plan, assembly = stacked_blocks(names=HOSTILE_NAMES, unsolved=1)
    browser.open(write_html(plan, assembly, tmp_path / "plan.html"))
    browser.screenshot()
    assert browser.errors == []
    assert tuple(browser.evaluate("sashimono.names")) == HOSTILE_NAMES
    assert browser.evaluate("window.broken") is None
    assert "1 of 4" in browser.evaluate("document.querySelector('.badge').textContent")
    row = browser.evaluate("document.querySelector('.row.unsolved').textContent")
    assert HOSTILE_NAMES[-1] in row
    assert "proven blocked" in row
    assert "held by a hook" in row
    browser.evaluate("sashimono.setTime(sashimono.duration / 2)")
    browser.evaluate("sashimono.setTime(sashimono.duration)")
    last = browser.evaluate("sashimono.poseOf(sashimono.names[3])")
    assert np.allclose(last, plan.parts[HOSTILE_NAMES[-1]])


def test_fingertips_are_drawn_where_they_touch(browser: Any, tmp_path: Path) -> None:
    """A plan as the planner makes it, not one made by hand."""
    parts = peg_in_plate()
    plan = plan_assembly(parts)
    assert any("fingertips" in step.contact.details for step in plan.steps if step.contact)
    browser.errors.clear()
    browser.open(write_html(plan, parts, tmp_path / "plan.html"))
    for share in (0.0, 0.5, 0.75, 1.0):
        browser.evaluate(f"sashimono.setTime({share} * sashimono.duration)")
    assert browser.errors == []

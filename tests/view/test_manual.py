"""Work instructions: what they say, from where they look, and that the page stands alone."""

from __future__ import annotations

import base64
import html.parser
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import solids
from solids import part
from view.view_example import HOSTILE_NAMES, NAMES, paired_blocks, stacked_blocks

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.geometry.legs import Leg
from sashimono.plan import AssemblyPlan, DeclaredFit, Fixture, Motion, Segment, Step
from sashimono.view.config import ViewConfig
from sashimono.view.manual import camera
from sashimono.view.manual.arrows import has_room, straight_arrow
from sashimono.view.manual.camera import Stand, Subject, Visibility, choose_glass, choose_stand, visibility
from sashimono.view.manual.content import common_name, make_manual
from sashimono.view.manual.drawing import Solid, look_from
from sashimono.view.manual.page import _Page as _Page_of_manual
from sashimono.view.manual.page import render_manual, write_manual
from sashimono.view.manual.pdf import find_browser, print_page
from sashimono.view.manual.pictures import Illustrator, PictureConfig
from sashimono.view.scene import make_scene
from sashimono.view.words import ENGLISH, GERMAN, LANGUAGES, leg_words, length_words, way_lines, way_words

UP = np.array([0.0, 0.0, 1.0])
SMALL = PictureConfig(width=240, height=150, supersample=1, thumbnail=32, cover_width=420, cover_height=(200, 300))


def leg(direction: tuple[float, float, float], length: float, turns: float = 0.0) -> Leg:
    return Leg(direction=np.array(direction), length=length, turns=turns, point=np.zeros(3))


def box_at(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    from view.view_example import box

    size = np.array(high) - np.array(low)
    points, faces = box((float(size[0]), float(size[1]), float(size[2])))
    return Solid(points=points + 0.5 * (np.array(low) + np.array(high)), faces=faces, color=np.array([0.5, 0.5, 0.5]))


VOID = ("meta", "img", "image", "rect", "circle", "path", "polygon", "wbr")
"""Elements that are not closed, or close themselves."""


class _Page(html.parser.HTMLParser):
    """Collects the page's text and tags, and sees that every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.words.append(data)


def read(page: str) -> _Page:
    parser = _Page()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


def test_words_of_a_way() -> None:
    down, screw = leg((0.0, 0.0, -1.0), 0.016), leg((0.0, 0.0, -1.0), 0.0028, 4.0)
    assert way_words((down, screw), UP, ENGLISH) == "down 16 mm, then 4 turns clockwise (down 2.8 mm)"
    assert way_words((down, screw), UP, GERMAN) == (
        "16 mm nach unten, dann 4 Umdrehungen im Uhrzeigersinn (2,8 mm nach unten)"
    )
    assert leg_words(leg((1.0, 0.0, 0.0), 0.0074), UP, ENGLISH) == "7.4 mm along the arrow"
    assert leg_words(leg((1.0, 0.0, 0.0), 0.0074), UP, ENGLISH, arrow=True) == "7.4 mm"
    assert leg_words(leg((0.0, 0.0, -1.0), 0.0028, -1.0), UP, ENGLISH).startswith("1 turn counter-clockwise")
    assert leg_words(leg((0.0, 0.0, -1.0), 0.00021, -0.01), UP, ENGLISH) == "turn 4° counter-clockwise (down 0.21 mm)"
    assert leg_words(leg((0.0, 0.0, -1.0), 0.00021, -0.001), UP, ENGLISH) == "down 0.21 mm"
    about_x, about_z = leg((1.0, 0.0, 0.0), 0.0, 0.05), leg((0.0, 0.0, 1.0), 0.0, 0.05)
    assert way_words((about_x, down), UP, ENGLISH) == "tilt by 18°, then down 16 mm"
    # the axis points up, the way down: seen along the way the turn is the other way round
    assert way_words((down, about_z), UP, ENGLISH) == "down 16 mm, then turn 18° counter-clockwise"
    assert way_lines((down, about_x, down, about_x, down), UP, ENGLISH, most=2) == ["…", "tilt by 18°", "down 16 mm"]
    # what is down follows the table, not the world's z
    assert leg_words(leg((0.0, 0.0, -1.0), 0.016), -UP, ENGLISH) == "up 16 mm"


@pytest.mark.parametrize(("length", "text"), [(0.1234, "123 mm"), (0.00744, "7.4 mm"), (0.00031, "0.31 mm")])
def test_lengths_have_as_many_digits_as_a_hand_needs(length: float, text: str) -> None:
    assert length_words(length, ENGLISH) == text


@pytest.mark.parametrize("words", LANGUAGES.values(), ids=lambda words: words.code)
def test_every_language_fills_in_the_same_things(words: object) -> None:
    for entry in fields(ENGLISH):
        own, ours = getattr(words, entry.name), getattr(ENGLISH, entry.name)
        for a, b in zip(
            own.values() if isinstance(own, dict) else [own],
            ours.values() if isinstance(ours, dict) else [ours],
            strict=True,
        ):
            assert set(re.findall(r"{\w+}", a)) <= set(re.findall(r"{\w+}", b)), entry.name
        if isinstance(own, dict):
            assert own.keys() == ours.keys()


def test_a_common_name_is_without_the_running_number() -> None:
    assert common_name(["screw_M4x16_4", "screw_M4x16_1"]) == "screw_M4x16"
    assert common_name(["bolt", "nut"]) == "bolt"
    assert common_name(["bolt_6"]) == "bolt_6"
    assert common_name(["1", "2"]) == "1"


def test_the_bill_counts_parts_of_one_shape() -> None:
    plan, assembly = stacked_blocks()
    manual = make_manual(plan, assembly)
    (row,) = manual.bill
    assert (row.number, row.label, len(row.names)) == (1, "block", 4)
    assert row.size == pytest.approx([0.04, 0.03, 0.02])
    assert [task.number for task in manual.tasks] == [1, 2, 3, 4]


def test_a_subassembly_is_a_chapter_before_the_product() -> None:
    plan, assembly = paired_blocks()
    manual = make_manual(plan, assembly)
    assert [chapter.letter for chapter in manual.chapters] == ["A", ""]
    assert manual.chapters[0].members == ("block_2", "block_3")
    assert [task.labels for task in manual.tasks] == [("3.1",), ("3.2",), ("1",), ("2",), ("3",)]
    assert manual.tasks[-1].brings == "A"


def bolted_plate() -> tuple[AssemblyPlan, Assembly]:
    """Return a plan that drops four screws into a plate."""
    key = solids.rod(0.0017, 0.002, (0.0, 0.0, 0.0031), segments=6)
    driven = part(
        "screw", solids.rod(0.0035, 0.004, (0.0, 0.0, 0.002)) + solids.rod(0.002, 0.012, (0.0, 0.0, -0.006)) - key
    )
    parts = [part("plate", solids.box((0.08, 0.08, 0.02)))]
    steps = [Step(part="plate", fixed=(), motion=Motion(T_world_part=np.eye(4)[None], segments=()), contact=None)]
    for k, (x, y) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1)), start=1):
        T = se3.make(translation=np.array([0.03 * x, 0.03 * y, 0.01]))
        motion = Motion(
            T_world_part=np.array([se3.make(translation=0.02 * UP) @ T, T]),
            segments=(Segment(kind="insertion", start=0, stop=1),),
        )
        steps.append(Step(part=f"screw_{k}", fixed=tuple(p.name for p in parts), motion=motion, contact=None))
        parts.append(replace(driven, name=f"screw_{k}", T_world_part=T))
    names = tuple(each.name for each in parts)
    plan, _ = stacked_blocks()
    plan = replace(plan, parts={p.name: p.T_world_part for p in parts}, order=names, steps=tuple(steps))
    return plan, Assembly(parts=tuple(parts), identical=(names[1:],))


def test_alike_fasteners_come_in_one_task_and_others_do_not() -> None:
    plan, assembly = bolted_plate()
    manual = make_manual(plan, assembly)
    assert [len(task.steps) for task in manual.tasks] == [1, 4]
    held = replace(plan.steps[3], held=("screw_3",))
    split = make_manual(replace(plan, steps=(*plan.steps[:3], held, plan.steps[4])), assembly)
    assert [len(task.steps) for task in split.tasks] == [1, 2, 1, 1]
    blocks, solid = stacked_blocks()
    assert [len(task.steps) for task in make_manual(blocks, solid).tasks] == [1, 1, 1, 1]


def arrows_and_mouths(plan: AssemblyPlan, assembly: Assembly) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of the last task's picture: where each arrow ends, and the mouth that it is for."""
    draw = Illustrator(plan, assembly, replace(SMALL, width=960, height=600))
    marks = [draw.task(task) for task in make_manual(plan, assembly).tasks][-1].marks
    tips = [np.array(mark.points[-1]) for mark in marks if mark.kind == "arrow"]
    return list(zip(tips, [np.array(mark.points[0]) for mark in marks if mark.kind == "way on"], strict=True))


def test_each_of_several_fasteners_has_an_arrow_to_its_own_hole() -> None:
    found = arrows_and_mouths(*bolted_plate())
    assert len(found) == 4
    for tip, mouth in found:
        assert tip == pytest.approx(mouth)
    assert len({tuple(np.round(tip)) for tip, _ in found}) == 4


def test_a_wide_plate_is_drawn_so_far_back_that_its_arrow_fits_below() -> None:
    post, lid = part("post", solids.box((0.02, 0.02, 0.06))), part("lid", solids.box((0.08, 0.08, 0.002)))
    lid = replace(lid, T_world_part=se3.make(translation=0.031 * UP))
    steps = (
        Step(part="post", fixed=(), motion=Motion(T_world_part=np.eye(4)[None], segments=()), contact=None),
        Step(
            part="lid",
            fixed=("post",),
            motion=Motion(
                T_world_part=np.array([se3.make(translation=0.05 * UP) @ lid.T_world_part, lid.T_world_part]),
                segments=(Segment(kind="insertion", start=0, stop=1),),
            ),
            contact=None,
        ),
    )
    plan, _ = stacked_blocks()
    parts = (post, lid)
    plan = replace(plan, parts={p.name: p.T_world_part for p in parts}, order=("post", "lid"), steps=steps)
    ((tip, mouth),) = arrows_and_mouths(plan, Assembly(parts=parts))
    assert tip == pytest.approx(mouth), "the arrow is not beside the lid"


def test_an_arrow_without_room_is_drawn_beside_what_comes() -> None:
    own = np.zeros((100, 100), dtype=bool)
    own[20:60, 30:70] = True
    below = np.array([[50.0, 40.0], [50.0, 98.0]])
    assert not has_room(below, own)
    assert not has_room(np.array([[50.0, 40.0], [50.0, 40.0]]), own)
    (x, _), (x_end, _) = straight_arrow(below, own).points
    assert x == x_end > 70
    wide = np.pad(own, ((0, 100), (0, 0)))
    assert has_room(np.array([[50.0, 40.0], [50.0, 150.0]]), wide)


def test_the_cover_lists_the_tools_of_the_tasks_and_what_the_colours_mean() -> None:
    plan, assembly = bolted_plate()
    text = " ".join(read(render_manual(plan, assembly, pictures=SMALL)).words)
    assert text.count("hex key 3 mm") == 2, "on the cover, and in the task that needs it"
    assert ENGLISH.coming in text
    assert ENGLISH.ends in text
    assert ENGLISH.held not in text
    held = replace(plan.steps[-1], held=("screw_4",))
    text = " ".join(read(render_manual(replace(plan, steps=(*plan.steps[:4], held)), assembly, pictures=SMALL)).words)
    assert ENGLISH.held in text
    assert "The drawing shows nothing that holds screw_4: fasten before you let go." in text


def test_many_parts_of_one_shape_are_counted_rather_than_named() -> None:
    plan, assembly = bolted_plate()
    page = _Page_of_manual(plan, assembly, ENGLISH, SMALL, None)
    assert page._counted(["screw_1", "screw_2", "plate"]) == ["screw_1", "screw_2", "plate"]
    assert page._counted(["screw_1", "plate", "screw_2", "screw_3"]) == ["3 × screw", "plate"]


def test_the_viewer_stands_where_the_way_is_not_hidden() -> None:
    # a wall before the part on all sides but one
    walls = (
        box_at((-0.06, -0.05, 0.0), (-0.05, 0.05, 0.2)),
        box_at((-0.05, 0.05, 0.0), (0.05, 0.06, 0.2)),
        box_at((-0.05, -0.06, 0.0), (0.05, -0.05, 0.2)),
        box_at((-0.06, -0.06, 0.2), (0.06, 0.06, 0.21)),
    )
    part = box_at((-0.01, -0.01, 0.05), (0.01, 0.01, 0.07))
    target = Solid(points=part.points - 0.05 * UP, faces=part.faces, color=part.color)
    subject = Subject(
        fixed=walls,
        moving=(part,),
        target=(target,),
        way=np.array([[0.0, 0.0, z] for z in (0.05, 0.03, 0.0)]),
        direction=-UP,
    )
    stand = choose_stand(subject, UP, None)
    assert abs(np.degrees(stand.azimuth)) % 360 < 60 or abs(np.degrees(stand.azimuth)) % 360 > 300
    assert visibility(subject, look_from(UP, stand.azimuth, stand.elevation)).moving > 0.9
    behind = look_from(UP, np.pi, 0.2)
    assert visibility(subject, behind).moving < 0.1
    assert 0 in choose_glass(subject, behind)
    assert choose_glass(subject, look_from(UP, stand.azimuth, stand.elevation)) == frozenset()


def test_the_viewer_stays_where_he_is_if_nothing_speaks_against_it() -> None:
    part = box_at((-0.01, -0.01, 0.05), (0.01, 0.01, 0.07))
    subject = Subject(fixed=(), moving=(part,), target=(part,), way=np.zeros((0, 3)), direction=-UP)
    last = Stand(azimuth=float(np.radians(135.0)), elevation=0.5)
    stand = choose_stand(subject, UP, last)
    assert np.degrees(stand.azimuth) == pytest.approx(135.0)
    assert stand.elevation == 0.5


def test_places_that_are_not_drawn_are_not_better(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same place is chosen when all 48 are drawn."""
    rng = np.random.default_rng(0)
    drawn = 0

    def counted(subject: Subject, R: np.ndarray) -> Visibility:
        nonlocal drawn
        drawn += 1
        return visibility(subject, R)

    def some_box() -> Solid:
        low = rng.uniform(-0.05, 0.05, 3)
        return box_at(tuple(low), tuple(low + rng.uniform(0.01, 0.06, 3)))

    monkeypatch.setattr(camera, "visibility", counted)
    last: Stand | None = None
    for _ in range(8):
        moving, target = some_box(), some_box()
        subject = Subject(
            fixed=tuple(some_box() for _ in range(4)), moving=(moving,), target=(target,),
            way=np.linspace(moving.points.mean(axis=0), target.points.mean(axis=0), 12), direction=-UP,
        )  # fmt: skip
        found = choose_stand(subject, UP, last)
        with monkeypatch.context() as everywhere:
            everywhere.setattr(camera, "_MOST_SEEN", np.inf)
            assert choose_stand(subject, UP, last) == found
        last = found
    assert drawn < 8 * 48 + 8 * 40, "fewer than all the first time"


def test_the_page_stands_alone_and_says_what_to_do(tmp_path: Path) -> None:
    plan, assembly = stacked_blocks(unsolved=1)
    plan = replace(
        plan,
        fixture=Fixture(parts=("block_0",), height=0.012, reason="it would tip"),
        hands=1,
        executable=False,
        steps=(plan.steps[0], replace(plan.steps[1], held=("block_1",), hands=2), plan.steps[2]),
    )
    page = write_manual(plan, assembly, tmp_path / "manual.html", pictures=SMALL).read_text(encoding="utf-8")
    parser = read(page)
    text = " ".join(parser.words)
    for said in (
        "Hold block_0 in a fixture, its lowest point 12 mm above the table.",
        "Down 50 mm.",
        "Hold block_1 so that nothing falls or tips.",
        "Let go of block_1.",
        "Needs 2 hands at once.",
        "The plan has no grasp here",
        "block_3: no way in was found.",
    ):
        assert said in text, said
    links = [value for _, attributes in parser.tags for key, value in attributes.items() if key in ("src", "href")]
    assert links
    for link in links:
        assert link is not None
        assert base64.b64decode(link.removeprefix("data:image/png;base64,")).startswith(b"\x89PNG")
    assert "<script" not in page
    assert [tag for tag, attributes in parser.tags if tag == "article" and attributes.get("id") == "step2"]
    assert not list(tmp_path.glob(".*"))


def test_what_is_held_on_is_told_apart_from_what_is_held_anew() -> None:
    plan, assembly = stacked_blocks()
    held = ((), ("block_1",), ("block_1", "block_2"), ("block_2",))
    steps = tuple(replace(step, held=names) for step, names in zip(plan.steps, held, strict=True))
    tasks = make_manual(replace(plan, steps=steps), assembly).tasks
    assert [(task.kept, task.let_go) for task in tasks] == [
        ((), ()),
        ((), ()),
        (("block_1",), ()),
        (("block_2",), ("block_1",)),
    ]
    text = " ".join(read(render_manual(replace(plan, steps=steps), assembly, pictures=SMALL)).words)
    for said in ("Keep holding block_1.", "Hold block_2 so that", "Let go of block_1."):
        assert said in text


def test_hostile_names_stay_text() -> None:
    plan, assembly = stacked_blocks(HOSTILE_NAMES)
    page = render_manual(plan, assembly, pictures=SMALL)
    parser = read(page)
    assert "<script" not in page
    assert not any(key.startswith("on") for _, attributes in parser.tags for key in attributes)


@pytest.mark.parametrize("language", LANGUAGES)
def test_each_language_makes_a_page_of_a_plan_with_a_subassembly(language: str) -> None:
    plan, assembly = paired_blocks()
    parser = read(render_manual(plan, assembly, language=language, pictures=SMALL))
    assert parser.tags[0] == ("html", {"lang": language})
    assert LANGUAGES[language].subassembly.format(letter="A") in " ".join(parser.words)


def test_the_same_plan_gives_the_same_page() -> None:
    plan, assembly = stacked_blocks()
    assert render_manual(plan, assembly, pictures=SMALL) == render_manual(plan, assembly, pictures=SMALL)


def test_a_single_part_and_a_part_without_a_way_have_pages_too() -> None:
    plan, assembly = stacked_blocks(NAMES[:1])
    assert "Step 1" in render_manual(plan, assembly, pictures=SMALL)


def test_print_makes_a_pdf(tmp_path: Path) -> None:
    if find_browser() is None:
        pytest.skip("no Chromium found")
    plan, assembly = stacked_blocks()
    page = write_manual(plan, assembly, tmp_path / "manual.html", pictures=SMALL)
    pdf = print_page(page, tmp_path / "manual.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manual.html", "manual.pdf"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_has_to_give_is_told_at_its_step(language: str) -> None:
    plan, assembly = stacked_blocks()
    fit = DeclaredFit(parts=("block_3", "block_2"), kind="snap", depth=0.35e-3, reason="elastic: 0.31 mm has to give")
    bare, told = (render_manual(p, assembly, language=language, pictures=SMALL) for p in (plan, with_fit(plan, fit)))
    words = LANGUAGES[language].gives.format(part="block_3", depth="0.35")
    assert "".join(read(told).words).count(words) == 1
    assert words not in "".join(read(bare).words)
    scene = make_scene(with_fit(plan, fit), assembly, ViewConfig())
    assert f"Fit declared: block_3 and block_2, snap; {fit.reason}" in scene.json["notes"]


def with_fit(plan: AssemblyPlan, fit: DeclaredFit) -> AssemblyPlan:
    return replace(plan, fits=(fit,))

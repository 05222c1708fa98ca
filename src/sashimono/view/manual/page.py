"""The instructions as one page: it needs no network, and prints on A4."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from pathlib import Path

import numpy as np

from sashimono.assembly import Assembly
from sashimono.files import atomic_write
from sashimono.plan import AssemblyPlan
from sashimono.view.config import ViewConfig
from sashimono.view.explode import explode
from sashimono.view.manual.arrows import Mark
from sashimono.view.manual.content import BillRow, Chapter, Manual, Task, make_manual
from sashimono.view.manual.pictures import OVERVIEW, Illustration, Illustrator, PictureConfig
from sashimono.view.words import (
    LANGUAGES,
    Words,
    length_words,
    names_words,
    size_words,
    tool_words,
    way_lines,
    way_words,
)

Progress = Callable[[int, int], None]
"""Called with how many pictures are done, and of how many."""


def render_manual(
    plan: AssemblyPlan,
    assembly: Assembly,
    *,
    language: str = "en",
    pictures: PictureConfig | None = None,
    progress: Progress | None = None,
) -> str:
    """Return the instructions as the text of an HTML page; see `write_manual`."""
    return _Page(plan, assembly, LANGUAGES[language], pictures or PictureConfig(), progress).text()


def write_manual(
    plan: AssemblyPlan,
    assembly: Assembly,
    path: str | Path,
    *,
    language: str = "en",
    pictures: PictureConfig | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write work instructions for a person as one self-contained page, and return its path.

    A cover with the exploded product and the bill of materials, then a picture for each task: what stands in grey,
    what comes in orange, what must be held in blue, an arrow with its way in words, the tool, and warnings.
    Pictures are drawn on the processor.

    Args:
        plan: What is to be done.
        assembly: The geometry of the plan's parts.
        path: The file to write.
        language: A code: "en", "de" or "ja".
        pictures: How pictures are made.
        progress: Called with how many pictures are done, and of how many.

    Raises KeyError for a language that is not there, and OSError if ``path`` cannot be written; an earlier file is
    then still whole.
    """
    text = render_manual(plan, assembly, language=language, pictures=pictures, progress=progress)
    with atomic_write(path) as scratch:
        scratch.write_bytes(text.encode("utf-8"))
    return Path(path)


def _image(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def _escape(text: str) -> str:
    return html.escape(text)


def _breakable(text: str) -> str:
    """Text in which a line may break after an underscore, but not before a running number."""
    return re.sub(r"_(?!\d+\b)", "_<wbr>", _escape(text))


def _sentence(text: str, words: Words) -> str:
    return text[:1].upper() + text[1:] + words.stop


class _Page:
    def __init__(
        self, plan: AssemblyPlan, assembly: Assembly, words: Words, config: PictureConfig, progress: Progress | None
    ) -> None:
        self._plan, self._assembly, self._words = plan, assembly, words
        self._manual: Manual = make_manual(plan, assembly)
        self._draw = Illustrator(plan, assembly, config)
        self._up = self._manual.chapters[-1].up
        self._thumbnails: dict[str, str] = {}
        self._labels_of = {name: row.label for row in self._manual.bill for name in row.names}
        self._glass = False
        self._progress = progress

    def text(self) -> str:
        """The page."""
        manual, words = self._manual, self._words
        title = f"{manual.title} · {words.manual}"
        count = len(manual.tasks)
        chapters = []
        done = 0
        for chapter in manual.chapters:
            tasks = []
            for task in chapter.tasks:
                tasks.append(self._task(task, chapter))
                done += 1
                if self._progress is not None:
                    self._progress(done, count)
            chapters.append(self._chapter(chapter, tasks))
        style = resources.files("sashimono.view.manual").joinpath("manual.css").read_text(encoding="utf-8")
        return (
            f'<!doctype html>\n<html lang="{words.code}">\n<head>\n<meta charset="utf-8">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{_escape(title)}</title>\n'
            f"<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
            f"{self._cover()}\n{''.join(chapters)}{self._unsolved()}</main>\n</body>\n</html>\n"
        )

    def _cover(self) -> str:
        manual, words = self._manual, self._words
        apart = explode(self._plan, self._assembly, ViewConfig())
        picture = self._draw.cover(manual.bill, self._up, apart)
        tools = [*dict.fromkeys(tool for task in manual.tasks if (tool := self._tool(task)) is not None)]
        # on A4 the picture leaves room for a short bill; a long one goes on on the next page
        height = max(100.0, 204.0 - 9.0 * len(manual.bill)) if len(manual.bill) <= 12 else 165.0
        notes = ""
        if manual.unsolved:
            notes = f'<p class="warning">{_escape(words.partial.format(count=len(manual.unsolved)))}</p>'
        elif manual.executable is False:
            notes = f'<p class="warning">{_escape(words.not_executable.format(hands=manual.hands))}</p>'
        tool_text = f"<p><b>{_escape(words.tools)}:</b> {_escape(words.comma.join(tools))}</p>" if tools else ""
        return (
            f'<section class="cover" style="--picture: {height}mm">\n<header>'
            f'<p class="kicker">{_escape(words.manual)}</p>'
            f"<h1>{_escape(manual.title)}</h1></header>\n{_figure(picture, (), manual.title)}\n"
            f"<h2>{_escape(words.parts)}</h2>\n{self._bill()}\n{tool_text}{notes}{self._legend()}</section>\n"
        )

    def _legend(self) -> str:
        """What the colours of the pictures mean, as far as they occur; made after the pictures."""
        words = self._words
        said = [("coming", words.coming), ("ends", words.ends)]
        if any(task.held or task.clamped for task in self._manual.tasks):
            said.append(("held", words.held))
        if self._glass:
            said.append(("glass", words.glass))
        keys = "".join(f'<span><i class="{key}"></i>{_escape(text)}</span> ' for key, text in said)
        return f'<p class="legend">{_escape(words.pictures)}: {keys}</p>'

    def _bill(self) -> str:
        words = self._words
        head = (words.number, "", words.part, words.quantity, words.size, words.kind)
        rows = "".join(
            f'<tr><td class="number">{row.number}</td><td>{self._thumbnail(row.names[:1])}</td>'
            f'<td class="name">{_breakable(row.label)}</td><td>{len(row.names)}</td>'
            f"<td>{_escape(size_words(row.size, words))}</td>"
            f"<td>{_escape(self._kind(row))}</td></tr>\n"
            for row in self._manual.bill
        )
        # what has no words is no heading
        heads = "".join(f"<th>{_escape(text)}</th>" if text else "<td></td>" for text in head)
        return f'<table class="bill"><thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table>'

    def _kind(self, row: BillRow) -> str:
        if row.fastener is None:
            return ""
        return f"{self._words.kinds.get(row.fastener.kind, row.fastener.kind)} {row.fastener.size}".strip()

    def _thumbnail(self, names: Sequence[str]) -> str:
        key = "\n".join(names)
        if key not in self._thumbnails:
            self._thumbnails[key] = _image(self._draw.thumbnail(names, self._up))
        return f'<img class="thumbnail" alt="" src="{self._thumbnails[key]}">'

    def _chapter(self, chapter: Chapter, tasks: Sequence[str]) -> str:
        words = self._words
        several = len(self._manual.chapters) > 1
        name = words.subassembly.format(letter=chapter.letter) if chapter.letter else words.product
        name = f"{name}: {chapter.product}" if chapter.product else name
        beside = f"<p>{_escape(words.turn_chapter)}</p>" if chapter.letter else ""
        head = f"<h2>{_escape(name)}</h2>{beside}" if several else ""
        return f'<section class="chapter">\n{head}{"".join(tasks)}</section>\n'

    def _task(self, task: Task, chapter: Chapter) -> str:
        words = self._words
        picture = self._draw.task(task)
        self._glass = self._glass or picture.glass
        name = self._name(task)
        label = way_lines(task.step.insertion, task.up, words, arrow=True)
        lines = [f'<p class="do">{_breakable(line)}</p>' for line in self._say(task, chapter, name)]
        lines += [f'<p class="tool">{_escape(line)}</p>' for line in self._tools(task)]
        lines += [f'<p class="hold">{_breakable(line)}</p>' for line in self._holds(task)]
        lines += [f'<p class="warning">{line}</p>' for line in self._warnings(task)]
        thumbnail = self._thumbnail(task.members if task.brings else task.members[:1])
        number = "" if task.brings else f'<span class="number">{task.row.number}</span>'
        return (
            f'<article class="task" id="step{task.number}">\n{_figure(picture, label, name)}\n'
            f'<div class="text"><h3>{_escape(words.step.format(number=task.number))}</h3>\n'
            f'<div class="brings">{thumbnail}{number}<b>{_breakable(name)}</b></div>\n{"".join(lines)}\n'
            f"{self._labels(task)}</div></article>\n"
        )

    def _labels(self, task: Task) -> str:
        """The steps' numbers in the plan, where they are not the task's own."""
        if task.labels == (str(task.number),):
            return ""
        return f'<p class="labels">{_escape(self._words.steps_of_plan)}: {_escape(", ".join(task.labels))}</p>'

    def _name(self, task: Task) -> str:
        words = self._words
        if task.brings:
            name = words.together.format(letter=task.brings)
            return f"{name}: {task.product}" if task.product else name
        if len(task.steps) == 1:
            return task.step.part
        if task.simultaneous:
            return names_words(task.members, words)
        return words.times.format(count=len(task.steps), part=task.row.label)

    def _say(self, task: Task, chapter: Chapter, name: str) -> list[str]:
        words = self._words
        if task.simultaneous:
            said = [f"{step.part}: {way_words(step.insertion, task.up, words)}{words.stop}" for step in task.steps]
            said.append(words.simultaneous)
        elif task.step.insertion:
            said = [_sentence(way_words(task.step.insertion, task.up, words) + self._seat(task), words)]
        elif task.step.moves:
            said = [_sentence(words.along.format(length="").strip(), words)]
        elif not task.placed:
            fixture = chapter.fixture
            said = [
                words.start.format(part=name)
                if fixture is None
                else words.start_in_fixture.format(part=name, height=length_words(fixture.height, words))
            ]
        else:
            said = [words.place.format(part=name)]
        if task.step.simultaneous and not task.simultaneous:
            said.append(words.with_others.format(parts=names_words(task.step.simultaneous, words)))
        if task.turned:
            said.insert(0, words.turn_over.format(letter=task.brings))
        if task.turns_product:
            held = task.step.held_before
            more = [words.hold_turned.format(parts=names_words(held, words))] if held else []
            said[:0] = [words.turn_product, *more]
        return said

    def _seat(self, task: Task) -> str:
        """What fasteners go through and into; nothing of other parts."""
        words = self._words
        found = [f for step in task.steps if not task.brings and (f := self._manual.fastener(step.part)) is not None]
        rings = [fastener for fastener in found if fastener.kind in ("nut", "washer")]
        shanks = [fastener for fastener in found if fastener not in rings]
        through = dict.fromkeys(name for fastener in shanks for name in fastener.clamps)
        into = dict.fromkeys(name for fastener in shanks for name in fastener.into)
        on = dict.fromkeys(name for fastener in rings for name in fastener.into)
        said = [
            template.format(parts=names_words(self._counted(names), words))
            for template, names in ((words.through, through), (words.into, into), (words.on, on))
            if names
        ]
        return "".join(words.comma + each for each in said)

    def _counted(self, names: Iterable[str]) -> list[str]:
        """Names, three and more parts of one shape as one: "6 × bolt"."""
        alike: dict[str, list[str]] = {}
        for name in names:
            alike.setdefault(self._labels_of.get(name, name), []).append(name)
        return [
            text
            for label, group in alike.items()
            for text in (group if len(group) < 3 else [self._words.times.format(count=len(group), part=label)])
        ]

    def _tool(self, task: Task) -> str | None:
        """What tightens the fasteners of a task; None if nothing does."""
        fastener = None if task.brings else self._manual.fastener(task.step.part)
        if fastener is None or fastener.kind not in ("screw", "bolt", "nut"):
            return None
        return tool_words(fastener, self._words)

    def _tools(self, task: Task) -> list[str]:
        words, said = self._words, []
        tool = self._tool(task)
        if tool is not None:
            turned = abs(task.step.turns) >= 0.2
            said.append(f"{words.tool}: {tool}" if turned else f"{words.tighten}: {tool}")
        grippers = [name for name, reason in task.step.grippers.items() if reason is None]
        if task.step.grippers:
            said.append(f"{words.gripper}: {words.comma.join(grippers) if grippers else words.no_gripper}")
        return said

    def _holds(self, task: Task) -> list[str]:
        words, said = self._words, []
        if task.let_go:
            said.append(words.let_go.format(parts=names_words(task.let_go, words)))
        if task.kept:
            said.append(words.keep.format(parts=names_words(task.kept, words)))
        if new := [name for name in task.held if name not in task.kept]:
            said.append(words.hold.format(parts=names_words(new, words)))
        if task.hands is not None and task.hands > self._manual.hands:
            said.append(words.hands.format(count=task.hands))
        if task.held and task is self._manual.tasks[-1] and not self._manual.unsolved:
            said.append(words.still_held.format(parts=names_words(task.held, words)))
        return said

    def _warnings(self, task: Task) -> list[str]:
        words, said = self._words, []
        step = task.step
        if step.moves and step.contact is None:
            detail = f"<small>{_escape(step.contact_reason)}</small>" if step.contact_reason else ""
            said.append(f"{_escape(words.no_contact)} {detail}")
        for each in task.steps:
            if each.tool is not None and not each.tool.access:
                name = tool_words(fastener, words) if (fastener := self._manual.fastener(each.part)) else each.tool.name
                detail = f"<small>{_escape(each.tool.reason or '')}</small>"
                said.append(f"{_escape(words.no_room.format(tool=name))} {detail}")
                break
        if step.declared is not None:
            said.append(_escape(words.declared))
        for fit in self._manual.fits:
            if any(
                len({*fit.parts} & {*each.members}) == 1 and {*fit.parts} & {*each.fixed, *each.simultaneous}
                for each in task.steps
            ):
                said.append(_breakable(words.gives.format(part=fit.parts[0], depth=f"{1e3 * fit.depth:.2g}")))
        if step.close_fits:
            others = [*dict.fromkeys(fit.other for fit in step.close_fits)]
            said.append(_escape(words.fitted.format(parts=names_words(others, words))))
        return said

    def _unsolved(self) -> str:
        manual, words = self._manual, self._words
        if not manual.unsolved:
            return ""
        alike: dict[str, list[str]] = {}
        for entry in manual.unsolved:
            alike.setdefault(entry.reason, []).append(entry.part)
        rows = "".join(
            f"<li>{''.join(self._thumbnail([name]) for name in names)}"
            f"<p>{_breakable(words.unsolved_part.format(part=words.comma.join(names)))}</p>"
            f"<small>{_escape(reason)}</small></li>\n"
            for reason, names in alike.items()
        )
        return f'<section class="unsolved">\n<h2>{_escape(words.unsolved)}</h2>\n<ul>{rows}</ul></section>\n'


def _figure(picture: Illustration, lines: Sequence[str], name: str) -> str:
    """The picture with its marks, as inline SVG; the first arrow gets the lines of words."""
    shapes = []
    words_left = list(lines)
    arrows = [np.array(mark.points) for mark in picture.marks if mark.kind in ("arrow", "turn")]
    taken: list[tuple[float, float, float, float]] = []
    if picture.overview is not None:
        shapes.append(_overview(picture))
        left, top = picture.overview_corner
        taken.append((float(left), float(top), float(OVERVIEW[0]), float(OVERVIEW[1])))
    for mark in picture.marks:
        shapes.append(_SHAPES[mark.kind](mark))
        if mark.kind == "arrow" and words_left:
            shapes.append(_label(words_left, mark, arrows, picture, taken))
            words_left = []
    return (
        f'<svg class="picture" viewBox="0 0 {picture.width} {picture.height}" role="img" aria-label="{_escape(name)}">'
        f'<image width="{picture.width}" height="{picture.height}" href="{_image(picture.png)}"/>'
        f"{''.join(shapes)}</svg>"
    )


def _overview(picture: Illustration) -> str:
    left, top = picture.overview_corner
    x, y, wide, high = picture.overview_frame
    x0, y0 = max(x, 1.0), max(y, 1.0)
    x1, y1 = min(x + wide, OVERVIEW[0] - 1.0), min(y + high, OVERVIEW[1] - 1.0)
    assert picture.overview is not None
    return (
        f'<g transform="translate({left} {top})"><image width="{OVERVIEW[0]}" height="{OVERVIEW[1]}" '
        f'href="{_image(picture.overview)}"/><rect class="border" width="{OVERVIEW[0]}" height="{OVERVIEW[1]}"/>'
        f'<rect class="frame" x="{x0:.1f}" y="{y0:.1f}" width="{max(4.0, x1 - x0):.1f}" '
        f'height="{max(4.0, y1 - y0):.1f}"/></g>'
    )


def _line(points: Sequence[tuple[float, float]]) -> str:
    return "M" + " L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _arrow(mark: Mark) -> str:
    points = np.array(mark.points)
    size = 20.0
    # the head is as long as the line's last pixels, which may be bent
    left = np.concatenate([np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)[::-1])[::-1], [0.0]])
    tip = points[-1]
    foot = points[int(np.flatnonzero(left >= min(size, left[0])).max())]
    ahead = (tip - foot) / max(float(np.linalg.norm(tip - foot)), 1e-9)
    across = np.array([-ahead[1], ahead[0]])
    head = [tip, tip - size * ahead + 0.5 * size * across, tip - size * ahead - 0.5 * size * across]
    shaft = [*(mark.points[k] for k in range(len(points)) if left[k] > size), tuple(tip - 0.8 * size * ahead)]
    if len(shaft) == 1:
        shaft.insert(0, mark.points[0])
    path, corners = _line(shaft), " ".join(f"{x:.1f},{y:.1f}" for x, y in head)
    return (
        f'<path class="halo" d="{path}"/><polygon class="halo" points="{corners}"/>'
        f'<path class="arrow" d="{path}"/><polygon class="head" points="{corners}"/>'
    )


def _trail(mark: Mark) -> str:
    return f'<path class="{"trail" if mark.kind == "trail" else "on"}" d="{_line(mark.points)}"/>'


def _balloon(mark: Mark) -> str:
    (x, y), (u, v) = mark.points
    return (
        f'<path class="leader" d="{_line(mark.points)}"/><circle class="dot" cx="{u:.1f}" cy="{v:.1f}" r="4"/>'
        f'<circle class="balloon" cx="{x:.1f}" cy="{y:.1f}" r="23"/>'
        f'<text class="balloon-text" x="{x:.1f}" y="{y + 8.5:.1f}">{_escape(mark.text)}</text>'
    )


_SHAPES = {"arrow": _arrow, "turn": _arrow, "trail": _trail, "way on": _trail, "balloon": _balloon}


def _label(
    lines: Sequence[str],
    mark: Mark,
    arrows: Sequence[np.ndarray],
    picture: Illustration,
    taken: list[tuple[float, float, float, float]],
) -> str:
    """The words of an arrow, a line a leg, near it, where least is drawn."""
    size = 26.0
    wide = 10.0 + size * max(sum(1.0 if ord(letter) > 0x2E80 else 0.66 for letter in text) for text in lines)
    high = 1.25 * size * len(lines) + 0.25 * size
    line = np.array(mark.points)
    best, least = (0.0, 0.0), np.inf
    for anchor in (line.mean(axis=0), line[0], line[-1]):
        for angle in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
            for reach in (20.0, 60.0, 120.0):
                toward = np.array([np.cos(angle), np.sin(angle)])
                middle = anchor + toward * reach + 0.5 * toward * [wide, high]
                x, y = middle - 0.5 * np.array([wide, high])
                x = float(np.clip(x, 4.0, max(4.0, picture.width - wide - 4.0)))
                y = float(np.clip(y, 4.0, picture.height - high - 4.0))
                cost = _crowd(x, y, wide, high, arrows, picture, taken) + reach / 200.0
                if cost < least:
                    best, least = (x, y), cost
    x, y = best
    return "".join(
        f'<text class="way" x="{x + 5.0:.1f}" y="{y + (1.0 + 1.25 * k) * size:.1f}">{_escape(text)}</text>'
        for k, text in enumerate(lines)
    )


def _crowd(
    x: float,
    y: float,
    wide: float,
    high: float,
    arrows: Sequence[np.ndarray],
    picture: Illustration,
    taken: Sequence[tuple[float, float, float, float]],
) -> float:
    """How much lies below words in this box: what is drawn, the arrows, the overview."""
    cells = picture.busy[int(y // 8) : int((y + high) // 8) + 1, int(x // 8) : int((x + wide) // 8) + 1]
    cost = float(cells.mean()) if cells.size else 1.0
    for line in arrows:
        ahead = (line[-1] - line[-2]) / max(float(np.linalg.norm(line[-1] - line[-2])), 1e-9)
        along = np.linspace(line[0], line[-1] + 60.0 * ahead, 20)
        inside = (along > [x - 8, y - 8]) & (along < [x + wide + 8, y + high + 8])
        cost += 2.0 * float(inside.all(axis=1).mean())
    for left, top, w, h in taken:
        if x < left + w and x + wide > left and y < top + h and y + high > top:
            cost += 3.0
    return cost

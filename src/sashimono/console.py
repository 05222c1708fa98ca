"""What the command line shows: progress, and the summary of a plan."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from textwrap import shorten

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, few_words
from sashimono.plan import AssemblyPlan, DeclaredHelix, OrderCost, Step, Unsolved, fit_words
from sashimono.reporting import event, reporting

MAX_OVERLAPS = 5
"""Pairs named in the summary."""

REASON_WIDTH = 80
"""Longer reasons for a missing contact are cut in the summary; plan.json has them whole."""


@contextmanager
def progress_display() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a callback for (stage, done, total): bars on a terminal, one line a finished stage otherwise.

    Both go to standard error. If JSON lines are asked for, there is an object each time, on standard output.
    """
    wanted = reporting()
    if wanted.quiet or wanted.json_lines:
        yield lambda stage, done, total: event("progress", stage=stage, done=done, total=total)
        return
    if not sys.stderr.isatty():
        yield _line_progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<10}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        tasks = {}

        def update(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done, total=total)

        yield update


def _line_progress(stage: str, done: int, total: int) -> None:
    if done == total:
        sys.stderr.write(f"{stage}: {done} of {total}\n")


def summary_lines(plan: AssemblyPlan, assembly: Assembly) -> list[str]:
    """Return the plan in words: a line for the whole, one a step in assembly order, one for each unsolved part."""
    verdict = "complete and verified" if plan.status == "complete" else "partial"
    verdict += f", {fit_words(len(plan.fits))}" if plan.fits else ""
    width = max((len(name) for name in (*plan.parts, *(entry.name for entry in plan.products))), default=0)
    return [
        f"{verdict}: {len(plan.placed)} of {len(assembly)} parts placed{_bought_words(plan)}",
        plan.verdict,
        *([] if plan.cost is None else [_cost_line(plan.cost)]),
        *_step_lines(plan.steps, width, ""),
        *_unsolved_lines(plan, width),
        *(f"fit declared: {' and '.join(fit.parts)}, {fit.kind}; {fit.reason}" for fit in plan.fits),
        *_product_lines(plan),
        *_overlap_lines(plan),
    ]


def _bought_words(plan: AssemblyPlan) -> str:
    """How many of the parts are sets of parts of the input that no product there holds together."""
    count = sum(bool(entry.members) for entry in plan.source.kept)
    return f", {count} of them several parts taken as bought (--flat: apart)" if count else ""


PLANNED = {
    "subassembly": "put together on a bench of its own",
    "base": "put together first, where it stands",
    "apart": "not put together by itself",
}
"""What became of a product."""


def _product_lines(plan: AssemblyPlan) -> Iterator[str]:
    """One for each product of the input's tree: what became of it, and why."""
    for entry in plan.source.kept:
        what = f"{entry.product}: {len(entry.members)} parts are" if entry.members else f"product {entry.product}:"
        yield f"{what} one part, {entry.reason}"
    for entry in plan.products:
        yield f"product {entry.name}: {PLANNED[entry.planned]}{f' ({entry.reason})' if entry.reason else ''}"


def _overlap_lines(plan: AssemblyPlan) -> list[str]:
    """Pairs that share volume in the CAD: the worst, and how many more plan.json lists."""
    shown = [
        f"overlap in the CAD: {pair.first} and {pair.second}, {1e9 * pair.volume:.3g} mm³, "
        f"{100.0 * pair.fraction:.2g} % of the smaller"
        for pair in plan.overlaps[:MAX_OVERLAPS]
    ]
    more = len(plan.overlaps) - len(shown)
    return [*shown, f"and {more} more pairs, see overlaps in plan.json"] if more > 0 else shown


def _step_lines(steps: Sequence[Step], width: int, indent: str) -> Iterator[str]:
    """Yield a line a step; below a subassembly's, indented, those by which it was put together before."""
    for k, step in enumerate(steps, 1):
        yield f"{indent}{k:4d} {step.product or step.part:<{width}}  {_step_words(step)}"
        yield from _alternative_lines(step, width, indent)
        if step.subassembly is not None:
            yield from _step_lines(step.subassembly.steps, width, indent + "     ")


def _cost_line(cost: OrderCost) -> str:
    """What the order costs, in one line: the terms that there are, each with what it counts."""
    parts = [
        f"{term.replace('_', ' ')} {amount:.3g} x {cost.weights[term]:g}"
        for term, amount in cost.terms.items()
        if amount > 0.0 and term in cost.weights
    ]
    return f"cost of the order {cost.total:.4g}: {', '.join(parts) or 'nothing counts'}"


def _alternative_lines(step: Step, width: int, indent: str) -> Iterator[str]:
    """What else could have come at a step: what is possible first, by what it costs."""
    entries = step.alternatives or ()
    ranked = sorted(entries, key=lambda e: (not e.possible, 0.0 if e.more is None else e.more))
    for entry in ranked:
        said = f"possible, cost {entry.more:+.3g}" if entry.possible and entry.more is not None else "not possible"
        yield f"{indent}       or {entry.part:<{width}} {said}: {entry.reason}"


def _step_words(step: Step) -> str:
    words = ["turn the product over first"] if step.turned else []
    if step.held_before:
        words.append(f"then hold {few_words(step.held_before)}")
    if step.moving:
        words.append(f"subassembly of {len(step.moving)}: {', '.join(step.moving)}")
    words.append(_thread_words(step.declared) if step.declared else _direction_words(step.motion.T_world_part))
    if step.simultaneous:
        words.append(f"at the same time as {few_words(step.simultaneous)}")
    if len(step.motion.T_world_part) > 1:
        words.append(_contact_words(step))
    if step.tool is not None and step.tool.reason is not None:
        words.append(f"{step.tool.name}: {step.tool.reason}")
    if step.close_fits:
        words.append(f"close fit with {few_words([*dict.fromkeys(fit.other for fit in step.close_fits)])}")
    if step.held:
        words.append(f"hold {few_words(step.held)}")
    evidence = step.motion.evidence
    if "max_penetration" in evidence and "tolerance" in evidence:
        # below a nanometre it is rounding
        deepest, tolerance = (round(1e3 * evidence[name], 6) for name in ("max_penetration", "tolerance"))
        words.append(f"deepest {deepest:.3g} mm of {tolerance:.3g} mm")
    return ", ".join(words)


def _direction_words(T_world_part: Float[np.ndarray, "pose 4 4"]) -> str:
    """Name the direction in which the part arrives: an axis within half a degree, else its components."""
    if len(T_world_part) < 2:
        return "base, starts in place"
    travel = T_world_part[-1, :3, 3] - T_world_part[-2, :3, 3]
    length = float(np.linalg.norm(travel))
    if length == 0.0 or not np.allclose(T_world_part[-1, :3, :3], T_world_part[-2, :3, :3], atol=1e-6):
        return "turning"
    direction = travel / length
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > np.cos(np.radians(0.5)):
        return f"along {'-' if direction[axis] < 0 else '+'}{'xyz'[axis]}"
    return "along ({:.2f}, {:.2f}, {:.2f})".format(*direction)


def _thread_words(declared: DeclaredHelix) -> str:
    pitch = f"{1e3 * declared.pitch:.3g} mm"
    return f"screwed into {declared.other}, pitch {pitch} (declared: the CAD has no thread)"


def _contact_words(step: Step) -> str:
    if step.contact is None:
        return f"no grasp ({shorten(step.contact_reason or 'not planned', REASON_WIDTH, placeholder=' …')})"
    return f"{step.contact.kind} of quality {step.contact.quality:.3g}"


def _unsolved_lines(plan: AssemblyPlan, width: int) -> Iterator[str]:
    """One for each reason; of parts that hold one another, who blocks whom is left to plan.json."""
    alike: dict[tuple[str, str], list[Unsolved]] = {}
    for entry in plan.unsolved:
        alike.setdefault((entry.verdict, entry.reason), []).append(entry)
    for (answer, reason), entries in alike.items():
        if len(entries) == 1:
            blockers = ", ".join(entries[0].blocked_by)
            yield f"   - {entries[0].part:<{width}}  {answer}{f', blocked by {blockers}' if blockers else ''}: {reason}"
        else:
            more = f"and {len(entries) - 1} more: {', '.join(entry.part for entry in entries[1:])}"
            yield f"   - {entries[0].part:<{width}}  {answer}: {reason}"
            yield f"     {'':<{width}}  {more}"

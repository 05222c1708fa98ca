"""The examination: one call from what was read to what is to be said about it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from sashimono.assembly import few_words, millimetres
from sashimono.bodies import make_bodies
from sashimono.examination.config import DoctorConfig
from sashimono.examination.findings import Clearance, Diagnosis, Finding, PairOverlap, Treatment
from sashimono.examination.hidden import shut_in, unseen
from sashimono.examination.pairs import Pairs
from sashimono.examination.size import metric_doubt, size_and_unit
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.io.checks import folded_words
from sashimono.io.read import Inspection

_RANK = {"error": 0, "warning": 1, "note": 2}
_SHOWN = 8
"""Names in one message."""


def examine(inspection: Inspection, *, config: DoctorConfig | None = None) -> Diagnosis:
    """Return what an input is like: size and unit, surfaces, overlaps, clearances, fasteners, what hides and floats.

    No motion is planned. ``Diagnosis.ok`` says whether nothing stands in the way of a plan.

    Args:
        inspection: What `sashimono.io.read.inspect_assembly` read.
        config: When something is worth saying.
    """
    config = config or DoctorConfig()
    assembly, broken = inspection.assembly, inspection.broken
    everything = [*assembly.parts, *(part for part, _ in broken)]
    boxes = np.array([part.bounds_world for part in everything])
    bounds = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    bodies = make_bodies(assembly, config=config.samples)
    pairs = Pairs(assembly, bodies, config)
    fasteners = find_fasteners(assembly, config=config.fasteners)
    overlaps = pairs.overlaps(fasteners)
    unit = "m" if assembly.source is None else assembly.source.unit
    words, findings = size_and_unit(bounds, unit, stated=inspection.unit_stated, config=config)
    findings += metric_doubt(fasteners, unit, config)
    findings += _surfaces(inspection, config)
    findings += _overlaps(overlaps, inspection)
    locked = shut_in(assembly)
    findings += _shut(locked)
    findings += _apart(pairs, {part for part, _ in locked}, config)
    if len(assembly):
        hidden = unseen(assembly, bodies, [part for part, _ in broken], config)
        findings += _unseen([name for name in hidden if name not in {part for part, _ in locked}])
    findings += _clearances(pairs.clearances)
    findings += _solids(assembly.notes)
    return Diagnosis(
        assembly=assembly,
        broken=broken,
        size=(
            float(bounds[1, 0] - bounds[0, 0]),
            float(bounds[1, 1] - bounds[0, 1]),
            float(bounds[1, 2] - bounds[0, 2]),
        ),
        size_words=words,
        findings=tuple(sorted(findings, key=lambda finding: _RANK[finding.severity])),
        overlaps=overlaps,
        clearances=pairs.clearances,
        fasteners=fasteners,
        touching=pairs.touching,
        treatments=tuple(_treatments(inspection, overlaps, fasteners, dict(locked))),
    )


def _some(names: Sequence[str]) -> str:
    return few_words(names, _SHOWN)


def _examples(items: Sequence[str], most: int = 4) -> str:
    return "; ".join(items[:most]) + ("; ..." if len(items) > most else "")


def _surfaces(inspection: Inspection, config: DoctorConfig) -> Iterable[Finding]:
    for part, problem in inspection.broken:
        yield Finding(
            kind="surface", severity="error", parts=(part.name,), message=f"{part.name}: {problem}.",
            way_out="Close it in the CAD program or a mesh tool, or leave it out with --exclude.",
        )  # fmt: skip
    for name, count in inspection.folded.items():
        yield Finding(
            kind="surface", severity="warning", parts=(name,), message=f"{name}: {folded_words(count)}.",
            way_out="Export it finer; a motion near the folds may be refused.",
        )  # fmt: skip
    for name, done in inspection.mended.items():
        yield Finding(
            kind="surface", severity="note", parts=(name,), message=f"{name} was mended: {', '.join(done)}."
        )  # fmt: skip
    heavy = [part.name for part in inspection.assembly.parts if len(part.faces) > config.large_mesh]
    if heavy:
        yield Finding(
            kind="surface", severity="warning", parts=tuple(heavy),
            message=f"{_some(heavy)}: more than {config.large_mesh} triangles; planning is slow.",
            way_out="Export it coarser.",
        )  # fmt: skip


_OVERLAP_WORDS = {
    "thread": "threads drawn as plain cylinders, or screws in narrower holes",
    "press fit": "round fits with interference",
    "hole not drawn": "fasteners in material where no hole is drawn",
    "rounding": "faces a hair into one another, or facets of round fits",
}


def _overlaps(overlaps: Sequence[PairOverlap], inspection: Inspection) -> Iterable[Finding]:
    for pair in overlaps:
        both = f"{pair.first} and {pair.second}"
        if pair.guess == "duplicate":
            yield Finding(
                kind="duplicate", severity="error", parts=(pair.first, pair.second),
                message=f"{both} are one and the same in one place.",
                way_out=f"Leave one out: --exclude '{pair.second}'.",
            )  # fmt: skip
        elif pair.guess == "inside":
            inner = _smaller(inspection, pair)
            outer = pair.second if inner == pair.first else pair.first
            yield Finding(
                kind="inside", severity="error", parts=(inner, outer),
                message=f"{inner} lies wholly in the material of {outer}.",
                way_out="Cut the room for it in the CAD program, or leave it out with --exclude.",
            )  # fmt: skip
        elif pair.guess == "drawing error":
            depth = "" if pair.depth is None else f"{millimetres(pair.depth)} deep, "
            how_much = f"{depth}{100.0 * pair.fraction:.2g} % of the smaller"
            yield Finding(
                kind="overlap", severity="warning", parts=(pair.first, pair.second),
                message=f"{both} overlap: {how_much}. It looks like a drawing error.",
                way_out="A plan takes it as drawn: neither goes deeper into the other on its way.",
            )  # fmt: skip
    for guess, words in _OVERLAP_WORDS.items():
        alike = [pair for pair in overlaps if pair.guess == guess]
        if alike:
            which = _examples([f"{pair.first} and {pair.second}" for pair in alike])
            both = dict.fromkeys(name for pair in alike for name in (pair.first, pair.second))
            deepest = max((pair.depth for pair in alike if pair.depth is not None), default=None)
            depth = "" if deepest is None else f", at most {millimetres(deepest)} deep"
            yield Finding(
                kind="overlap", severity="note", parts=tuple(both),
                message=f"{words}{depth}, {len(alike)} in all: {which}.",
                way_out="--declare-threads turns screws in at the standard pitch." if guess == "thread" else "",
            )  # fmt: skip


def _shut(locked: Sequence[tuple[str, str]]) -> Iterable[Finding]:
    for name, other in locked:
        yield Finding(
            kind="hidden", severity="error", parts=(name, other),
            message=f"{name} lies in a cavity that {other} closes on all sides: nothing brings it there.",
            way_out=f"Divide {other} in the CAD program, or leave {name} out with --exclude.",
        )  # fmt: skip


def _apart(pairs: Pairs, known: Collection[str], config: DoctorConfig) -> Iterable[Finding]:
    touching = pairs.touching
    # of parts whose neighbours were not all looked at nothing is said
    unknown = {name for pair in pairs.left_out for name in pair}
    if unknown:
        yield Finding(
            kind="neighbours", severity="note", parts=(),
            message=f"{config.neighbours} pairs of neighbours were looked at for contact and clearance, and"
            f" {len(pairs.left_out)} were not.",
        )  # fmt: skip
    loose = [name for name, others in touching.items() if not others and name not in known and name not in unknown]
    if len(loose) > config.loose:
        more = loose[config.loose :]
        yield Finding(
            kind="floating", severity="warning", parts=tuple(more),
            message=f"nothing touches {len(more)} more parts: {_some(more)}.",
            way_out="They will count as held in the air; put them in contact, or leave them out with --exclude.",
        )  # fmt: skip
    for name in loose[: config.loose]:
        near = pairs.nearest(name)
        if near is not None:
            yield Finding(
                kind="floating", severity="warning", parts=(name,),
                message=f"nothing touches {name}; nearest is {near[0]}, {millimetres(near[1])} away.",
                way_out="It will count as held in the air; put it in contact, or leave it out with --exclude.",
            )  # fmt: skip
    groups = [group for group in _groups(touching) if len(group) > 1]
    if len(groups) > 1 and not unknown:
        shown = _examples([f"{len(group)} parts with {group[0]}" for group in groups])
        yield Finding(
            kind="groups", severity="warning", parts=tuple(group[0] for group in groups),
            message=f"the parts fall into {len(groups)} groups that touch nowhere: {shown}.",
            way_out="Check whether a part is missing between them.",
        )  # fmt: skip


def _groups(touching: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Parts that hang together by touching, the largest group first."""
    left, groups = dict.fromkeys(touching), []
    while left:
        group, ahead = [], [next(iter(left))]
        del left[ahead[0]]
        while ahead:
            group.append(ahead.pop())
            fresh = [name for name in touching[group[-1]] if name in left]
            ahead += fresh
            for name in fresh:
                del left[name]
        groups.append(group)
    return sorted(groups, key=len, reverse=True)


def _unseen(hidden: Sequence[str]) -> Iterable[Finding]:
    if hidden:
        yield Finding(
            kind="hidden", severity="note", parts=tuple(hidden),
            message=f"cannot be seen from outside: {_some(hidden)}.",
            way_out="The page (--html) shows them.",
        )  # fmt: skip


def _clearances(clearances: Sequence[Clearance]) -> Iterable[Finding]:
    if clearances:
        names = [f"{each.first} and {each.second} ({millimetres(each.gap)})" for each in clearances]
        yield Finding(
            kind="clearance", severity="note",
            parts=tuple(dict.fromkeys(name for each in clearances for name in (each.first, each.second))),
            message=f"tiny clearances, or facets of round fits, {len(clearances)} in all: "
            f"{_examples(names)}.",
            way_out="A plan treats it as contact; a robot needs compliance there.",
        )  # fmt: skip


def _solids(notes: Sequence[str]) -> Iterable[Finding]:
    for note in notes:
        if "--split" in note or ("holds" in note and "solids" in note):
            yield Finding(kind="solids", severity="note", parts=(note.partition(":")[0],), message=f"{note}.")


def _treatments(
    inspection: Inspection,
    overlaps: Sequence[PairOverlap],
    fasteners: Sequence[Fastener],
    locked: Mapping[str, str],
) -> Iterable[Treatment]:
    """What planning will do with each part, in part order; parts that it refuses last."""
    known = {fastener.part: fastener for fastener in fasteners}
    meeting = Counter(name for pair in overlaps if pair.guess != "rounding" for name in (pair.first, pair.second))
    doubles = {pair.second: pair.first for pair in overlaps if pair.guess == "duplicate"}
    swallowed = {name for pair in overlaps if pair.guess == "inside" for name in (_smaller(inspection, pair),)}
    threads = {name for pair in overlaps if pair.guess == "thread" for name in (pair.first, pair.second)}
    for part in inspection.assembly.parts:
        name = part.name
        if name in locked:
            yield Treatment(part=name, planned=False, how=f"cannot be put into the cavity of {locked[name]}")
        elif name in doubles:
            yield Treatment(part=name, planned=False, how=f"stands where {doubles[name]} is: leave it out (--exclude)")
        elif name in swallowed:
            yield Treatment(part=name, planned=False, how="has no room: it lies wholly in another part's material")
        elif name in known:
            yield Treatment(part=name, planned=True, how=_fastener_words(known[name], declared=name in threads))
        else:
            words = ["planned as it is" if name not in inspection.mended else "mended, then planned"]
            if meeting[name]:
                words.append(f"overlaps with {meeting[name]} other{'s' * (meeting[name] > 1)} are taken as drawn")
            if name in inspection.folded:
                words.append("depths near its folds are unsure")
            yield Treatment(part=name, planned=True, how="; ".join(words))
    for part, problem in inspection.broken:
        yield Treatment(part=part.name, planned=False, how=f"refused: {problem}")


def _smaller(inspection: Inspection, pair: PairOverlap) -> str:
    def bulk(name: str) -> float:
        return float(np.prod(np.ptp(inspection.assembly.part(name).bounds_world, axis=0)))

    return min((pair.first, pair.second), key=bulk)


def _fastener_words(fastener: Fastener, *, declared: bool) -> str:
    name = f"{fastener.kind} {fastener.size}".strip()
    if fastener.kind not in ("screw", "bolt", "nut"):
        return f"{name}: pushed along its axis"
    if fastener.thread_pitch is not None:
        return f"{name}: turned along the thread that is drawn"
    if declared:
        return f"{name}: pushed along its axis, as no thread is drawn; --declare-threads turns it"
    return f"{name}: pushed along its axis, as no thread is drawn"

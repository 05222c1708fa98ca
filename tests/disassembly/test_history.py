"""The same question has the same answer, whatever was asked before."""

from __future__ import annotations

import contextlib
import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solids import box_with_lid, pair_in_pair, peg_in_plate

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.errors import InputError

CONFIG = SeparateConfig(physics=PhysicsConfig(max_pushes=2, max_stretches=2))

TRUTH = ["bolt_stack", "enclosure9", "nested_cups6", "peg_press2pct"]


def said(separation: Separation) -> tuple[Any, ...]:
    way = None if separation.removal is None else separation.removal.displacements.round(12).tolist()
    return separation.answer, separation.stage, separation.blocked_by, separation.hits, separation.reason, way


def relation(cascade: Cascade) -> list[tuple[Any, ...]]:
    blocking = cascade.blocking
    return [
        (part, direction_index, blocking.masks(part, direction_index), blocking.blockers(part, direction_index))
        for part in range(len(blocking))
        for direction_index in range(blocking.count_directions)
    ]


def order(result: DisassemblyResult) -> list[tuple[Any, ...]]:
    left = [(entry.part, entry.members, *said(entry.separation)) for entry in result.departures()]
    return [*left, (result.base,), *((part, *said(separation)) for part, separation in result.stuck)]


def questions(count: int, rng: np.random.Generator, *, most: int) -> list[tuple[int, int]]:
    """All questions of small assemblies, some of larger ones."""
    sets = [mask for mask in range(1, 1 << count) if mask & (mask - 1)]
    if len(sets) > 12:
        sets = [(1 << count) - 1, *(int(mask) for mask in rng.choice(sets, 6, replace=False))]
    found = [(part, mask) for mask in sets for part in bits(mask)]
    return found if len(found) < most else [found[k] for k in sorted(rng.choice(len(found), most, replace=False))]


def check_history(parts: Assembly, *, most: int = 24) -> None:
    """Ask everything, then again in random order; plan before and after, and twice on one object."""
    rng = np.random.default_rng(0)
    bodies = make_bodies(parts)
    asked = questions(len(parts), rng, most=most)
    first, second = (Cascade(parts, bodies, config=CONFIG) for _ in range(2))
    answers = {question: said(first.separate(*question)) for question in asked}
    untouched = relation(Cascade(parts, bodies, config=CONFIG))
    plan = order(find_disassembly(second, config=SequenceConfig()))
    for k in rng.permutation(len(asked)):
        assert said(second.separate(*asked[k])) == answers[asked[k]], asked[k]
    assert relation(first) == untouched
    assert relation(second) == untouched
    assert order(find_disassembly(first, config=SequenceConfig())) == plan, "after other questions"
    assert order(find_disassembly(second, config=SequenceConfig())) == plan, "twice on one object"


@pytest.mark.parametrize("make", [box_with_lid, pair_in_pair, peg_in_plate])
def test_answers_do_not_depend_on_what_was_asked_before(make) -> None:
    check_history(make())


@pytest.mark.parametrize("name", TRUTH)
def test_nor_on_the_truth_set(truth_folder: Path, name: str) -> None:
    from sashimono.io.read import read_assembly

    check_history(read_assembly(truth_folder / name, unit="mm"))


def test_nor_on_a_real_chair_whose_second_order_once_was_another(assemblies_folder: Path) -> None:
    from sashimono.io.read import read_assembly

    parts = read_assembly(assemblies_folder / "ikea_chair_sundvik")
    cascade = Cascade(parts, make_bodies(parts), config=CONFIG)
    first = order(find_disassembly(cascade, config=SequenceConfig()))
    assert order(find_disassembly(cascade, config=SequenceConfig())) == first


@functools.cache
def smallest(folder: Path, count: int) -> list[Path]:
    """Return the folders of the assemblies with the smallest files that can be read."""
    from sashimono.io.read import read_assembly

    found: list[Path] = []
    for entry in sorted(folder.iterdir(), key=lambda e: (sum(f.stat().st_size for f in e.glob("*.obj")), e.name)):
        if len(found) < count and any(entry.glob("*.obj")):
            with contextlib.suppress(InputError):
                read_assembly(entry)
                found.append(entry)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("rank", range(60))
def test_nor_on_sixty_real_assemblies(assemblies_folder: Path, rank: int) -> None:
    from sashimono.io.read import read_assembly

    check_history(read_assembly(smallest(assemblies_folder, 60)[rank]), most=8)

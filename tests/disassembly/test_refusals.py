"""What a later level refused: level 1 avoids exactly that, and keeps the rest of the order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solids import assembly, box, box_with_lid

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.order import Orderer
from sashimono.disassembly.sequence.search import OrderSearch
from sashimono.disassembly.sequence.search_run import SearchRun
from sashimono.stability import StabilityConfig


def row() -> Assembly:
    """A long plate with five blocks of different sizes in a row on it."""
    sizes = (0.01, 0.012, 0.014, 0.016, 0.018)
    blocks = {f"b{k}": box((s, s, s), (0.03 * k - 0.06, 0.0, 0.005 + s / 2)) for k, s in enumerate(sizes)}
    return assembly(plate=box((0.2, 0.1, 0.01)), **blocks)


def test_a_way_is_refused_while_all_that_stood_in_it_is_there() -> None:
    refused = frozenset({Refusal(members=0b1, direction_index=3, among=0b110)})
    assert is_refused(refused, 0b1, 3, 0b1110)
    assert not is_refused(refused, 0b1, 3, 0b1010)
    assert not is_refused(refused, 0b1, 2, 0b1110)
    assert not is_refused(refused, 0b1, 3, 0b1110, only_turned=True)
    assert is_refused({Refusal(members=0b1, direction_index=3)}, 0b1, 3, 0)


def test_a_disassembly_knows_whether_a_refusal_is_about_it() -> None:
    cascade = Cascade(box_with_lid(), make_bodies(box_with_lid()), config=SeparateConfig())
    found = find_disassembly(cascade, config=SequenceConfig())
    everything, first = cascade.parts.all_parts, found.removals[0]
    assert found.avoids({Refusal(members=first.members, direction_index=None)}, everything)
    assert not found.avoids({first.refusal}, everything)
    assert not found.avoids({replace(first.refusal, among=everything & ~first.members)}, everything)
    second = found.removals[1]
    assert found.avoids({replace(second.refusal, among=first.members)}, everything), "it has left by then"


def orderer_of(parts: Assembly) -> tuple[Cascade, Orderer]:
    bodies = make_bodies(parts)
    cascade = Cascade(parts, bodies, config=SeparateConfig())
    return cascade, Orderer(cascade, bodies, config=SequenceConfig(), stability=StabilityConfig())


def left(found: DisassemblyResult) -> list[tuple[int, int | None]]:
    return [(departure.part, departure.separation.direction_index) for departure in found.removals]


def test_only_what_was_refused_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    cascade, orderer = orderer_of(row())
    first = find_disassembly(cascade, config=SequenceConfig())
    before = orderer.improve(first)
    # the last of the blocks to leave may not leave upwards while the one that leaves just before it is there
    *_, earlier, later = before.removals
    asked: list[int] = []
    grow = SearchRun.grow
    monkeypatch.setattr(SearchRun, "grow", lambda *args, **options: asked.append(1) or grow(*args, **options))
    harmless = frozenset({replace(later.refusal, among=earlier.members)})
    assert before.avoids(harmless, cascade.parts.all_parts)
    assert left(orderer.improve(first, refused=harmless)) == left(before)
    assert not asked, "no order was searched anew"
    # now it may not leave upwards at all: it leaves another way, or another part is last; the rest stays
    refused = frozenset({later.refusal})
    mended = orderer.improve(find_disassembly(cascade, config=SequenceConfig(), refused=refused), refused=refused)
    assert (later.part, later.separation.direction_index) not in left(mended)
    assert mended.avoids({later.refusal}, cascade.parts.all_parts)


def test_a_part_waits_until_what_stood_in_its_way_has_left() -> None:
    cascade, orderer = orderer_of(row())
    first = find_disassembly(cascade, config=SequenceConfig())
    before = orderer.improve(first)
    one, other = before.removals[0], before.removals[1]
    up = one.separation.direction_index
    assert up is not None
    np.testing.assert_allclose(cascade.blocking.direction(up), (0.0, 0.0, 1.0), atol=1e-9)
    refused = frozenset({replace(one.refusal, among=other.members)})
    after = orderer.improve(find_disassembly(cascade, config=SequenceConfig(), refused=refused), refused=refused)
    order = [departure.part for departure in after.removals]
    assert order.index(one.part) > order.index(other.part), "the way up is good once the other is gone"
    assert left(after)[order.index(one.part)] == (one.part, up)
    rest = [departure.part for departure in before.removals if departure.part not in (one.part, other.part)]
    assert [part for part in order if part in rest] == rest


def test_what_was_asked_once_is_not_asked_again() -> None:
    cascade, orderer = orderer_of(row())
    first = find_disassembly(cascade, config=SequenceConfig())
    before = orderer.improve(first)
    search: OrderSearch = orderer.search
    known = {key: len(memory.balances) for key, memory in search._site.memories.items()}
    again = orderer.improve(first)
    assert left(again) == left(before)
    assert {key: len(memory.balances) for key, memory in search._site.memories.items()} == known

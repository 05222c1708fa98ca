"""Labels of one blueprint by level 1: removal conditions with a witness each, orders, and sequences drawn evenly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.orders import OrdersConfig, count_orders, iterate_orders, random_walk
from sashimono.disassembly.conditions.systems import stuck_parts
from sashimono.disassembly.masks import bits
from sashimono.disassembly.translation.configuration_space import SpaceConfig
from sashimono.disassembly.translation.search import TranslationConfig

TRANSLATIONS = "translations of one part"
"""The class of motions for which conditions are proven complete."""


@dataclass(frozen=True, kw_only=True)
class LabelConfig:
    """How blueprints are labelled."""

    separate: SeparateConfig = field(
        default_factory=lambda: SeparateConfig(
            max_unproven=1,
            max_queries=48,
            max_traced=4_000_000,
            translation=TranslationConfig(
                max_legs=12,
                space=SpaceConfig(max_proof_cells=2_000_000),
            ),
        )
    )
    """Level 1. One set without motion or proof is enough to call a part's conditions incomplete."""
    orders: OrdersConfig = field(default_factory=lambda: OrdersConfig(max_states=300, table_parts=14))
    """Counting: beyond, ``orders`` is empty and sequences are drawn by random walks."""
    max_sequences: int = 16
    """Most distinct sequences listed of a blueprint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Label:
    """What is known of a blueprint."""

    conditions: RemovalConditions
    """Exact for every set of parts that taking the product apart can leave."""
    orders: int | None
    """Exact number of complete orders; None where counting ran out of its budget."""
    sequences: tuple[tuple[int, ...], ...]
    """Distinct assembly orders, base first: all, or drawn evenly from all (by a random walk without a count)."""
    stuck: tuple[int, ...]
    """Parts that never leave one at a time; with any there are no sequences."""

    @property
    def is_solved(self) -> bool:
        """Whether the product comes apart one part at a time."""
        return not self.stuck

    @property
    def is_complete(self) -> bool:
        """Whether the conditions are proven to be all, for translations."""
        return not self.conditions.cut_short


def label_assembly(assembly: Assembly, *, config: LabelConfig, seed: int) -> Label:
    """Return the labels of an assembly; the same for the same seed."""
    rng_bodies, rng_orders = np.random.default_rng([seed, 2]).spawn(2)
    bodies = make_bodies(assembly, rng=rng_bodies)
    conditions = Cascade(assembly, bodies, config=config.separate).conditions(reachable_only=True)
    stuck = stuck_parts(conditions.masks, (1 << len(assembly)) - 1)
    if stuck:
        return Label(conditions=conditions, orders=0, sequences=(), stuck=tuple(bits(stuck)))
    count, sequences = _sequences(conditions, config, rng_orders)
    return Label(conditions=conditions, orders=count, sequences=sequences, stuck=())


def _sequences(
    conditions: RemovalConditions, config: LabelConfig, rng: np.random.Generator
) -> tuple[int | None, tuple[tuple[int, ...], ...]]:
    counted = count_orders(conditions, config=config.orders)
    wanted = config.max_sequences if counted.count is None else min(config.max_sequences, counted.count)
    found: dict[tuple[int, ...], None] = {}
    for _ in range(20):
        missing = wanted - len(found)
        if missing <= 0:
            break
        drawn: Sequence[tuple[int, ...]] = (
            [random_walk(conditions, rng=rng) for _ in range(2 * missing)]
            if counted.count is None
            else counted.sample(2 * missing, rng=rng)
        )
        found.update(dict.fromkeys(order[::-1] for order in drawn))
    if counted.count is not None and counted.count == wanted:  # all of them, the drawn ones first
        found.update(dict.fromkeys(order[::-1] for order in iterate_orders(conditions)))
    return counted.count, tuple(found)[:wanted]

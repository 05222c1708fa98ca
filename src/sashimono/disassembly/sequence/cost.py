"""What an order costs: the terms by which orders are compared, each with a weight.

The cost is a sum over the steps of assembly. Geometry decides what is possible; the cost only what is chosen among it.
The same terms are counted while orders are searched and, at the end, in the finished plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.masks import bits, pieces
from sashimono.disassembly.sequence.holds import unsteadiness
from sashimono.disassembly.sequence.scene import OrderScene
from sashimono.plan import AssemblyPlan, OrderCost, Step, Subassembly, Table, step_tables
from sashimono.stability import Touching

TERMS = (
    "held",
    "hands_missing",
    "not_from_above",
    "from_below",
    "direction_changes",
    "interrupted_runs",
    "fasteners_late",
    "fasteners_out_of_turn",
    "slides",
    "apart",
    "base",
    "unsteady",
    "fixture",
    "turned",
    "turn_overs",
    "turned_loose",
    "parted",
    "products_apart",
    "tools_blocked",
)
"""The terms, by the names of their weights."""

START_TERMS = ("base", "unsteady", "fixture", "turned")
"""What the base and the table of a product add: of a subassembly's own they do not count."""

SOMETIMES = ("products_apart", "tools_blocked")
"""Terms that there are only where the file has a product tree, or where a tool has no room."""


@dataclass(frozen=True, kw_only=True)
class OrderCostConfig:
    """Weights of the terms, and what counts as from above."""

    held: float = 1.0
    """For each part that must be held, at each step."""
    hands_missing: float = 3.0
    """For each hand, at each step, that there is not."""
    not_from_above: float = 1.0
    """For each part that does not come from above."""
    from_below: float = 1.0
    """More, for each of these that comes from below: the product must stand in a fixture, or be turned over."""
    direction_changes: float = 0.25
    """For each part that comes from another direction than the one before."""
    interrupted_runs: float = 0.5
    """For each time that fasteners of one kind and size are taken up again after others came between."""
    other_runs: float = 0.2
    """How much of that it counts if the alike parts are no fasteners: two flanges may well come one after the other's
    shaft."""
    fasteners_late: float = 0.05
    """For each part that is placed between the time a fastener could be set and the time it is, and is none itself."""
    fasteners_out_of_turn: float = 100.0
    """For each pair that fasteners demand and the order does not keep: a screw before what it clamps, a nut before its
    bolt. As good as forbidden: it is chosen only where nothing else can be assembled."""
    slides: float = 1.0
    """For the way that a part slides along what it touches, where it does not come from above, or over another shaft
    than the one that it fits, over the product's size."""
    apart: float = 1.0
    """For each part that touches none of those placed before it."""
    base: float = 4.0
    """For a base that is small or has few neighbours: 1 less the largest side of its box times its neighbours, over the
    most of any."""
    unsteady: float = 6.0
    """For a base that is easily tipped: from 0, where it takes an angle of `steady`, to 1, where it takes none."""
    fixture: float = 3.0
    """For a base that does not stand on the table."""
    turned: float = 4.0
    """For a table that is not the one below the file's own up."""
    turn_overs: float = 4.0
    """For each time that the product is turned over."""
    turned_loose: float = 1.0
    """For each group of parts, joined to no other, that must be kept in place while the product is turned over; one of
    them is what it is turned by."""
    parted: float = 100.0
    """For each part that comes between others that the user wants together. As good as forbidden."""
    products_apart: float = 2.0
    """For each product of the file's tree that is not put together by itself: its designer drew it as one thing."""
    tools_blocked: float = 3.0
    """For each fastener that is placed when its tool has no room."""
    hands: int = 2
    """Hands that there are."""
    steady: float = 0.6
    """Angle by which a base can be tipped without falling [rad], from which on it counts as steady."""
    above: float = 0.8
    """Least cosine between the way out and up for a part that comes from above; below minus this it comes from below.
    """

    @property
    def weights(self) -> dict[str, float]:
        """The weights, by term."""
        return {term: float(getattr(self, term)) for term in TERMS}


Amounts = dict[str, float]
"""How often, or how much, of each term there is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placing:
    """One step, seen from taking apart: what leaves, which way, and what is there before and after."""

    members: int
    """Mask of what moves."""
    exit_direction: Float[np.ndarray, "3"]
    """Unit, world: the way out."""
    rest: int
    """Mask of what stays, the parts placed before it."""
    after: Placing | None = None
    """The one that leaves before it: the next in assembly. None: it is the last to be placed."""
    turned_after: bool = False
    """Whether the product is turned over between it and the next."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CostModel:
    """Counts the terms of orders of one assembly."""

    scene: OrderScene
    touching: Touching
    config: OrderCostConfig = field(default_factory=OrderCostConfig)
    together: tuple[int, ...] = ()
    """Masks of parts that the user wants to follow one another."""

    def total(self, amounts: Mapping[str, float]) -> float:
        """Return the cost of these amounts."""
        weights = self.config.weights
        return sum(weights[term] * amount for term, amount in amounts.items())

    def of_placing(self, placing: Placing, gone: int, up: Float[np.ndarray, "3"]) -> Amounts:
        """Return what one step adds, hands aside.

        Args:
            placing: The step.
            gone: Mask of what has left before it: the parts placed later.
            up: Away from the table, unit.
        """
        scene = self.scene
        members, rest, direction = placing.members, placing.rest, placing.exit_direction
        out: Amounts = {}
        above = float(direction @ up)
        if above < self.config.above:
            out["not_from_above"] = 1.0
            slide = scene.slide(members, rest, direction)
        else:
            slide = scene.threaded(members, rest, direction)
        if slide > 0.0:
            out["slides"] = slide
        if above < -self.config.above:
            out["from_below"] = 1.0
        follows = placing.after is not None and not placing.turned_after
        if follows and placing.after is not None and float(direction @ placing.after.exit_direction) < 0.9999:
            out["direction_changes"] = 1.0
        alike = scene.alike_to(members)
        interrupted = alike & gone and not (placing.after is not None and placing.after.members & alike)
        if interrupted:
            out["interrupted_runs"] = 1.0 if scene.is_fastener(members) else self.config.other_runs
        late = scene.waiting(members, rest, gone)
        if late:
            out["fasteners_late"] = float(late)
        wrong = sum((scene.comes_before[part] & rest).bit_count() for part in bits(members))
        if wrong:
            out["fasteners_out_of_turn"] = float(wrong)
        if scene.is_tool_blocked(members, rest):
            out["tools_blocked"] = 1.0
        if rest and not scene.touched_by(members) & rest:
            out["apart"] = 1.0
        if parted := sum(1 for group in self.together if group & rest and group & gone and not group & members):
            out["parted"] = float(parted)
        return out

    def of_hands(self, held_before: int, held_after: int) -> Amounts:
        """Return what the hands of one step add: parts held before a part is brought, and after it is let go."""
        hands = max(held_before + 1, held_after)
        out: Amounts = {"held": float(held_after)} if held_after else {}
        if hands > self.config.hands:
            out["hands_missing"] = float(hands - self.config.hands)
        return out

    def of_start(self, base: int, standing: int, held: int, in_fixture: bool, table: Table) -> Amounts:
        """Return what the base and the table add.

        Args:
            base: Mask of one part.
            standing: Mask of it and all that stands with it from the beginning.
            held: How many of these must be held.
            in_fixture: Whether they are in a fixture.
            table: On which they stand.
        """
        out: Amounts = {"held": float(held)} if held else {}
        if held > self.config.hands:
            out["hands_missing"] = float(held - self.config.hands)
        if (small := 1.0 - self.scene.base_score(base)) > 1e-9:
            out["base"] = small
        if in_fixture:
            out["fixture"] = 1.0
        elif (tips := self._unsteady(standing, table)) > 1e-9:
            out["unsteady"] = tips
        if float(self.scene.up @ table.normal) < 0.99:
            out["turned"] = 1.0
        return out

    def of_turn(self, placed: int, held: int, table: Table) -> Amounts:
        """Return what it adds that the product is turned over, hands aside.

        Args:
            placed: Mask of the parts that are turned.
            held: How many of them must be held on the new table.
            table: The new one.
        """
        out: Amounts = {"turn_overs": 1.0}
        if held:
            out["held"] = float(held)
        if (loose := self._groups(placed) - 1) > 0:
            out["turned_loose"] = float(loose)
        if (tips := self._unsteady(placed, table)) > 1e-9:
            out["unsteady"] = tips
        return out

    def _groups(self, placed: int) -> int:
        """How many groups of joined parts there are among the placed ones."""
        return len(pieces(placed, self._joined))

    def _joined(self, part: int) -> int:
        """Mask of the parts that are rigidly joined to one."""
        names = self.scene.names
        touched = bits(self.scene.neighbours[part])
        return sum(1 << other for other in touched if self.touching.fastened(names[part], names[other]))

    def _unsteady(self, standing: int, table: Table) -> float:
        names = [self.scene.names[part] for part in bits(standing)]
        return unsteadiness(self.touching, names, table, steady=self.config.steady)


def add(amounts: Amounts, more: Mapping[str, float]) -> None:
    """Add amounts to others."""
    for term, amount in more.items():
        amounts[term] = amounts.get(term, 0.0) + amount


def plan_cost(plan: AssemblyPlan, model: CostModel) -> OrderCost | None:
    """Return the cost of a finished plan, from its own steps, tables and held parts; None without a table.

    What is inside subassemblies counts as well; their bases and tables do not.
    """
    if plan.table is None or not plan.steps:
        return None
    amounts: Amounts = {}
    _add_level(amounts, plan, model, top=True)
    if plan.products:
        add(amounts, {"products_apart": float(sum(entry.planned == "apart" for entry in plan.products))})
    counted = tuple(term for term in TERMS if term not in SOMETIMES or term in amounts)
    kept = {term: round(amounts.get(term, 0.0), 6) for term in counted}
    weights = {term: model.config.weights[term] for term in counted}
    return OrderCost(total=round(model.total(kept), 6), terms=kept, weights=weights)


def _add_level(amounts: Amounts, level: AssemblyPlan | Subassembly, model: CostModel, *, top: bool) -> None:
    assert level.table is not None
    scene, steps = model.scene, level.steps
    tables = step_tables(steps, level.table)
    everything = scene.mask(name for step in steps for name in step.members)
    first = steps[0]
    standing = scene.mask(step.part for step in steps if not step.moves)
    start = model.of_start(scene.mask([first.part]), standing, len(first.held), level.fixture is not None, level.table)
    add(amounts, start if top else {term: start[term] for term in ("held", "hands_missing") if term in start})
    after: Placing | None = None
    turned_after = False
    for step, table in zip(reversed(steps[1:]), reversed(tables[1:]), strict=True):
        assert table is not None
        if step.moves:
            members = scene.mask(step.members)
            after = Placing(
                members=members,
                exit_direction=way_out(step),
                rest=scene.mask(step.fixed) & everything,
                after=after,
                turned_after=turned_after,
            )
            add(amounts, model.of_placing(after, everything & ~members & ~after.rest, table.normal))
            turned_after = False
        if step.table is not None:
            placed = scene.mask(step.fixed) & everything
            add(amounts, model.of_turn(placed, len(step.held_before), step.table))
            turned_after = True
    held = len(first.held)
    for step in steps[1:]:
        if step.table is not None:
            held = len(step.held_before)
        if step.moves:
            add(amounts, model.of_hands(held, len(step.held)))
        held = len(step.held)
    for step in steps:
        if step.subassembly is not None and step.subassembly.table is not None and step.subassembly.steps:
            _add_level(amounts, step.subassembly, model, top=False)


def way_out(step: Step) -> Float[np.ndarray, "3"]:
    """Return the unit direction, world, in which a step's part would leave at last: its insertion's first way back.

    Of a step whose insertion only turns, the zero vector.
    """
    starts = [segment.start for segment in step.motion.segments if segment.kind == "insertion"]
    first = min(starts, default=0)
    positions = step.motion.T_world_part[first:, :3, 3]
    for before, after in pairwise(positions):
        length = float(np.linalg.norm(after - before))
        if length > 1e-9:
            return (before - after) / length
    return np.zeros(3)

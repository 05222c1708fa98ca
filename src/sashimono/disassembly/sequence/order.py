"""The front door of ordering: the order found first, improved by its cost; and the cost of a finished plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sashimono.assembly import few_words
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.sequence.constraints import resolve
from sashimono.disassembly.sequence.cost import CostModel, plan_cost
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig
from sashimono.disassembly.sequence.holds import Contacts
from sashimono.disassembly.sequence.products import ProductGroup, Products, product_groups
from sashimono.disassembly.sequence.scene import OrderScene
from sashimono.disassembly.sequence.search import OrderSearch
from sashimono.fasteners.bonds import bonds
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.fasteners.tools import tool_for
from sashimono.geometry.body import Body
from sashimono.plan import AssemblyPlan, CloseFit, Fastening, OrderCost, Tool
from sashimono.stability import StabilityConfig, Touching, close_fit, embraces


class Orderer:
    """Orders of one assembly: its fasteners, what touches what, and the cost, each worked out when first asked for."""

    def __init__(
        self, cascade: Cascade, bodies: Mapping[str, Body], *, config: SequenceConfig, stability: StabilityConfig
    ) -> None:
        self._cascade = cascade
        self._bodies = bodies
        self._config = config
        self._stability = stability

    @cached_property
    def fasteners(self) -> tuple[Fastener, ...]:
        """Screws, nuts and the like."""
        return find_fasteners(self._cascade.assembly)

    @cached_property
    def fastenings(self) -> dict[str, Fastening]:
        """By part: what a plan's step says of a fastener. It is joined only to what touches it all around its axis."""
        joins = bonds(self.fasteners)
        return {
            f.part: Fastening(
                kind=f.kind,
                size=f.size or None,
                axis=(float(f.axis[0]), float(f.axis[1]), float(f.axis[2])),
                point=(float(f.point[0]), float(f.point[1]), float(f.point[2])),
                joins=tuple(
                    other
                    for other in joins.get(f.part, ())
                    if embraces(self._bare.between(f.part, other), f.axis, f.point)
                ),
            )
            for f in self.fasteners
        }

    @cached_property
    def _bare(self) -> Touching:
        poses = {part.name: part.T_world_part for part in self._cascade.assembly.parts}
        return Touching(self._bodies, poses, config=self._stability)

    def tool(self, part: str, placed: Collection[str]) -> Tool | None:
        """Return what drives a fastener, and whether there is room for it past these parts; None of any other part."""
        fastener = self._by_name.get(part)
        return None if fastener is None else tool_for(fastener, self.model.scene.tools(part), placed)

    @cached_property
    def _by_name(self) -> dict[str, Fastener]:
        return {fastener.part: fastener for fastener in self.fasteners}

    @cached_property
    def products(self) -> Products:
        """Which products of the file's tree may be put together by themselves."""
        return product_groups(self._cascade.assembly, self.fasteners, self._cascade.touching)

    @cached_property
    def close_fits(self) -> tuple[CloseFit, ...]:
        """Pairs of parts with a close fit. What is screwed, or laid around a screw, is none of these."""
        if not self._stability.close_fits:
            return ()
        found = []
        parts, names = self._cascade.parts, self._cascade.assembly.names
        loose = {f.part for f in self.fasteners if f.kind not in ("pin", "standoff")}
        for k, name in enumerate(names):
            for other in bits(self._cascade.touching(k) & ((1 << k) - 1)):
                if {name, names[other]} & loose or self._bare.fastened(name, names[other]):
                    continue
                lines = np.concatenate([parts.part_lines[k], parts.part_lines[other]])
                if (fit := close_fit(self._bare, name, names[other], lines)) is not None:
                    found.append(CloseFit(part=name, other=names[other], axis=fit.axis, point=fit.point))
        return tuple(found)

    def close_fits_between(self, brought: Collection[str], placed: Collection[str]) -> tuple[CloseFit, ...]:
        """Return the close fits of parts that are brought with parts in place."""
        turned = (replace(fit, part=fit.other, other=fit.part) for fit in self.close_fits)
        return tuple(fit for fit in (*self.close_fits, *turned) if fit.part in brought and fit.other in placed)

    @cached_property
    def touching(self) -> Touching:
        """What touches what; fasteners joined to what they are screwed into where that is all around them, and what
        has a close fit."""
        pairs = [(part, other) for part, fastening in self.fastenings.items() for other in fastening.joins]
        pairs += [(fit.part, fit.other) for fit in self.close_fits]
        return self._bare.with_fastened(pairs)

    @cached_property
    def model(self) -> CostModel:
        """The cost."""
        up = np.array(self._config.up) / np.linalg.norm(self._config.up)
        scene = OrderScene(self._cascade, self.fasteners, up=up, close_fits=self.close_fits)
        wishes = resolve(self._config.constraints, self._cascade.assembly.names)
        return CostModel(scene=scene, touching=self.touching, config=self._config.cost, together=wishes.together)

    @cached_property
    def search(self) -> OrderSearch:
        """The search for a cheaper order."""
        names = self._cascade.assembly.names
        return OrderSearch(
            self._cascade,
            Contacts(self.touching, names),
            self.model,
            resolve(self._config.constraints, names),
            config=self._config.search,
        )

    def improve(
        self,
        found: DisassemblyResult,
        *,
        refused: frozenset[Refusal] = frozenset(),
        up: Sequence[float] | Float[np.ndarray, "3"] | None = None,
        products: Sequence[ProductGroup] = (),
    ) -> DisassemblyResult:
        """Return the cheapest disassembly of all parts that is found, the given one among those looked at.

        Args:
            found: The one found first.
            refused: Ways out that are not to be taken.
            up: Away from the table, of any length, where that is given; else the search chooses.
            products: What leaves as one.
        """
        if not self._config.search.enabled:
            return found
        normal = None if up is None else np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
        start = self._cascade.parts.all_parts
        return self.search.improve(found, start=start, refused=refused, up=normal, products=products)

    def search_cost(self, found: DisassemblyResult, products: Sequence[ProductGroup] = ()) -> float:
        """Return what an order costs that `improve` returned, held parts as far as the search bounds them."""
        return self.search.cost(found, start=self._cascade.parts.all_parts, products=products)

    def explain(
        self,
        plan: AssemblyPlan,
        found: DisassemblyResult,
        refused: frozenset[Refusal],
        products: Sequence[ProductGroup] = (),
    ) -> AssemblyPlan:
        """Return the plan with what else could have come at each step of its top level, and why it did not.

        Args:
            plan: The finished plan.
            found: What its steps were made from.
            refused: Ways out that were not to be taken.
            products: What left as one.
        """
        if plan.table is None:
            return plan
        names = self._cascade.assembly.names
        kept = tuple(d for d in found.removals if names[d.part] in plan.order)
        start = sum(d.members for d in kept) | 1 << found.base | sum(1 << part for part, _ in found.stuck)
        turn = found.turn
        if turn is not None:
            turn = replace(turn, count=sum(d in kept for d in found.removals[: turn.count]))
        asked = self.search.alternatives(
            replace(found, removals=kept),
            start=start,
            refused=refused,
            up=plan.table.normal,
            turn=turn,
            products=products,
        )
        by_name = {names[part]: alternatives for part, alternatives in asked.items()}
        steps = tuple(replace(step, alternatives=by_name.get(step.part, ())) for step in plan.steps)
        return replace(plan, steps=steps)

    def parted(self, plan: AssemblyPlan) -> tuple[str, ...]:
        """Return, a line a group, what comes between parts of a plan that the user wants together; none if nothing."""
        lines = []
        names = self._cascade.assembly.names
        for words, group in zip(self._config.constraints.together, self.model.together, strict=True):
            wanted = {names[k] for k in bits(group)}
            places = [k for k, step in enumerate(plan.steps) if wanted & {*step.members}]
            inside = plan.steps[places[0] : places[-1]] if places else ()
            between = [step.part for step in inside if not wanted & {*step.members}]
            if between:
                lines.append(
                    f"--together {','.join(words)}: {few_words(between)} between them; no order was found without"
                )
        return tuple(lines)

    def cost(self, plan: AssemblyPlan) -> OrderCost | None:
        """Return what the order of a finished plan costs; None without a table."""
        return plan_cost(plan, self.model)

"""How much orders are searched. Budgets count work."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class OrderSearchConfig:
    """How much is searched. Budgets count work."""

    enabled: bool = True
    """Whether orders are searched; else the greedy one is taken."""
    width: int = 6
    """Orders that grow side by side."""
    starts: int = 4
    """Bases with a table that orders are grown for. A base that some part cannot leave is given up, and does not count.
    """
    same_table: float = 0.6
    """Cosine between two up directions above which only the cheaper of them is looked at closely for a base."""
    bases: int = 3
    """Parts that are looked at as bases. A fastener is none."""
    least_base: float = 0.1
    """Largest side of its box, times neighbours, that a base has at least, over the most of any part."""
    expansions: int = 12_000
    """Parts asked for a way out; with many parts, the beam is narrower for it."""
    balances: int = 8_000
    """Rigid groups, each with what is around it, whose balance is asked to bound what must be held."""
    exact: int = 3
    """Orders, for different bases or tables, of which the fewest held parts are found at every step at the end,
    besides the greedy one."""
    exact_sets: int = 150
    """Sets of placed parts for which that is done, at most; orders with more are compared by the bounds."""
    moves: int = 3_000
    """Steps counted anew for orders in which one part is placed earlier, to make the best ones better."""
    turned_tables: int = 3
    """Tables that the product may be turned over to, for each order that it is tried with: first the opposite one. 0:
    it is never turned over. Nor is it where the user says which way is up, or inside subassemblies."""
    traced: float = 20_000_000.0
    """Points of pairs of parts that are traced along straight lines."""
    mending: float = 1.0
    """Where ways of an order were refused: how much more it may cost with these replaced, all else kept. If that costs
    more, orders are searched anew."""
    explained: int = 20
    """Later parts of which each step says why they did not come instead, where that is asked."""
    table_gap: float = 0.01
    """How much lower than the base another part may lie, over the product's size, without a fixture."""

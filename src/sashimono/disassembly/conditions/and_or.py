"""The AND/OR graph of a disassembly: which subassemblies come up, and into what each falls apart.

Homem de Mello & Sanderson (1990): a node is a set of parts that are together, an arc takes one node apart
into two. Here one part leaves at a time, so an arc leads to the rest and to the single part.
"""

from __future__ import annotations

from dataclasses import dataclass

from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.orders import OrdersConfig
from sashimono.disassembly.masks import bits


@dataclass(frozen=True, kw_only=True)
class AndOrGraph:
    """Subassemblies and how they come apart."""

    names: tuple[str, ...]
    nodes: tuple[int, ...]
    """Masks of the subassemblies of two parts or more, the whole first, larger ones before smaller ones."""
    arcs: tuple[tuple[int, int, int], ...]
    """(node, part that leaves, mask of the rest)."""
    reason: str
    """Why the graph is not complete; empty where it is. All nodes but those of the last size have their arcs."""

    def as_dict(self) -> dict[str, object]:
        """Return the JSON form: ``nodes`` as lists of names, ``arcs`` from a node into two nodes, all by number.

        Single parts are nodes too, after the others, in part order.
        """
        number = {mask: k for k, mask in enumerate(self.nodes)}
        for part in range(len(self.names)):
            number.setdefault(1 << part, len(number))
        return {
            "format": "sashimono.and_or_graph",
            "version": 1,
            "complete": not self.reason,
            "reason": self.reason,
            "nodes": [[self.names[k] for k in bits(mask)] for mask in number],
            "arcs": [{"from": node, "into": [number[rest], number[1 << part]]} for node, part, rest in self.arcs],
        }


def and_or_graph(conditions: RemovalConditions, *, config: OrdersConfig | None = None) -> AndOrGraph:
    """Return the graph of all subassemblies that removing single parts leads to, or the largest within the budget."""
    config = config or OrdersConfig()
    layer = [(1 << len(conditions.names)) - 1]
    nodes: list[int] = []
    arcs: list[tuple[int, int, int]] = []
    reason = ""
    while layer and layer[0] & (layer[0] - 1):
        start = len(nodes)
        nodes += layer
        found = [
            (start + k, part, mask & ~(1 << part))
            for k, mask in enumerate(layer)
            for part in bits(conditions.removable(mask))
        ]
        following = dict.fromkeys(rest for _, _, rest in found)
        if len(nodes) + len(following) > config.max_nodes:
            reason = f"the graph has more than its budget of {config.max_nodes} subassemblies"
            break
        arcs += found
        layer = sorted(following)
    return AndOrGraph(names=conditions.names, nodes=tuple(nodes), arcs=tuple(arcs), reason=reason)

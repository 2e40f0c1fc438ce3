"""Nodes that a flood cannot reach because the swarm is separated; no packet can then be promised to all nodes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from fanet_mw.graph.topology import Adjacency, components
from fanet_mw.units import NodeId

_NAMED: Final = 12


def split(adjacency: Adjacency, *, leader: NodeId) -> tuple[NodeId, ...]:
    """The nodes that have no connection with the leader over any number of hops."""
    return tuple(sorted(node for part in components(adjacency) if leader not in part for node in part))


def missed(uncovered: Mapping[NodeId, Sequence[NodeId]], *, leader: NodeId) -> tuple[NodeId, ...]:
    """The nodes that a timetable does not reach: those that the leader's floods miss, or else those
    of some other root.
    """
    found = uncovered.get(leader) or next((nodes for _, nodes in sorted(uncovered.items()) if nodes), ())
    return tuple(found)


def problems(cut_off: Sequence[NodeId]) -> Iterator[str]:
    """A sentence about the nodes that are cut off; nothing if there are none."""
    if cut_off:
        named = ", ".join(map(str, cut_off[:_NAMED]))
        rest = f" and {len(cut_off) - _NAMED} more" if len(cut_off) > _NAMED else ""
        noun = "node" if len(cut_off) == 1 else "nodes"
        yield f"the swarm is in parts: no flood of the leader's part reaches {noun} {named}{rest}"

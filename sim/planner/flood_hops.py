"""How many hops the floods of a plan make, and whether the radio and `routing.hop_limit` let them reach all nodes.

They are followed through the turns of the timetable, all of which are in use, as at the greatest load: with
`radio.channel = "range"` over the links of the only transmitting node within `radio.range_m`, else over those for which
the timetable is computed (`clusters.link_m`, `clusters.interference_m`).
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from fanet_mw.graph.topology import Adjacency
from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId
from fanet_mw.wire import MOST_HOPS


class FloodHops(NamedTuple):
    """The worst flood of one root."""

    most: int
    """The number of hops to the farthest node that the flood reaches."""
    missed: tuple[NodeId, ...]


def flood_hops(table: Timetable, adjacency: Adjacency, geometry: Geometry) -> Mapping[NodeId, FloodHops]:
    """Follow each flood of a timetable over the links of `adjacency`; of several floods of a root the worst counts."""
    together: dict[int, set[NodeId]] = {}
    for turn in table.turns:
        together.setdefault(turn.offset % geometry.turns, set()).add(turn.node)
    floods: dict[tuple[NodeId, int], list[Turn]] = {}
    for turn in sorted(table.turns):
        floods.setdefault((turn.root, turn.instance), []).append(turn)
    found: dict[NodeId, FloodHops] = {}
    for (root, _), turns in sorted(floods.items()):
        hops = {root: 0}
        ready = {root: turns[0].offset}
        for turn in turns:
            if ready.get(turn.node, turn.offset + 1) > turn.offset:
                continue  # this relay does not have the packet
            senders = together[turn.offset % geometry.turns]
            for node in adjacency[turn.node]:
                alone = node not in senders and senders.intersection(adjacency[node]) == {turn.node}
                if node not in hops and alone:
                    hops[node], ready[node] = hops[turn.node] + 1, turn.offset + geometry.hop_turns
        this = FloodHops(max(hops.values()), tuple(node for node in sorted(adjacency) if node not in hops))
        worst = found.setdefault(root, this)
        found[root] = FloodHops(max(worst.most, this.most), worst.missed or this.missed)
    return found


def too_many(scenario: Scenario, most_hops: int) -> Iterator[str]:
    """A sentence about packets that end before they are with all nodes; nothing if none do."""
    limit = scenario.routing.hop_limit
    if most_hops > limit:
        least = f"it has to be at least {most_hops}" if most_hops <= MOST_HOPS else f"its greatest value is {MOST_HOPS}"
        yield f"packets need up to {most_hops} hops, and end after routing.hop_limit = {limit}: {least}"


def incomplete(scenario: Scenario, geometry: Geometry, found: Mapping[NodeId, FloodHops]) -> Iterator[str]:
    """A sentence about floods that miss nodes; nothing if none do."""
    missed = {root: flood.missed for root, flood in found.items() if flood.missed}
    if missed:
        root, nodes = min(missed.items())
        yield (
            f"{len(missed)} nodes have floods that miss others, the first is node {root}, which misses node {nodes[0]}:"
            f" frames arrive and disturb each other up to radio.range_m = {scenario.radio.range_m:g}, the timetable is "
            f"made for clusters.link_m = {geometry.link_m:g}, interference_m = {geometry.interference_m:g}"
        )

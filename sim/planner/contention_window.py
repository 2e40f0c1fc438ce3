"""Whether hellos, and packets of members to their heads if only heads have turns, fit the contention window of a
superframe. This is an estimate (`fanet_mw/routing/clustered/tdma/hello_room.py`).
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fanet_mw.airtime import mean_access_ns
from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.clustered.tdma.hello_room import crowd, hellos_ns, least_ms, room_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId
from sim.planner.demand import TrafficClass

_NONE: Final[Mapping[NodeId, int]] = MappingProxyType({})


def too_short(scenario: Scenario, adjacency: Adjacency, uplinks_ns: Mapping[NodeId, int] = _NONE) -> Iterator[str]:
    """A sentence if hellos and packets to heads (`uplinks_ns`: their airtime by sender) do not fit the window."""
    needed_ns = hellos_ns(scenario, crowd(adjacency)) + _densest_ns(adjacency, uplinks_ns)
    window_ns = round(scenario.clusters.contention_ms * MS)
    what = "hellos and packets to heads" if any(uplinks_ns.values()) else "hellos"
    if needed_ns > room_ns(window_ns):
        yield (
            f"the {what} of a superframe take {needed_ns / MS:.1f} ms where nodes are densest, its contention window "
            f"of {window_ns / MS:g} ms has {room_ns(window_ns) / MS:g} ms for them: neighbors are missed, taken for "
            f"dead (clusters.contention_ms, which has to be at least {least_ms(needed_ns)}, routing.hello_interval_s, "
            "clusters.flooding_period_s)"
        )


def uplinks_ns(
    scenario: Scenario, through: Mapping[NodeId, Sequence[int]], classes: Sequence[TrafficClass]
) -> dict[NodeId, int]:
    """The airtime in a superframe of what each node sends towards a head; `through`: its sources by class."""
    return {
        node: sum(
            n * scenario.clusters.period_ns * mean_access_ns(c.payload_bytes, scenario.radio) // c.interval_ns
            for n, c in zip(counts, classes, strict=True)
        )
        for node, counts in through.items()
    }


def _densest_ns(adjacency: Adjacency, airtime_ns: Mapping[NodeId, int]) -> int:
    """The greatest sum of the airtimes of a node and of all nodes within two hops of it."""
    if not airtime_ns:
        return 0
    near = two_hop(adjacency).items()
    return max(airtime_ns.get(node, 0) + sum(airtime_ns.get(other, 0) for other in others) for node, others in near)

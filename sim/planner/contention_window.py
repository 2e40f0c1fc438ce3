"""Whether the hellos fit the contention window of a superframe; a node whose hellos are lost would be taken for failed.

Everything except floods of data contends there: hellos, and packets of members if only heads have turns. Two frames
destroy each other at a common neighbor, so those of all nodes within two hops are added up, each with DIFS and a mean
backoff. This is an estimate.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.clustered.tdma.turn_timing import TAIL_NS
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, seconds_to_ns
from sim.planner.demand import TrafficClass
from sim.planner.flood_cost import contended_ns

_NONE: Final[Mapping[NodeId, int]] = MappingProxyType({})
MOST: Final = 0.75
"""The greatest share of the window that hellos may need. On the 9 x 5 grid, hellos that need all of the window reach
only 0.58 of the nodes that should receive them."""
_BACKLOG: Final = 1.5
"""The greatest airtime of hellos, as a share of that part of the window in which they fall due. 44 nodes 396 m apart,
with a range of 400 m, keep all neighbors at a share of 1.4, and lose some at 2.8."""
_HELLO_BYTES: Final = 137
"""The length of a hello: routing header, HEARTBEAT, GLOBAL_POSITION_INT and FANET_BEACON."""


def room_ns(window_ns: int) -> int:
    """The greatest airtime of hellos for which there is room in a contention window. They fall due before its last
    part, in which those that had to wait are transmitted.
    """
    return max(0, min(int(MOST * window_ns), int(_BACKLOG * (window_ns - TAIL_NS))))


def hellos_ns(scenario: Scenario, adjacency: Adjacency) -> int:
    """The airtime of the hellos of one superframe, one a node at most, where the most nodes are within two hops of
    each other.
    """
    every_ns = seconds_to_ns(scenario.routing.hello_interval_s)
    if not every_ns or not adjacency:
        return 0
    crowd = 1 + max(map(len, two_hop(adjacency).values()))
    period_ns = scenario.clusters.period_ns
    return crowd * contended_ns(scenario.radio, _HELLO_BYTES) * period_ns // max(every_ns, period_ns)


def least_ms(needed_ns: int) -> int:
    """The length of the shortest contention window, in whole milliseconds, that has room for these hellos."""
    return math.ceil(max(needed_ns / MOST, needed_ns / _BACKLOG + TAIL_NS) / MS)


def too_short(scenario: Scenario, adjacency: Adjacency, uplinks_ns: Mapping[NodeId, int] = _NONE) -> Iterator[str]:
    """A sentence about a window that is too short for the hellos, and for what members send to their heads; nothing if
    it is long enough. `uplinks_ns`: the airtime of the latter in a superframe, by the node that transmits.
    """
    needed_ns = hellos_ns(scenario, adjacency) + _densest_ns(adjacency, uplinks_ns)
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
    """The airtime in a superframe of what each node sends towards a head, own packets and those of others; `through`:
    the number of sources whose packets it sends, by class.
    """
    return {
        node: sum(
            n * scenario.clusters.period_ns * contended_ns(scenario.radio, c.payload_bytes) // c.interval_ns
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

"""Whether the hellos fit the contention window of a superframe; a node whose hellos are lost would be taken for failed.

Everything except floods of data contends there, most of it hellos. Two hellos destroy each other at a common neighbor,
so the hellos of all nodes within two hops are added up, each with DIFS and a mean backoff. This is an estimate.
"""

from collections.abc import Iterator
from typing import Final

from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.planner.flood_cost import contended_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, seconds_to_ns

MOST: Final = 0.75
"""The greatest share of the window that hellos may need. On the 9 x 5 grid, hellos that need all of the window reach
only 0.58 of the nodes that should receive them."""
_HELLO_BYTES: Final = 137
"""The length of a hello: routing header, HEARTBEAT, GLOBAL_POSITION_INT and FANET_BEACON."""


def hellos_ns(scenario: Scenario, adjacency: Adjacency) -> int:
    """The airtime of the hellos of one superframe, where the most nodes are within two hops of each other."""
    every_ns = seconds_to_ns(scenario.routing.hello_interval_s)
    if not every_ns or not adjacency:
        return 0
    crowd = 1 + max(map(len, two_hop(adjacency).values()))
    return crowd * scenario.clusters.period_ns * contended_ns(scenario.radio, _HELLO_BYTES) // every_ns


def too_short(scenario: Scenario, adjacency: Adjacency) -> Iterator[str]:
    """A sentence about a window that is too short for the hellos; nothing if it is long enough."""
    needed_ns, window_ns = hellos_ns(scenario, adjacency), round(scenario.clusters.contention_ms * MS)
    if needed_ns > MOST * window_ns:
        yield (
            f"the hellos of a superframe take {needed_ns / MS:.1f} ms where nodes are densest, its contention window "
            f"of {window_ns / MS:g} ms has {MOST * window_ns / MS:g} ms for them: neighbors are missed, taken for dead "
            "(clusters.contention_ms, routing.hello_interval_s, clusters.flooding_period_s)"
        )

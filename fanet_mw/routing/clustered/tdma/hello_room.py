"""Whether the hellos of a swarm fit the contention window of its superframe; who is not heard is taken for failed.

Two frames destroy each other at a common neighbor, so those of all nodes within two hops are added up, each with DIFS
and a mean backoff. This is an estimate. Where they do not fit, nodes state no bound (`timetable/stated_delays.py`).
"""

import math
from typing import Final

from fanet_mw.airtime import mean_access_ns
from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.clustered.tdma.turn_timing import TAIL_NS
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, seconds_to_ns
from fanet_mw.wire.hello import PLAIN_BYTES

_MOST: Final = 0.75
"""The greatest share of the window that hellos may need. On the 9 x 5 grid, hellos that need all of the window reach
only 0.58 of the nodes that should receive them."""
_BACKLOG: Final = 1.5
"""The greatest airtime of hellos, as a share of that part of the window in which they fall due. 44 nodes 396 m apart,
with a range of 400 m, keep all neighbors at a share of 1.4, and lose some at 2.8."""


def room_ns(window_ns: int) -> int:
    """The greatest airtime of hellos that a contention window holds before its last part, which is for the late."""
    return max(0, min(int(_MOST * window_ns), int(_BACKLOG * (window_ns - TAIL_NS))))


def crowd(adjacency: Adjacency) -> int:
    """The most nodes within two hops of one node, itself included."""
    return max((1 + len(near) for near in two_hop(adjacency).values()), default=0)


def hellos_ns(scenario: Scenario, nodes: int) -> int:
    """The airtime of a superframe's hellos, one a node at most, of so many nodes within two hops."""
    every_ns, period_ns = seconds_to_ns(scenario.routing.hello_interval_s), scenario.clusters.period_ns
    if not every_ns:
        return 0
    return nodes * mean_access_ns(PLAIN_BYTES, scenario.radio) * period_ns // max(every_ns, period_ns)


def least_ms(needed_ns: int) -> int:
    return math.ceil(max(needed_ns / _MOST, needed_ns / _BACKLOG + TAIL_NS) / MS)

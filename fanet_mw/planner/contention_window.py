"""Whether the hellos of a superframe fit its contention window: neighbors that are missed are taken for dead.

All that is no flood of data contends there, and hellos are nearly all of it. Two hellos destroy each other at a common
neighbor, so what counts are the hellos of all within two hops, each with DIFS and a mean backoff. An estimate.
"""

from collections.abc import Iterator
from typing import Final

from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.planner.flood import contended_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, seconds_to_ns

MOST: Final = 0.75
"""Share of the window. On the 9 x 5 grid hellos that ask for all of it reach 0.58 of those who should hear them."""
_HELLO_BYTES: Final = 137
"""Routing header, HEARTBEAT, GLOBAL_POSITION_INT and FANET_BEACON."""


def hellos_ns(scenario: Scenario, adjacency: Adjacency) -> int:
    """Air that the hellos of one superframe take where most nodes are within two hops."""
    every_ns = seconds_to_ns(scenario.routing.hello_interval_s)
    if not every_ns or not adjacency:
        return 0
    crowd = 1 + max(map(len, two_hop(adjacency).values()))
    return crowd * scenario.clusters.period_ns * contended_ns(scenario.radio, _HELLO_BYTES) // every_ns


def too_short(scenario: Scenario, adjacency: Adjacency) -> Iterator[str]:
    """What is said of a window that does not hold them."""
    needed_ns, window_ns = hellos_ns(scenario, adjacency), round(scenario.clusters.contention_ms * MS)
    if needed_ns > MOST * window_ns:
        yield (
            f"the hellos of a superframe take {needed_ns / MS:.1f} ms where nodes are densest, its contention window "
            f"of {window_ns / MS:g} ms has {MOST * window_ns / MS:g} ms for them: neighbors are missed, taken for dead "
            "(clusters.contention_ms, routing.hello_interval_s, clusters.flooding_period_s)"
        )

"""How often a UAV's telemetry crosses the air to the post: as often as leaves most of the air to the swarm.

    interval = nodes x frames that carry one packet x airtime of one / the share of the air for telemetry

A packet that is flooded is carried by every node; with a route it is carried by as many as the way has hops, for which
the columns of a square swarm are taken. Where the network states least intervals, those hold if they are longer.
"""

import math
from typing import Final, NamedTuple

from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import S

SHARE: Final = 0.1
"""The share of the air that the telemetry of all UAVs may take."""
PACKET_BYTES: Final = 400
"""A packet of telemetry: each stream once."""
_SHORTEST_NS: Final = S
_ROUTED: Final = frozenset({"aodv", "olsr", "dsdv", "geographic"})


class Pace(NamedTuple):
    """The pace of telemetry in band."""

    interval_ns: int
    """Between two packets of one UAV."""
    share: float
    """Of the air, for all UAVs together."""


def pace_of(scenario: Scenario) -> Pace:
    count = scenario.nodes.count
    carried = math.ceil(math.sqrt(count)) if scenario.routing.protocol in _ROUTED else count + 1
    carried = 1 if scenario.routing.protocol == "direct" else carried
    one_ns = airtime_ns(PACKET_BYTES + OVERHEAD_BYTES, scenario.radio, rate_mbps=scenario.radio.rate_mbps)
    all_ns = count * carried * one_ns
    interval_ns = max(_SHORTEST_NS, round(all_ns / SHARE))
    return Pace(interval_ns, all_ns / interval_ns)

"""The cost of one flood whose relays contend: how long until all nodes have it, and how soon the next one may follow.

Around the busiest node all relays within two hops transmit one after another, each for airtime + DIFS + the mean
backoff; the duration is that time for each hop, plus jitter, handover and lead. CSMA/CA bounds neither, so this is an
estimate; with a timetable both are exact (`fanet_mw/bounds/turn_service.py`).
"""

from typing import NamedTuple

from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns, mean_access_ns
from fanet_mw.graph.topology import Adjacency, levels, two_hop
from fanet_mw.scenario import Radio, Scenario
from fanet_mw.units import MS, NodeId


class FloodCost(NamedTuple):
    """From the head's first bit to the last node's reception, and from one flood to the next."""

    duration_ns: int
    spacing_ns: int
    proven: bool


def frame_ns(radio: Radio, payload_bytes: int) -> int:
    return airtime_ns(payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)


def flood_cost(scenario: Scenario, adjacency: Adjacency, root: NodeId, *, payload_bytes: int) -> FloodCost:
    """The cost of one flood of such a packet, from this head to all nodes that it can reach."""
    clusters, radio = scenario.clusters, scenario.radio
    hops = levels(adjacency, root)
    per_frame_ns = mean_access_ns(payload_bytes, radio)
    sharing = max(1 + sum(1 for n in near if n in hops) for node, near in two_hop(adjacency).items() if node in hops)
    local_ns = round(sharing * relay_share(scenario, adjacency) * per_frame_ns)
    wait_ns = clusters.assess_ms * MS if clusters.relay == "counter" else 0
    per_hop_ns = round(scenario.routing.jitter_ns + wait_ns + radio.handover_ns + radio.lead_ns + local_ns)
    spacing_ns = max(local_ns, round(clusters.release_gap_ms * MS))
    return FloodCost(max(1, max(hops.values())) * per_hop_ns, spacing_ns, proven=False)


def relay_share(scenario: Scenario, adjacency: Adjacency) -> float:
    """The share of the nodes that relays a flood: all, or with `counter` at most twice the threshold of each
    neighborhood, because nodes out of range of each other do not receive each other's copies.
    """
    clusters = scenario.clusters
    neighbors = sum(len(near) for near in adjacency.values()) / max(1, len(adjacency))
    if clusters.relay != "counter" or neighbors == 0:
        return 1.0
    return min(1.0, 2.0 * clusters.counter / neighbors)

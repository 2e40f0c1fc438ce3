"""The packets per second that can reach every node, whatever the protocol: an upper bound by counting at receivers.

F: airtime of a packet's frame; D: DIFS, for which a sender finds its medium idle first (IEEE 802.11-2020, 10.3.4.2). A
station either sends or receives, and it receives one frame at a time. L packets a second, m transmissions of each:

    at each node v with d < n - 1 neighbors, which have a share s of the packets:      L ((F + D) + (d - s) F) <= d
    over all n nodes:                                                                L (m (F + D) + (n - 1) F) <= n

The first transmitter reaches itself and its neighbors, each other one at most all its neighbors but the one from which
it has the packet: that bounds m. A frame of k packets counts as k frames of 1/k of its time each. Assumed: no coding
across packets, and sources that are equally busy.
"""

from collections.abc import Collection
from typing import NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.graph.topology import Adjacency, components
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.turn_size import most_together
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, S
from sim.planner.flood_cost import frame_ns


class Goodput(NamedTuple):
    """An upper bound of the packets per second of all sources together, and what limits it."""

    per_second: float
    sources: int
    around: NodeId | None
    """The node whose neighborhood is the bottleneck; None if the swarm as a whole is."""

    @property
    def least_interval_ns(self) -> int:
        """The least interval at which sources can send if every packet is to arrive."""
        return round(self.sources * S / self.per_second)


def goodput_bound(
    adjacency: Adjacency, sources: Collection[NodeId], *, send_ns: int, receive_ns: int
) -> Goodput | None:
    """The bound, if a frame occupies its sender and each receiver so long; None if the swarm is separated."""
    nodes, senders = len(adjacency), frozenset(sources)
    if nodes < 2 or not senders or len(components(adjacency)) > 1:
        return None
    whole = fewest_transmissions(adjacency) * send_ns + (nodes - 1) * receive_ns
    best = Goodput(nodes * S / whole, len(senders), None)
    for node, near in sorted(adjacency.items()):
        if len(near) == nodes - 1:
            continue
        share = sum(1 for n in near if n in senders) / len(senders)
        per_second = len(near) * S / (send_ns + (len(near) - share) * receive_ns)
        if per_second < best.per_second:
            best = Goodput(per_second, len(senders), node)
    return best


def fewest_transmissions(adjacency: Adjacency) -> int:
    """A lower bound of the transmissions of a flood that reaches all nodes of a connected swarm."""
    missing = len(adjacency) - 2
    for count, degree in enumerate(sorted((len(near) for near in adjacency.values()), reverse=True), start=1):
        missing -= degree - 1
        if missing <= 0:
            return count
    return len(adjacency)


def any_protocol(scenario: Scenario, adjacency: Adjacency, sources: Collection[NodeId]) -> Goodput | None:
    """The bound for the application's packets, as many in a frame as it holds."""
    together = most_together(scenario)
    frame = frame_ns(scenario.radio, together * scenario.traffic.payload_bytes)
    send_ns = (frame + Timing.of(scenario.radio).difs_ns) // together
    return goodput_bound(adjacency, sources, send_ns=send_ns, receive_ns=frame // together)


def in_turns(turns: Turns, adjacency: Adjacency, sources: Collection[NodeId], *, together: int = 1) -> Goodput | None:
    """The bound for any timetable with such turns, each of which holds one frame of `together` packets."""
    if not turns.per_superframe:
        return None
    each_ns = turns.period_ns // (turns.per_superframe * together)
    return goodput_bound(adjacency, sources, send_ns=each_ns, receive_ns=each_ns)

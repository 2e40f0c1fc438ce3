"""The packets per second that can reach every node, whatever the protocol: an upper bound by counting at receivers.

F: airtime of a packet's frame; D: DIFS, for which a sender finds its medium idle first (IEEE 802.11-2020, 10.3.4.2). A
station either sends or receives, and it receives one frame at a time on any channel:

    (1)  t(u) (F + D) + (L - l(u)) F <= 1       per second, at every node u that sends t(u) frames, l(u) of them for
                                                packets of its own, L packets of all nodes together
    (2)  sum over u in N(v) of t(u) >= L        at every node v whose neighbors N(v) are not all nodes: they bring v
                                                what it lacks, and one of them takes over each packet of v's own

(1) summed over N(v), of which d nodes with a share s of the packets, and (2):      L ((F + D) + (d - s) F) <= d
(1) summed over all n nodes, m transmissions per packet:                     L (m (F + D) + (n - 1) F) <= n

Every node needs a copy of each packet, so m is at least the smallest number of nodes whose greatest degrees suffice:
the first transmitter reaches itself and its neighbors, each other one at most all its neighbors but the one from which
it has the packet. The least of these limits is the bound; whether it can be reached is not known. A frame of k packets
counts as k frames of 1/k of its time each; with the greatest k that fits, the bound holds for all. Assumed: no coding
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

"""Packets for one receiver: hop by hop along the shortest known way, each hop acknowledged by the radio.

    the next hop is a neighbor that is one hop nearer, the one that was heard last
    it does not answer -> another one that is nearer -> none is left -> the packet is flooded from here

They contend for the channel between the turns; a node sends at most one per slot, so that none runs into the turns.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.graph.topology import nodes_of
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.units import NodeId

_UNICAST: Final = 0
"""The phase flags of a packet on its way."""


class _Attempt(NamedTuple):
    """A packet that the radio is to bring to a neighbor."""

    packet: Packet
    tried: int
    """The neighbors that it was handed to, as a set of bits."""


class OneWay:
    """The packets that one node passes on to one neighbor each."""

    def __init__(self, port: Port, timing: RoundTiming, topology: Topology, heard_ns: Mapping[NodeId, int]) -> None:
        """`heard_ns`: the instant at which each neighbor was last heard; it changes."""
        self._port = port
        self._timing = timing
        self._topology = topology
        self._heard_ns = heard_ns
        self._lead_ns = port.scenario.radio.lead_ns
        self._free_ns = 0
        self._attempts: dict[int, _Attempt] = {}

    def waiting(self) -> int:
        return len(self._attempts)

    def send(self, packet: Packet, *, near: int, from_ns: int, now_ns: int, tried: int = 0) -> bool:
        """Hand a packet to a neighbor that is nearer to its destination, among `near`; False if there is none."""
        destination = NodeId(packet.header.destination)
        itself = 1 << (destination - 1)
        nearer = (itself if near & itself else self._topology.nearer(destination)) & near & ~tried
        if not nearer:
            return False
        hop = max(nodes_of(nearer), key=lambda node: self._heard_ns.get(node, 0))
        start_ns = self._timing.between_turns_ns(max(from_ns, now_ns + self._lead_ns, self._free_ns))
        self._free_ns = start_ns + self._timing.slot_ns
        request = self._port.transmit_to(packet, hop, flags=_UNICAST, start_ns=start_ns)
        self._attempts[request] = _Attempt(packet, tried | 1 << (hop - 1))
        return True

    def failed(self, status: TxStatus) -> _Attempt | None:
        """The packet, and who has been tried, if the radio could not bring it to its neighbor."""
        attempt = self._attempts.pop(status.seq, None)
        return None if status.outcome == TxOutcome.ACKED else attempt

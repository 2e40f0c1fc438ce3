"""Relaying in claimed turns: a relay passes each flood on in its next turn, so many floods are under way at once."""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.hop_limit import is_used_up
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.clustered.claimed.claimed_access import ClaimedAccess
from fanet_mw.routing.clustered.claimed.slot_acquisition import SlotAcquisition
from fanet_mw.routing.clustered.contract import Relaying
from fanet_mw.wire import Kind

_NOTHING: Final[Mapping[str, object]] = {}


class ClaimedRelaying:
    """Queues a node's relays behind its own packets. Control packets are relayed by the rule `otherwise`."""

    def __init__(self, port: Port, claiming: SlotAcquisition, access: ClaimedAccess, otherwise: Relaying) -> None:
        self._port = port
        self._claiming = claiming
        self._access = access
        self._otherwise = otherwise

    def start(self, now_ns: int) -> None:
        """The node has started; no packet is known yet."""

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        header = packet.header
        if header.kind != Kind.DATA:
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        if header.destination != self._port.node and self._claiming.relays(now_ns):
            if is_used_up(header):
                self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            else:
                self._access.let_out(packet, now_ns=now_ns)
        return ()

    def report(self) -> Mapping[str, object]:
        return _NOTHING

"""Brings packets to a cluster head as acknowledged unicast, from parent to parent along the gradient (phase TO_HEAD).

A packet is under way until the parent acknowledges it, or held while there is no route, until it expires. Without
acknowledgement it goes to the parent known by then, and is dropped after `MOST_TRIES`; a held packet's count starts
again.
"""

from typing import Final, NamedTuple

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.units import NodeId
from fanet_mw.wire import FLAG_TO_HEAD

MOST_TRIES: Final = 3
"""The number of parents that one node tries for one packet; for each of them the MAC makes several attempts."""


class Attempt(NamedTuple):
    """A packet that was sent to a parent, which has not acknowledged it yet."""

    packet: Packet
    parent: NodeId
    tries: int
    """The number of parents that this node has tried, this one included."""


class Uplink:
    """The packets of one node that are on their way to a head."""

    def __init__(self, port: Port, gradient: Gradient) -> None:
        self._port = port
        self._gradient = gradient
        self._held = TxQueue(port.scenario.routing, port.drop)
        self.expire = self._held.expire
        """The method that drops expired packets; it is called at every wake-up."""
        self._under_way: dict[int, Attempt] = {}

    def __len__(self) -> int:
        return len(self._held) + len(self._under_way)

    def send(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        route = self._gradient.route(now_ns=now_ns)
        if route is None:
            self._held.push(packet, now_ns=now_ns)
            return
        seq = self._port.transmit_to(packet, route.parent, flags=FLAG_TO_HEAD, start_ns=start_ns)
        self._under_way[seq] = Attempt(packet, route.parent, tries + 1)

    def on_status(self, status: TxStatus) -> Attempt | None:
        """A transmission has ended; returns the attempt if it was one that failed, whose parent is then given up."""
        attempt = self._under_way.pop(status.seq, None)
        if attempt is None or status.outcome is TxOutcome.ACKED:
            return None
        if status.outcome is TxOutcome.RETRY_LIMIT:
            self._gradient.lose(attempt.parent)
        return attempt

    def released(self, *, now_ns: int) -> list[Packet]:
        """Take out the held packets that have not expired, if there is a route now."""
        self.expire(now_ns=now_ns)
        return self.drain() if len(self._held) and self._gradient.route(now_ns=now_ns) is not None else []

    def drain(self) -> list[Packet]:
        """Take out all held packets, because they will go another way."""
        return self._held.drain()

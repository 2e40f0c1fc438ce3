"""The first phase of a packet, TO_HEAD: acknowledged unicast along the gradient, from parent to parent to a head.

A packet is under way to a parent that has yet to acknowledge it, or held because there is no way, until it expires.
A packet that its parent does not acknowledge goes to the parent that is known by then, and is dropped after
`MOST_TRIES` of them; one that was held in between counts them anew.
"""

from typing import Final, NamedTuple

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue, sooner_us
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.units import US, NodeId
from fanet_mw.wire import FLAG_TO_HEAD

MOST_TRIES: Final = 3
"""Parents tried for one packet at one node; below each the MAC makes its own attempts."""


class Attempt(NamedTuple):
    """A packet under way to a parent."""

    packet: Packet
    parent: NodeId
    tries: int
    """The number of parents tried at this node, this one included."""


class Uplink:
    """What is on its way from one node to a head."""

    def __init__(self, port: Port, gradient: Gradient) -> None:
        self._port = port
        self._gradient = gradient
        routing = port.scenario.routing
        self._held = TxQueue(capacity=routing.queue_frames, sooner_us=sooner_us(routing))
        self._lifetime_ns = routing.lifetime_ns(-1)
        """The lifetime of the class that lives longest; the queue knows of those that expire sooner."""
        self._under_way: dict[int, Attempt] = {}
        """The attempts that have not ended, by sequence number of the transmit request."""

    def __len__(self) -> int:
        return len(self._held) + len(self._under_way)

    def send(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        """Bring a packet one step nearer to a head, or keep it until there is a way."""
        route = self._gradient.route(now_ns=now_ns)
        if route is None:
            self._hold(packet, now_ns=now_ns)
            return
        seq = self._port.transmit_to(packet, route.parent, flags=FLAG_TO_HEAD, start_ns=start_ns)
        self._under_way[seq] = Attempt(packet, route.parent, tries + 1)

    def _hold(self, packet: Packet, *, now_ns: int) -> None:
        evicted = self._held.push(packet)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    def on_status(self, status: TxStatus) -> Attempt | None:
        """Take in how a transmission ended; returns the attempt if it has failed.

        A parent that did not acknowledge is given up.
        """
        attempt = self._under_way.pop(status.seq, None)
        if attempt is None or status.outcome is TxOutcome.ACKED:
            return None
        if status.outcome is TxOutcome.RETRY_LIMIT:
            self._gradient.lose(attempt.parent)
        return attempt

    def released(self, *, now_ns: int) -> list[Packet]:
        """Take out the packets that were held and have not expired, if there is a way now."""
        self.expire(now_ns=now_ns)
        return self.drain() if len(self._held) and self._gradient.route(now_ns=now_ns) is not None else []

    def expire(self, *, now_ns: int) -> None:
        """Drop what was held for longer than it lives."""
        for packet in self._held.expire(before_us=(now_ns - self._lifetime_ns) // US):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)

    def drain(self) -> list[Packet]:
        """Give up what is held, because it goes another way."""
        return self._held.drain()

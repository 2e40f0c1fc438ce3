"""Relaying in contention: a node passes on each packet after a random jitter, unless others have done so.

    all      the node passes on each packet, at once
    counter  it passes on a packet after a random delay, unless it has heard enough copies by then

Urgent control goes at once. `counter` is after Ni et al. (MobiCom 1999, 3.2): in a sparse swarm all relay, in a dense
one few do. Where a timetable decides: `timetable/scheduled_relaying.py`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay, is_used_up
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.random_assessment_delay import Assessment
from fanet_mw.units import MS

_CONTROL_JITTER_NS: Final = 100 * MS
_NOTHING: Final[Mapping[str, object]] = {}


class ContendingRelaying:
    """The relays of one node (`contract.Relaying`), which go as soon as they may contend."""

    def __init__(self, port: Port, contention: ContentionTiming, *, delays: Callable[[], float] | None = None) -> None:
        """`delays` draws the shares of `clusters.assess_ms` that `counter` waits; without it all is relayed at once."""
        clusters = port.scenario.clusters
        self._port = port
        self._contention = contention
        self._jitter_ns = port.scenario.routing.jitter_ns
        self._delays, self._assess_ns = delays, round(clusters.assess_ms * MS)
        self.open_until = Assessment(enough=clusters.counter)
        """The packets about which it is not decided yet whether they are relayed."""
        self.next_wake_ns = self.open_until.next_wake_ns
        """Tells when a packet is decided whose relay is still open; called after every reception."""

    def start(self, now_ns: int) -> None:
        """The node has started; no packet is known yet."""

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        header = packet.header
        if header.destination == self._port.node:
            return ()
        if is_used_up(header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return ()
        if at_once:
            return (self._relay(packet, _CONTROL_JITTER_NS, now_ns, membership=True),)
        if self._delays is None:
            return (self._relay(packet, self._jitter_ns, now_ns),)
        self.open_until.first_copy(packet, due_ns=now_ns + int(self._delays() * self._assess_ns))
        return ()

    def decided(self, now_ns: int) -> Sequence[Relay]:
        decided = self.open_until.decided(now_ns=now_ns)
        start_ns = self._contention.start_ns
        return [(packet, start_ns(due_ns=due_ns, now_ns=now_ns)) for due_ns, packet in decided] if decided else ()

    def _relay(self, packet: Packet, jitter_ns: int, now_ns: int, *, membership: bool = False) -> Relay:
        start_ns = self._contention.start_ns
        return packet, start_ns(due_ns=now_ns, now_ns=now_ns, jitter_ns=jitter_ns, membership=membership)

    def waiting(self) -> int:
        return len(self.open_until)

    def report(self) -> Mapping[str, object]:
        return _NOTHING

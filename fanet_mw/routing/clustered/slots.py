"""Access by the slots of heads: members send packets to their cluster head, which floods them in its own slot (the
protocol of section 3.3 of the paper). All other frames contend for the channel at any time.

What does not fit a slot waits for the next one. A head that loses its role uses its old slot for the rest: sending them
to the new head would cost more.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.uplink import Uplink
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.tdma.slot_timing import Slot, Superframe
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS
from fanet_mw.wire import Kind

_SPREAD_CAP_NS: Final = 40 * MS
"""Two floods this far apart no longer meet (some hops of lead, jitter and airtime); more would only add delay."""


class Tenure(NamedTuple):
    """The slot that a node has as head, or had when it last was head, and the superframe of that slot."""

    superframe: Superframe
    slot: int


class SlotRelease:
    """The transmit queue of one head."""

    def __init__(self, queue: TxQueue, clusters: Clusters, *, lead_ns: int) -> None:
        self._queue = queue
        self.expire = queue.expire
        """The method that drops expired packets; it is called at every wake-up."""
        self._spread = clusters.pacing == "spread"
        self._least_gap_ns = max(1, round(clusters.release_gap_ms * MS))
        self._lead_ns = lead_ns
        self._slot: Slot | None = None
        """The occurrence of the slot in which the next packet is released."""
        self._gap_ns = self._least_gap_ns
        """The time between two releases in that occurrence."""
        self._free_ns = 0
        """No packet is released before this instant, which is one gap after the last release."""
        self._next_ns: int | None = None

    def __len__(self) -> int:
        return len(self._queue)

    def push(self, packet: Packet, tenure: Tenure, *, now_ns: int) -> None:
        self._queue.push(packet, now_ns=now_ns)
        if self._next_ns is None:
            self.arm(tenure, now_ns=now_ns)

    def more(self, size: int) -> list[Packet]:
        """Take out packets that fit into the remaining `size` bytes of a frame that is released now."""
        return self._queue.pop_fitting(size)

    def drain(self) -> list[Packet]:
        """Take out all queued packets, because they will go another way."""
        self._next_ns = self._slot = None
        return self._queue.drain()

    def arm(self, tenure: Tenure, *, now_ns: int) -> None:
        if not len(self._queue):
            self._next_ns = None
            return
        earliest_ns = max(now_ns + self._lead_ns, self._free_ns)
        slot = tenure.superframe.occurrence(tenure.slot, not_before_ns=earliest_ns)
        if slot != self._slot:
            self._slot = slot
            self._gap_ns = self._gap_for(slot)
        self._next_ns = max(slot.start_ns, earliest_ns)

    def _gap_for(self, slot: Slot) -> int:
        if not self._spread:
            return self._least_gap_ns
        share_ns = (slot.end_ns - slot.start_ns) // max(1, len(self._queue))
        return max(self._least_gap_ns, min(share_ns, _SPREAD_CAP_NS))

    def next_wake_ns(self) -> int | None:
        return None if self._next_ns is None else self._next_ns - self._lead_ns

    def due(self, tenure: Tenure, *, now_ns: int) -> list[tuple[Packet, int]]:
        """Take out the packets to announce now, each with its instant."""
        released = []
        while self._next_ns is not None and self._next_ns - self._lead_ns <= now_ns and len(self._queue):
            if self._slot is not None and self._next_ns == self._slot.start_ns:
                self._gap_ns = self._gap_for(self._slot)  # the gap follows from the queue when the slot begins
            released.append((self._queue.pop(), self._next_ns))
            self._free_ns = self._next_ns + self._gap_ns
            self.arm(tenure, now_ns=now_ns)
        if not len(self._queue):
            self._next_ns = None
        return released


_NOTHING: Final[Mapping[str, object]] = {}


class SlotAccess:
    """The slot of one node (`contract.ScheduledAccess`) while it is head; its route to a head while it is not."""

    def __init__(
        self, port: Port, release: SlotRelease, *, membership: Membership, uplink: Uplink, floods: Floods
    ) -> None:
        self._port = port
        self._release = release
        self.next_wake_ns = release.next_wake_ns
        """The method that tells when a queued packet is due; it is called after every reception."""
        self._membership = membership
        self._uplink = uplink
        self._floods = floods
        self._tenure: Tenure | None = None
        """The slot of this node, or the one that it had when it last was head; None if it has never been head."""

    def start(self, now_ns: int) -> None: ...

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        return True

    def most_packet_bytes(self, priority: int) -> int:
        return self._port.scenario.radio.max_frame_bytes

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self.forward(packet, start_ns=due_ns, now_ns=now_ns)

    def forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int = 0) -> None:
        if self._membership.is_head:
            self.enqueue(packet, now_ns=now_ns)
        else:
            self._uplink.send(packet, start_ns=start_ns, now_ns=now_ns, tries=tries)

    def enqueue(self, packet: Packet, *, now_ns: int) -> None:
        assert self._tenure is not None, "a node queues packets only once it has become head"
        self._release.push(packet, self._tenure, now_ns=now_ns)

    def flood_control(
        self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False, patient: bool = False
    ) -> Packet:
        return self._floods.contend_control(kind, inner, now_ns=now_ns)

    def answer(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._floods.contend_again(packet, due_ns=due_ns, now_ns=now_ns)

    def hello_due_ns(self, start_ns: int) -> int:
        return start_ns

    def hello_start_ns(self, start_ns: int) -> int:
        return start_ns

    def hello_until_ns(self, start_ns: int, size: int) -> int:
        return 0

    # --- when the schedule changes the node's role ----------------------------------------------------------------

    def serve(self, now_ns: int) -> None:
        self.arm(now_ns)
        for packet in self.drain_uplink():
            self.enqueue(packet, now_ns=now_ns)

    def arm(self, now_ns: int) -> None:
        self.renew_slot()
        assert self._tenure is not None, "the slot was renewed just now"
        self._release.arm(self._tenure, now_ns=now_ns)

    def renew_slot(self) -> None:
        superframe = self._membership.superframe
        assert superframe is not None, "a head has been named by a schedule"
        self._tenure = Tenure(superframe, self._membership.slot)

    def drain_uplink(self) -> list[Packet]:
        """Take out all packets that wait for a route to a head, because they will go another way."""
        return self._uplink.drain()

    def drain(self) -> list[Packet]:
        """Take out all packets that wait for the slot, or for a route to a head, because they will go another way."""
        return [*self._release.drain(), *self.drain_uplink()]

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        if self._release.next_wake_ns() is None:
            return  # nothing is queued
        self._release.expire(now_ns=now_ns)
        for packet, start_ns in self._release.due(self._tenure, now_ns=now_ns) if self._tenure else ():
            packets = [packet, *self._release.more(self._room(packet))]
            self._floods.begin(packets, start_ns=self._floods.beside_turns_ns(packets, start_ns))

    def _room(self, packet: Packet) -> int:
        """The number of bytes that are left for other packets in a frame with this one."""
        scenario = self._port.scenario
        return scenario.radio.max_frame_bytes - len(packet.frame) if scenario.routing.aggregate else 0

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return len(self._release)

    def report(self) -> Mapping[str, object]:
        return _NOTHING

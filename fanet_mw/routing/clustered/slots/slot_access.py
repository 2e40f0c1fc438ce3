"""Access by the slots of heads: members send packets to their cluster head, which floods them in its own slot.

This is the protocol of section 3.3 of the paper that fanet-mw follows ("Reliable Flying IoT Networks for UAV Disaster
Rescue Operations"). All other frames contend for the channel at any time: hellos, control packets, relays, and unicasts
on the way to a head.
"""

from collections.abc import Mapping
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.uplink import Uplink
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.slots.slot_release import SlotRelease, Tenure
from fanet_mw.wire import Kind

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

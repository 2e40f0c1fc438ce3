"""Access by claimed slots: each node has TDMA turns of its own, which the nodes agree on in hellos, without a leader.

    listen -> claim a slot that is free within two hops, and say so in hellos -> send in the turns of this slot

A node that holds a slot sends its own packets and its relays in its turns. A node that holds none yet sends its packets
to a neighbor that does, as acknowledged unicast in the contention window at the beginning of each period. A period
holds as many superframes as fit; `slot_claims.py` explains their lengths, `own_turns.py` the turns that nobody claims.

Each hello goes either in a turn of the node or in the contention window, at random. In a turn no node within two hops
disturbs it; but if all hellos went in turns, two nodes near each other that claim the same slot would always send at
the same time, and would never learn of each other. A hello that is lost in the crowded window goes in a turn next time.

A packet that finds no other packet in the queue leaves each hop within the `hop_ms` of the report. There is no bound
from end to end once packets queue, because the length of a relay's queue depends on all sources. Not handled:
interference from beyond two hops. No bound is stated if clocks disagree by more than `clusters.turn_slack_us`.
"""

from collections.abc import Mapping

from fanet_mw.bounds.turn_service import TurnServer
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.claimed.claimed_release import ClaimedRelease
from fanet_mw.routing.clustered.claimed.slot_acquisition import Change, SlotAcquisition
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.gradient import NO_HEAD, Gradient
from fanet_mw.routing.clustered.forwarding.uplink import Uplink
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.units import MS, US, seconds_to_ns
from fanet_mw.wire import Kind
from fanet_mw.wire.hello.beacon import Beacon
from fanet_mw.wire.hello.claims import Claims


class ClaimedAccess:
    """The claimed turns of one node; while it has none, its route to a neighbor that has."""

    def __init__(
        self,
        port: Port,
        *,
        claiming: SlotAcquisition,
        queue: ClaimedRelease,
        turn_bytes: int,
        gradient: Gradient,
        uplink: Uplink,
        floods: Floods,
        contention: ContentionTiming,
    ) -> None:
        self._port = port
        self._claiming = claiming
        self._queue = queue
        self._turn_bytes = turn_bytes
        self._gradient = gradient
        self._uplink = uplink
        self._floods = floods
        self._contention = contention
        self._lead_ns = port.scenario.radio.lead_ns
        self._lifetime_ns = seconds_to_ns(port.scenario.routing.lifetime_s)

    def start(self, now_ns: int) -> None:
        """Begin to listen; the node joins nothing, because no leader assigns anything."""
        self._claiming.start(now_ns)

    # --- letting out ----------------------------------------------------------------------------------------------

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        return True

    def most_packet_bytes(self, priority: int) -> int:
        return self._turn_bytes

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self.forward(packet, start_ns=due_ns, now_ns=now_ns)

    def forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int = 0) -> None:
        if self._claiming.own.share is None:
            start_ns = self._contention.not_before(start_ns)
            self._uplink.send(packet, start_ns=start_ns, now_ns=now_ns, tries=tries)
        else:
            self.let_out(packet, now_ns=now_ns)

    def let_out(self, packet: Packet, *, now_ns: int) -> None:
        """Queue a packet for the turns of this node, either an own packet or one to relay."""
        if len(packet.frame) > self._turn_bytes:
            self._port.drop(DropReason.TOO_LARGE, packet, now_ns=now_ns)
            return
        self._claiming.push()
        evicted = self._queue.push(packet, now_ns=now_ns)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    def flood_control(
        self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False, patient: bool = False
    ) -> Packet:
        return self._floods.contend_control(kind, inner, now_ns=now_ns)

    def answer(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._floods.contend_again(packet, due_ns=due_ns, now_ns=now_ns)

    # --- hellos ---------------------------------------------------------------------------------------------------

    def hello_start_ns(self, start_ns: int, *, size: int) -> int:
        if size <= self._turn_bytes and self._contention.by_chance(0.5):
            own_ns = self._queue.reserve(not_before_ns=start_ns)
            if own_ns is not None:
                return own_ns
        return self._contention.not_before(start_ns)

    def claims(self, now_ns: int) -> Claims:
        """Settle the node's claim and what follows from it, once per hello; returns the statement for that hello."""
        change = self._claiming.settle(now_ns)
        if change is Change.WON:
            self._gradient.join(self._port.node, now_ns=now_ns)
            for packet in self._uplink.drain():
                self.let_out(packet, now_ns=now_ns)
        elif change is Change.LOST:
            self._gradient.join(NO_HEAD, now_ns=now_ns)
            for packet in self._queue.drain():
                self.forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns)
        status = self._claiming.slot_status(waiting=len(self._queue), now_ns=now_ns)
        return Claims(self._port.node, status, self._claiming.near.heard(now_ns=now_ns))

    def on_claims(self, claims: Claims, beacon: Beacon, *, now_ns: int) -> None:
        self._claiming.on_claims(claims, now_ns=now_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        return self._queue.next_wake_ns()

    def wake(self, now_ns: int) -> None:
        for packet in self._queue.expire(before_us=(now_ns - self._lifetime_ns) // US):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
        if len(self._queue):
            self._claiming.draw(now_ns)
        for packets, start_ns in self._queue.due(now_ns=now_ns):
            self._floods.begin(packets, start_ns=start_ns)

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return len(self._queue)

    def hop_ns(self) -> int | None:
        """The longest time that a packet waits for a turn of this node if no other packet waits before it.

        It includes one turn that a hello may take.
        """
        turns, claimed = self._claiming.own.turns, self._claiming.own.claimed()
        scenario = self._port.scenario
        slack_ns, error_ns = turn_slack_ns(scenario), self._port.clock_error_ns
        if not claimed or not clocks_fit(scenario.clock, slack_ns=slack_ns, clock_error_ns=error_ns):
            return None
        starts = tuple(turns.start_ns(turn, superframe_start_ns=0) for turn in claimed)
        ahead_ns = self._lead_ns + scenario.radio.handover_ns
        return TurnServer(turns.turn_ns, turns.period_ns, starts, ahead_ns).completion_ns(2)

    def report(self) -> Mapping[str, object]:
        hop_ns = self.hop_ns()
        return {**self._claiming.report(), "hop_ms": None if hop_ns is None else hop_ns / MS}

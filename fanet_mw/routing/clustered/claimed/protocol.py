"""The clustered protocol in slots that nodes agree on over the air: no leader, no timetable, no heads for data.

    listen -> claim a slot free within two hops, say so in hellos -> own packets and relays go in turns of our own

Every node that holds a slot lets its packets out itself; one that holds none yet brings them to a neighbor that does,
as acknowledged unicast in the contention window at the beginning of each period. A flood passes on as a relay's next
turn comes, many floods at once (pipelined). Relays are a connected dominating set, which each node decides for itself
out of the hellos, among those that hold a slot. A period holds as many superframes as fit; lengths of superframes and
turns won by lot: `slot_claims`, `own_turns`.

Hellos go in a turn of ours or in the contention window, by lot: in a turn no other of two hops disturbs them, but two
that claim one slot and hear each other, or share a neighbor, would never learn of it. The window is short: a hello
that is lost in it comes in a turn the next time.

Bound: a packet that finds none before it leaves within `hop_ms` (report), each hop. There is no bound end to end when
packets queue: how many come together at a relay depends on all sources and on the way here. Not modeled: interference
from beyond two hops; clocks that disagree by more than `clusters.turn_slack_us` allows (no bound is stated then).
"""

from collections import deque
from collections.abc import Mapping, Sequence
from math import ceil
from typing import Final

from fanet_mw.bounds.turn_gaps import TurnServer
from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.arrival import decoded
from fanet_mw.node.contract import Port
from fanet_mw.node.queue import Packet, TxQueue, sooner_us
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns, Share, draws
from fanet_mw.routing.clustered.claimed.slot_claims import Claim, Hello, SlotClaims
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.relaying.neighborhood import Neighborhood
from fanet_mw.routing.clustered.roles.states import Action
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease
from fanet_mw.routing.clustered.tdma.turns import Turns, clocks_fit, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S, earliest, seconds_to_ns
from fanet_mw.wire import HEADER_BYTES, Kind
from fanet_mw.wire.claims import MESSAGE_BYTES, MOST_LOTS, Claims, Standing

_LISTEN: Final = 3
"""Hello intervals before the first claim: neighbors and theirs are known after two, when none is lost."""
_LIFETIMES: Final = 3.5
_LONGEST: Final = 128
"""Slots of the longest superframe; crowds beyond leave some without."""
_SAID: Final = 3
"""Hellos after which everyone within two hops knows how many lots we have."""
IDLE: Final = 0.25
"""Who needs less than this share of its claimed turns draws no lots."""
_LEAST_FRAME: Final = 256
_POSITION_BYTES: Final = 61
"""HEARTBEAT and GLOBAL_POSITION_INT, which the application puts before ours."""
_NO_HEAD: Final = NodeId(0)


class OwnRelease(TurnRelease):
    """What waits for our turns: own packets and relays, most urgent first."""

    def __init__(self, queue: TxQueue, own: OwnTurns, *, lead_ns: int, frame_bytes: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._own = own
        self._frame_bytes = frame_bytes

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        start_ns = self._own.next_start_ns(not_before_ns=earliest_ns)
        return None if start_ns is None else OwnTurn(start_ns, self._frame_bytes)

    def due(self, *, now_ns: int) -> list[tuple[list[Packet], int]]:
        """Turns may have come and gone since the last look. Who is woken late still uses a turn that is ahead."""
        planned = self._next
        self._arm(now_ns)
        if planned is not None and planned.start_ns >= now_ns:
            later_ns = planned.start_ns if self._next is None else self._next.start_ns
            self._next = self._turn(min(planned.start_ns, later_ns))
        return super().due(now_ns=now_ns)

    def reserve(self, *, not_before_ns: int) -> int | None:
        """A turn for something that is not queued."""
        return self._own.reserve(not_before_ns=max(not_before_ns, self._free_ns))


class Load:
    """How many lots a node wants: by what it had to send, against the turns of its claim."""

    def __init__(self, now_ns: int) -> None:
        self._pushed = 0
        self._since_ns = now_ns
        self._said: deque[int] = deque([0] * _SAID, maxlen=_SAID)

    def push(self) -> None:
        self._pushed += 1

    def lots(self, *, waiting: int, turns_per_s: float, now_ns: int) -> int:
        """For the next hello; asked once per hello."""
        turns = turns_per_s * (now_ns - self._since_ns) / S
        wanted = (self._pushed + waiting) / turns if turns > 0 else 0.0
        self._pushed, self._since_ns = 0, now_ns
        self._said.append(0 if wanted < IDLE else min(MOST_LOTS, ceil(2 * wanted)))
        return self._said[-1]

    def drawn(self) -> int:
        """The lots that we may draw with: no more than anyone believes we have."""
        return min(self._said)


class Claimed(Clustered):
    """Pipelined floods in claimed slots, at one node."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        scenario = port.scenario
        self._lifetime_ns = seconds_to_ns(scenario.routing.lifetime_s)
        self._hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        self._window_random = port.stream("window").random
        self._turn_bytes = turn_bytes(scenario)
        self._own = OwnTurns(geometry(scenario, self._turn_bytes))
        self._queue = OwnRelease(
            TxQueue(capacity=scenario.routing.queue_frames, sooner_us=sooner_us(scenario.routing)),
            self._own,
            lead_ns=self._lead_ns,
            frame_bytes=scenario.radio.max_frame_bytes if scenario.routing.aggregate else 0,
        )
        self._near = Neighborhood(
            port.node, lifetime_ns=int(_LIFETIMES * self._hello_ns), rank=lambda _, standing: _rank(standing.slot)
        )
        self._load = Load(0)
        self._longest = longest_superframe(self._own.turns)
        self._claims = self._new_claims(0)
        self._known_ns = 0
        self._hello_bytes = 0
        self._claimed_ns: int | None = None
        """When our claim last changed."""
        self._news = False
        """A hello said what we have not drawn with yet."""

    def _new_claims(self, now_ns: int) -> SlotClaims:
        slots = self._port.scenario.clusters.slots
        return SlotClaims(
            self._port.node,
            now_ns=now_ns,
            listen_ns=_LISTEN * self._hello_ns,
            lifetime_ns=int(_LIFETIMES * self._hello_ns),
            slots=slots or None,
            sized_to=None if slots else self._longest,
        )

    def start(self, now_ns: int) -> None:
        """No join: nobody assigns anything, and every node obeys none but itself."""
        self._upkeep.start(now_ns, leads=True)
        self._claims = self._new_claims(now_ns)
        self._load = Load(now_ns)
        self._known_ns = now_ns + _LISTEN * self._hello_ns

    def _do(self, actions: Sequence[Action], now_ns: int) -> None:
        """No clusters to keep alive either."""

    # --- letting out and passing on -------------------------------------------------------------------------------

    def _forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        if self._own.share is None:
            super()._forward(packet, start_ns=self._contending_ns(start_ns), now_ns=now_ns, tries=tries)
        else:
            self._let_out(packet, now_ns=now_ns)

    def _let_out(self, packet: Packet, *, now_ns: int) -> None:
        if len(packet.frame) > self._turn_bytes:
            self._port.drop(DropReason.TOO_LARGE, packet, now_ns=now_ns)
            return
        self._load.push()
        evicted = self._queue.push(packet, now_ns=now_ns)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    def _flood_on(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if packet.header.kind != Kind.DATA:
            super()._flood_on(packet, reception, now_ns=now_ns)
        elif packet.header.destination != self._port.node and self._relays(now_ns):
            if packet.header.hop_limit <= 1:
                self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            else:
                self._let_out(packet, now_ns=now_ns)

    def _relays(self, now_ns: int) -> bool:
        if self._own.share is None:
            return False
        slot = self._own.share.slot
        return now_ns < self._known_ns or self._near.dominates(own_rank=_rank(slot), now_ns=now_ns)

    # --- hellos ---------------------------------------------------------------------------------------------------

    def hello_start_ns(self, start_ns: int) -> int:
        if self._hello_bytes <= self._turn_bytes and self._window_random() < 0.5:
            own_ns = self._queue.reserve(not_before_ns=start_ns)
            if own_ns is not None:
                return own_ns
        return self._contending_ns(start_ns)

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        own = self._step(now_ns)
        claims = Claims(self._port.node, own, self._near.heard(now_ns=now_ns))
        inner = super().hello_inner(room - MESSAGE_BYTES, now_ns=now_ns)
        inner += claims.encode_frames(room - len(inner))
        self._hello_bytes = HEADER_BYTES + _POSITION_BYTES + len(inner)
        return inner

    def _step(self, now_ns: int) -> Standing:
        """Once per hello: settle our claim, and what follows from it."""
        slots = self._port.scenario.clusters.slots
        claim = self._claims.step(now_ns).own
        before, length = self._own.share, slots or claim.length
        self._own.share = None if claim.slot is None else Share(claim.slot, length)
        if self._own.share != before:
            self._claimed_ns = now_ns
        if before is None and self._own.share is not None:
            self._gradient.join(self._port.node, now_ns=now_ns)
            for packet in self._uplink.drain():
                self._let_out(packet, now_ns=now_ns)
        elif before is not None and self._own.share is None:
            self._gradient.join(_NO_HEAD, now_ns=now_ns)
            for packet in self._queue.drain():
                self._forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)
        turns_per_s = len(self._own.claimed()) * S / self._own.turns.period_ns
        lots = self._load.lots(waiting=len(self._queue), turns_per_s=turns_per_s, now_ns=now_ns)
        self._news = True  # somebody may have fallen silent
        self._draw(now_ns)
        return Standing(claim.slot, length, claim.crowd, lots)

    def hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        super().hello(packet, reception, now_ns=now_ns)
        claims = decoded(packet, Claims.decode_frames)
        if claims is not None and any(heard.node > self._port.scenario.nodes.count for heard in claims.heard):
            raise MalformedFrameError("claims of nodes that are not there")
        if claims is None or claims.node != reception.src:
            return
        heard = tuple(self._claim(h.node, h.standing) for h in claims.heard)
        self._claims.hear(Hello(self._claim(claims.node, claims.own), heard), now_ns=now_ns)
        self._news |= self._near.hear(claims, now_ns=now_ns)

    def _claim(self, node: NodeId, standing: Standing) -> Claim:
        """As `slot_claims` knows it. What no superframe of ours can hold is no claim: it came off the air."""
        slot, length = standing.slot, standing.length
        fixed = self._port.scenario.clusters.slots
        if fixed:
            return Claim(node, slot if length == fixed else None)
        if length > self._longest or length & (length - 1):
            return Claim(node, None, crowd=standing.crowd)
        return Claim(node, slot, length=length, crowd=standing.crowd)

    def _draw(self, now_ns: int) -> None:
        """Know again which turns nobody claims, and who draws for them; only who draws needs to."""
        lots = self._load.drawn()
        if not lots:
            self._own.draws = None
        elif self._news or self._own.draws is None or self._own.draws.lots != lots:
            self._news = False
            said = self._near.standings(now_ns=now_ns)
            shares = ((n, None if s.slot is None or not s.length else Share(s.slot, s.length)) for n, s in said)
            self._own.draws = draws(self._port.node, lots, shares, ((n, s.lots) for n, s in said))

    # --- contending -----------------------------------------------------------------------------------------------

    def _contending_ns(self, start_ns: int) -> int:
        return self._own.turns.contending_ns(start_ns, self._window_random)

    def _start_ns(self, *, now_ns: int, jitter_ns: int) -> int:
        return self._contending_ns(super()._start_ns(now_ns=now_ns, jitter_ns=jitter_ns))

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        return earliest(super().next_wake_ns(), self._queue.next_wake_ns())

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        for packet in self._queue.expire(before_us=(now_ns - self._lifetime_ns) // 1000):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
        if len(self._queue):
            self._draw(now_ns)
        for packets, start_ns in self._queue.due(now_ns=now_ns):
            self._floods.begin(packets, start_ns=start_ns)

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return super().waiting() + len(self._queue)

    def hop_ns(self) -> int | None:
        """The longest that a packet may take over this node when none is before it: one turn may go to a hello."""
        turns, claimed = self._own.turns, self._own.claimed()
        scenario = self._port.scenario
        if not claimed or not clocks_fit(scenario, clock_error_ns=self._port.clock_error_ns):
            return None
        starts = tuple(turns.start_ns(turn, frame_start_ns=0) for turn in claimed)
        ahead_ns = self._lead_ns + scenario.radio.handover_ns
        return TurnServer(turns.turn_ns, turns.period_ns, starts, ahead_ns).completion_ns(2)

    def report(self) -> Mapping[str, object]:
        share, hop_ns = self._own.share, self.hop_ns()
        return {
            **super().report(),
            "slot": None if share is None else share.slot,
            "superframe": None if share is None else share.length,
            "claimed_ms": None if self._claimed_ns is None else self._claimed_ns / MS,
            "clashes": self._claims.repairs,
            "lots": self._load.drawn(),
            "hop_ms": None if hop_ns is None else hop_ns / MS,
        }


def _rank(slot: int | None) -> float:
    """Who holds a slot relays rather than who does not."""
    return 0.0 if slot is None else 1.0


def turn_bytes(scenario: Scenario) -> int:
    """The largest frame that a turn must hold."""
    least = max(scenario.traffic.payload_bytes, _LEAST_FRAME)
    return max(least, scenario.radio.max_frame_bytes) if scenario.routing.aggregate else least


def longest_superframe(turns: Turns) -> int:
    """Slots of the longest superframe: a power of two that fits a period."""
    return 1 << (min(_LONGEST, max(1, turns.per_frame)).bit_length() - 1)


def geometry(scenario: Scenario, frame_bytes: int) -> Turns:
    """Periods in which every hello finds a window, from the swarm's beginning."""
    period_ns = min(scenario.clusters.period_ns, seconds_to_ns(scenario.routing.hello_interval_s) // 2)
    contention_ns = round(scenario.clusters.contention_ms * MS)
    turn = turn_ns(scenario, payload_bytes=frame_bytes)
    return Turns(0, period_ns, contention_ns, turn, max(0, period_ns - contention_ns) // turn)

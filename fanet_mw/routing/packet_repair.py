"""Repair of lost packets by anti-entropy: a hello states what its sender has, and a neighbor sends it what it lacks.

    hello with digest -> packets that its sender lacks -> wait U(0, assessment) -> flood them again, unless another node
                                                                                   has done so in the meantime

Packets are kept in a bounded store, so separated parts of a swarm learn each other's packets when they meet; one is
repaired only when its own flood should be over. After epidemic routing (Vahdat and Becker, 2000), with suppression as
in Trickle (RFC 6206). A packet stays lost if it is older than `window_s`, or if its origin has sent 32 packets since.
In a timetable over links that lose nothing, hellos state nothing until a node misses a packet (`missing_packets.py`).
"""

import heapq
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import compress
from operator import ne
from typing import Final, NamedTuple

from fanet_mw.node.duplicates import key_of, key_of_packet, origin_and_seq
from fanet_mw.node.packet import Packet
from fanet_mw.units import MS, US
from fanet_mw.wire.hello.digest import CAPACITY, Digest, Holding

ASSESS_NS: Final = 200 * MS
"""Nodes that could repair the same packet wait for a random time up to this, so that mostly only one of them does."""
FLOOD_OVER_NS: Final = 500 * MS
"""The time after which a received flood is over everywhere."""
RIPE_NS: Final = FLOOD_OVER_NS + ASSESS_NS
"""The time after a flood within which some node sends what a hello shows to be missing."""
AGAIN_NS: Final = 900 * MS
"""When a node may repair the same packet again: the neighbor has sent another hello that lacks it."""
_PER_HELLO: Final = 32
"""The greatest number of packets that are sent for one hello: 35 ms of airtime at 11 Mb/s and 1024 B."""
_MOST_ORIGINS: Final = 4 * CAPACITY
"""The most origins in one hello: four messages, 1028 bytes. In larger swarms hellos state them in turn."""
_new: Final = tuple.__new__  # for what is made once per packet


class _Kept(NamedTuple):
    """A packet in the store, and when it may be repaired."""

    packet: Packet
    ripe_ns: int
    """The instant before which the packet is not repaired, because its flood may not be over."""


class Repair:
    """The store of packets of one node, and the repairs that it plans."""

    def __init__(
        self,
        *,
        window_ns: int,
        capacity: int,
        random: Callable[[], float],
        flood_over_ns: int = FLOOD_OVER_NS,
        begin_ns: Callable[[int], int] | None = None,
    ) -> None:
        """`flood_over_ns`: when a received flood should be over. `begin_ns`: draws a due repair's instant."""
        self._window_ns = window_ns
        self._begin_ns = begin_ns or self._within_assessment_ns
        self._flood_over_ns = flood_over_ns
        self._capacity = capacity
        self._random = random
        self._holdings: dict[int, Holding] = {}
        self._store: dict[int, dict[int, _Kept]] = {}
        """The stored packets by sequence number, for each origin of which there is any."""
        self._order: deque[tuple[int, int, int]] = deque()
        """Origin, sequence number and generation [swarm us] of each stored packet, in the order of arrival."""
        self.pending: dict[int, int] = {}
        self._due: list[tuple[int, int]] = []
        self._turn = 0
        self.repaired = 0

    # --- what the node holds ------------------------------------------------------------------------------------------

    def hold(self, packet: Packet, *, flooded: bool, expect_ns: int, now_ns: int) -> None:
        """Store a data packet, received or own. One that has not been flooded yet should have been by `expect_ns`."""
        header = packet.header
        origin, seq = header.origin, header.seq
        holding = self._holdings.get(origin)
        self._holdings[origin] = Holding(origin, seq, 0) if holding is None else holding.with_(seq)
        ripe_ns = now_ns + self._flood_over_ns if flooded else expect_ns
        of_origin = self._store.get(origin)
        if of_origin is None:
            of_origin = self._store[origin] = {}
        known = of_origin.get(seq)
        if known is not None:
            of_origin[seq] = _Kept(packet, min(ripe_ns, known.ripe_ns))
            return
        of_origin[seq] = _new(_Kept, (packet, ripe_ns))
        order = self._order
        order.append((origin, seq, header.origin_us))
        if len(order) > self._capacity or order[0][2] < (now_ns - self._window_ns) // US:
            self._forget(now_ns)

    def _forget(self, now_ns: int) -> None:
        """Drop packets that are too old to be repaired, and the oldest ones beyond the capacity."""
        horizon_us = (now_ns - self._window_ns) // US
        order, store = self._order, self._store
        while order:
            origin, seq, born_us = order[0]
            if len(order) <= self._capacity and born_us >= horizon_us:
                return
            order.popleft()
            of_origin = store[origin]
            del of_origin[seq]
            if not of_origin:
                del store[origin]

    @property
    def holds_any(self) -> bool:
        return bool(self._store)

    def digest(self, *, now_ns: int, most: int = _MOST_ORIGINS) -> Digest:
        """The digest for this node's hello: of all origins, or of the next `most` of them."""
        most = min(most, _MOST_ORIGINS)
        self._forget(now_ns)
        origins = sorted(self._store)
        if len(origins) <= most:
            return Digest(tuple(self._holdings[origin] for origin in origins), complete=True)
        at = self._turn % len(origins)
        self._turn = at + most
        turn = (origins + origins)[at : at + most]
        return Digest(tuple(self._holdings[origin] for origin in turn), complete=False)

    def lacks(self, digest: Digest) -> Iterator[tuple[int, int]]:
        """The packets that a neighbor has and this node lacks, by origin and number."""
        for theirs in digest.holdings:
            mine = self._holdings.get(theirs.origin)
            if mine is None or (mine.newest, mine.held) != (theirs.newest, theirs.held):
                yield from ((theirs.origin, seq) for seq in theirs.beyond(mine))

    # --- what a neighbor lacks ------------------------------------------------------------------------------------

    def on_digest(self, digest: Digest, *, now_ns: int) -> None:
        """A neighbor's hello was received: plan to send what it lacks."""
        told, held, origins = digest.by_origin, self._holdings, self._store
        planned = 0
        for origin in compress(origins, map(ne, map(told.get, origins), map(held.__getitem__, origins))):
            theirs = told.get(origin)
            if theirs is None and not digest.complete:
                continue
            of_origin = origins[origin]
            for seq in held[origin].beyond(theirs):
                kept = of_origin.get(seq)
                if kept is None or kept.ripe_ns > now_ns:
                    continue
                key = key_of(origin, seq)
                if key not in self.pending:
                    self._plan(key, now_ns)
                    planned += 1
                    if planned == _PER_HELLO:
                        return

    def pass_on(self, packet: Packet, now_ns: int) -> None:
        """Flood a stored packet again soon, unless another node does, because its own flood may have ended here."""
        key = key_of_packet(packet)
        if key not in self.pending and packet.header.seq in self._store.get(packet.header.origin, ()):
            self._plan(key, now_ns)

    def _plan(self, key: int, now_ns: int) -> None:
        due_ns = self._begin_ns(now_ns)
        self.pending[key] = due_ns
        heapq.heappush(self._due, (due_ns, key))

    def _within_assessment_ns(self, now_ns: int) -> int:
        return now_ns + int(self._random() * ASSESS_NS)

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has sent this packet, so the nodes around have it, and the plan to send it is cancelled."""
        if self.pending.pop(key, None) is not None:
            self._put_off(key, now_ns)

    def _put_off(self, key: int, now_ns: int) -> None:
        origin, seq = origin_and_seq(key)
        of_origin = self._store.get(origin, {})
        kept = of_origin.get(seq)
        if kept is not None:
            of_origin[seq] = kept._replace(ripe_ns=now_ns + AGAIN_NS)

    def next_wake_ns(self) -> int | None:
        due = self._due
        while due and self.pending.get(due[0][1]) != due[0][0]:
            heapq.heappop(due)  # the repair was cancelled
        return due[0][0] if due else None

    def due(self, *, now_ns: int) -> Sequence[tuple[int, Packet]]:
        """The packets to flood again now, each with the instant at which that was due."""
        if not self._due or self._due[0][0] > now_ns:
            return ()
        packets = []
        while (due_ns := self.next_wake_ns()) is not None and due_ns <= now_ns:
            _, key = heapq.heappop(self._due)
            del self.pending[key]
            origin, seq = origin_and_seq(key)
            kept = self._store.get(origin, {}).get(seq)
            if kept is not None:
                packets.append((due_ns, kept.packet))
                self._put_off(key, now_ns)
        self.repaired += len(packets)
        return packets

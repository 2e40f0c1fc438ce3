"""Anti-entropy: a neighbor's hello states what it holds; of the nodes that hold what it lacks, one sends it once more.

    hello with digest -> packets it lacks -> after U(0, assessment), unless another node has sent it -> flooded again

Packets wait in a bounded store, so that a swarm that was in parts for a while gets to know what each part knew. A
packet is repaired only when its own flood should be long over. After epidemic routing (Vahdat and Becker, 2000) and
Trickle's suppression (RFC 6206). What is lost for more than `window_s`, or is more than 32 packets of its origin
behind, stays lost.
"""

import heapq
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Final, NamedTuple

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet
from fanet_mw.units import MS, US
from fanet_mw.wire.digest import CAPACITY, Digest, Holding

_ASSESS_NS: Final = 200 * MS
"""The nodes that could repair the same packet wait for a random time up to this, so that mostly only one does."""
_FLOOD_OVER_NS: Final = 500 * MS
"""The time after which a flood that was heard is over everywhere."""
RIPE_NS: Final = _FLOOD_OVER_NS + _ASSESS_NS
"""The time after a flood within which some node sends what a hello shows to be missing."""
_AGAIN_NS: Final = 900 * MS
"""The time after which a node repairs the same packet again: the neighbor has had a hello to state that it lacks it."""
_PER_HELLO: Final = 32
"""The most packets sent for one hello: 35 ms of airtime at 11 Mb/s and 1024 B."""
_MOST_ORIGINS: Final = 4 * CAPACITY
"""The most holdings in one hello: four messages, 1028 bytes. Larger swarms state them in turns."""


class _Kept(NamedTuple):
    """A packet in the store."""

    packet: Packet
    ripe_ns: int
    """The instant before which the packet is not repaired."""


class Repair:
    """The store of one node, and its repairs."""

    def __init__(self, *, window_ns: int, capacity: int, random: Callable[[], float]) -> None:
        self._window_ns = window_ns
        self._capacity = capacity
        self._random = random
        self._holdings: dict[int, Holding] = {}
        self._store: dict[int, _Kept] = {}
        """The packets kept, by key."""
        self._order: deque[int] = deque()
        """The keys of the store, oldest first."""
        self._stored: dict[int, int] = {}
        """The number of packets of each origin in the store."""
        self._pending: dict[int, int] = {}
        """The instant at which each packet is to be sent, by key."""
        self._due: list[tuple[int, int]] = []
        self._turn = 0
        self.repaired = 0

    # --- what the node holds ------------------------------------------------------------------------------------------

    def hold(self, packet: Packet, *, flooded: bool, expect_ns: int, now_ns: int) -> None:
        """Keep a data packet that came by, or an own one; one not yet flooded should have been by `expect_ns`."""
        header = packet.header
        key = key_of(origin=header.origin, seq=header.seq)
        holding = self._holdings.get(header.origin)
        self._holdings[header.origin] = (
            Holding(header.origin, header.seq, 0) if holding is None else holding.with_(header.seq)
        )
        ripe_ns = now_ns + _FLOOD_OVER_NS if flooded else expect_ns
        known = self._store.get(key)
        if known is not None:
            self._store[key] = _Kept(packet, min(ripe_ns, known.ripe_ns))
            return
        self._store[key] = _Kept(packet, ripe_ns)
        self._order.append(key)
        self._stored[header.origin] = self._stored.get(header.origin, 0) + 1
        self._forget(now_ns)

    def _forget(self, now_ns: int) -> None:
        """Drop what is too old to be repaired, and the oldest beyond the capacity."""
        horizon_us = (now_ns - self._window_ns) // US
        order, store = self._order, self._store
        while order:
            header = store[order[0]].packet.header
            if len(store) <= self._capacity and header.origin_us >= horizon_us:
                return
            del store[order.popleft()]
            origin = header.origin
            self._stored[origin] -= 1
            if not self._stored[origin]:
                del self._stored[origin]

    def digest(self, *, now_ns: int, most: int = _MOST_ORIGINS) -> Digest:
        """The digest for this node's hello: of everything, or of the next part; of at most so many origins."""
        most = min(most, _MOST_ORIGINS)
        self._forget(now_ns)
        origins = sorted(self._stored)
        if len(origins) <= most:
            return Digest(tuple(self._holdings[origin] for origin in origins), complete=True)
        at = self._turn % len(origins)
        self._turn = at + most
        turn = (origins + origins)[at : at + most]
        return Digest(tuple(self._holdings[origin] for origin in turn), complete=False)

    # --- what a neighbor lacks ------------------------------------------------------------------------------------

    def on_digest(self, digest: Digest, *, now_ns: int) -> None:
        """Plan to send what the neighbor lacks."""
        told, held = {holding.origin: holding for holding in digest.holdings}, self._holdings
        unlike = [origin for origin in self._stored if told.get(origin) != held[origin]]  # few: the rest is quick
        missing = (
            key_of(origin=origin, seq=seq)
            for origin in unlike
            if digest.complete or origin in told
            for seq in held[origin].beyond(told.get(origin))
        )
        for key in islice((key for key in missing if self._ripe(key, now_ns)), _PER_HELLO):
            self._plan(key, now_ns)

    def _ripe(self, key: int, now_ns: int) -> bool:
        kept = self._store.get(key)
        return kept is not None and kept.ripe_ns <= now_ns and key not in self._pending

    def _plan(self, key: int, now_ns: int) -> None:
        due_ns = now_ns + int(self._random() * _ASSESS_NS)
        self._pending[key] = due_ns
        heapq.heappush(self._due, (due_ns, key))

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Note that another node has sent a packet: the nodes around have it now."""
        if self._pending.pop(key, None) is not None:
            self._put_off(key, now_ns)

    def _put_off(self, key: int, now_ns: int) -> None:
        kept = self._store.get(key)
        if kept is not None:
            self._store[key] = kept._replace(ripe_ns=now_ns + _AGAIN_NS)

    def next_wake_ns(self) -> int | None:
        while self._due and self._pending.get(self._due[0][1]) != self._due[0][0]:
            heapq.heappop(self._due)  # suppressed meanwhile
        return self._due[0][0] if self._due else None

    def due(self, *, now_ns: int) -> list[Packet]:
        """Packets to flood once more, now."""
        packets = []
        while (due_ns := self.next_wake_ns()) is not None and due_ns <= now_ns:
            _, key = heapq.heappop(self._due)
            del self._pending[key]
            kept = self._store.get(key)
            if kept is not None:
                packets.append(kept.packet)
                self._put_off(key, now_ns)
        self.repaired += len(packets)
        return packets

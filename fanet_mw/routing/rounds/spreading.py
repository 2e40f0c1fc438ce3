"""What one node passes on: each packet until every neighbor is known to have it.

    urgent   heard -> own next turn -> a neighbor not known to have it a round later -> own turn again
    bulk     heard -> an instant in a bulk window -> every neighbor hears one that sent it: not sent; else sent
                   -> a round later -> a neighbor is not known to have it: sent (again)

A neighbor is known to have a packet when it was heard to send it (passive acknowledgment, RFC 4728, 3.4.2), or to say
that it holds it (FANET_HELD). Urgent packets are sent by every node, so hearing them is enough. Bulk is sent only where
a neighbor is out of reach of all that were heard to send it (scalable broadcast; Peng and Lu, MobiHoc 2000), so every
node tells in its turns which bulk it has received. Before a packet is repeated a whole
round must have passed in which nobody else sent it, so that mostly one node repeats.
"""

from collections.abc import Callable, Collection
from heapq import heappop, heappush
from typing import Final, NamedTuple

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet

NeighborsOf = Callable[[int, int], Collection[int]]
"""The nodes with which a node has links at an instant: of (node, instant)."""
_WAY_ROUND: Final = 2
"""The hops that a flood may need to reach a neighbor by relays that this node does not hear."""


def _key(packet: Packet) -> int:
    return key_of(packet.header.origin, packet.header.seq)


class Bulk(NamedTuple):
    """A bulk packet, whether it was sent or left to others before, and the instant from which it may be sent."""

    packet: Packet
    again: bool
    from_ns: int


class _Spread:
    """A packet, and what is known of it."""

    __slots__ = ("copy_ns", "from_ns", "having", "left", "packet", "rank", "reached", "sent", "sent_ns")

    def __init__(self, packet: Packet, rank: tuple[int, int], src: int | None, from_ns: int) -> None:
        self.packet = packet
        self.rank = rank
        self.sent = 0
        """How often this node has sent it."""
        self.sent_ns = 0
        self.copy_ns = 0
        """The instant at which a copy was last heard."""
        self.having: set[int] = set() if src is None else {src}
        """The neighbors that are known to have it."""
        self.reached: set[int] = set()
        """Bulk: the nodes in reach of those that were heard to send it."""
        self.left = False
        """Bulk: true once it was left to others, because nobody lacked it."""
        self.from_ns = from_ns
        """Bulk: the instant before which it need not be looked at."""

    @property
    def again(self) -> bool:
        """Bulk: True if it was sent, or left to others, before."""
        return self.left or self.sent > 0


class Spreading:
    """The packets that one node passes on."""

    def __init__(self, *, capacity: int, repeats: int, patience_ns: int, neighbors_of: NeighborsOf) -> None:
        """`capacity`: the most packets that are kept.
        `patience_ns`: the time after which a neighbor that has received a packet was heard to say so.
        `neighbors_of`: the nodes that a neighbor has told to hear.
        """
        self._capacity = capacity
        self._repeats = repeats
        self._patience_ns = patience_ns
        self._neighbors_of = neighbors_of
        self._entries: dict[int, _Spread] = {}
        self._urgent: dict[int, _Spread] = {}
        """The urgent ones among them."""
        self._waiting: set[int] = set()
        """The urgent ones that wait for a turn."""
        self._bulk: dict[int, _Spread] = {}
        self._due: list[tuple[int, int]] = []
        """A heap of the instants and keys at which bulk is looked at; outdated entries are skipped."""
        self._order = 0
        self.repeated = 0

    def __contains__(self, key: object) -> bool:
        return key in self._entries

    @property
    def has_urgent(self) -> bool:
        return bool(self._urgent)

    def waiting(self) -> int:
        """The number of packets that have not been sent yet."""
        return len(self._waiting) + self.waiting_bulk()

    def waiting_bulk(self) -> int:
        """The number of bulk packets that have not been sent yet."""
        return sum(1 for entry in self._bulk.values() if not entry.sent)

    # --- what is heard --------------------------------------------------------------------------------------------

    def take(self, packet: Packet, *, src: int | None, now_ns: int, bulk_from_ns: int | None = None) -> Packet | None:
        """A new packet, heard from the neighbor `src`; bulk may be sent from an instant on. Returns a packet that was
        evicted for it.
        """
        self._order += 1
        key = _key(packet)
        entry = self._entries[key] = _Spread(packet, (packet.header.priority, self._order), src, bulk_from_ns or 0)
        if bulk_from_ns is None:
            self._urgent[key] = entry
            self._waiting.add(key)
        else:
            self._bulk[key] = entry
            heappush(self._due, (bulk_from_ns, key))
            self._reach(entry, src, now_ns)
        if len(self._entries) <= self._capacity:
            return None
        last, evicted = max(self._entries.items(), key=lambda item: item[1].rank)
        self._remove(last)
        return None if evicted.sent else evicted.packet

    def _remove(self, key: int) -> None:
        del self._entries[key]
        self._urgent.pop(key, None)
        self._bulk.pop(key, None)
        self._waiting.discard(key)

    def on_copy(self, key: int, src: int, *, now_ns: int) -> bool:
        """A copy was heard from a neighbor; True if the neighbor does not know that this node has the packet."""
        entry = self._entries.get(key)
        if entry is None:
            return True
        entry.copy_ns = now_ns
        self._reach(entry, src, now_ns)
        again = src in entry.having and entry.sent > 0
        entry.having.add(src)
        return again

    def _reach(self, entry: _Spread, src: int | None, now_ns: int) -> None:
        """A neighbor was heard to send a bulk packet, which those that hear the neighbor have, too."""
        if src is not None and not entry.again:
            entry.reached.add(src)
            entry.reached.update(self._neighbors_of(src, now_ns))

    def on_held(self, key: int, src: int) -> None:
        """A neighbor says that it holds a packet."""
        entry = self._entries.get(key)
        if entry is not None:
            entry.having.add(src)

    # --- what is sent ---------------------------------------------------------------------------------------------

    def wanted(self, neighbors: Collection[int], *, start_ns: int) -> list[Packet]:
        """The urgent packets for the turn at `start_ns`, in order; those that nobody lacks are forgotten."""
        patient_ns = start_ns - self._patience_ns
        done = []
        for key, entry in self._urgent.items():
            if key in self._waiting:
                continue
            if entry.sent > self._repeats or entry.having.issuperset(neighbors):
                done.append(key)
            elif entry.sent_ns <= patient_ns and entry.copy_ns <= patient_ns:
                self._waiting.add(key)
        for key in done:
            self._remove(key)
        chosen = [self._entries[key] for key in self._waiting]
        chosen.sort(key=lambda entry: entry.rank)
        return [entry.packet for entry in chosen]

    def sent(self, packet: Packet, *, start_ns: int) -> int:
        """The packet is transmitted at `start_ns`; returns how often it has been."""
        key = _key(packet)
        entry = self._entries[key]
        self.repeated += entry.sent > 0
        entry.sent += 1
        entry.sent_ns = start_ns
        self._waiting.discard(key)
        return entry.sent

    def forget(self, packet: Packet) -> bool:
        """Forget a packet that has expired; True if it was never sent."""
        key = _key(packet)
        fresh = not self._entries[key].sent
        self._remove(key)
        return fresh

    def bulk_wanted(self, neighbors: Collection[int], *, start_ns: int) -> tuple[list[Bulk], list[Bulk]]:
        """The bulk for a frame that starts at `start_ns`, what is new first, and what is to be looked at later.

        What nobody lacks is forgotten.
        """
        chosen, later = list[_Spread](), list[Bulk]()
        while self._due and self._due[0][0] <= start_ns:
            from_ns, key = heappop(self._due)
            entry = self._bulk.get(key)
            if entry is None or entry.from_ns != from_ns:
                continue
            if entry.sent > self._repeats or (entry.having and entry.having.issuperset(neighbors)):
                self._remove(key)
                continue
            next_ns = self._not_before_ns(entry, neighbors, start_ns)
            if next_ns > start_ns:
                later.append(Bulk(entry.packet, entry.again, next_ns))
            else:
                chosen.append(entry)
        chosen.sort(key=lambda entry: (entry.again, entry.rank))
        return [Bulk(entry.packet, entry.again, start_ns) for entry in chosen], later

    def _not_before_ns(self, entry: _Spread, neighbors: Collection[int], start_ns: int) -> int:
        """The instant before which others may do what sending this packet would."""
        if entry.again:
            return entry.copy_ns + self._patience_ns  # somebody else is at it
        if neighbors and entry.reached.issuperset(neighbors):
            entry.left = True
            return start_ns + _WAY_ROUND * self._patience_ns
        return start_ns

    def look_again(self, packet: Packet, *, from_ns: int) -> None:
        """Look at a bulk packet again from an instant on: does a neighbor still lack it?"""
        key = _key(packet)
        self._bulk[key].from_ns = from_ns
        heappush(self._due, (from_ns, key))

    def bulk_due_ns(self) -> int | None:
        """The instant before which no bulk need be looked at; None if there is none."""
        while self._due:
            from_ns, key = self._due[0]
            entry = self._bulk.get(key)
            if entry is not None and entry.from_ns == from_ns:
                return from_ns
            heappop(self._due)
        return None

"""What one node passes on: each packet until every neighbor is known to have it.

    urgent   heard -> own bulk slot, if one comes first -> own next turn, unless every neighbor has it by then
                   -> a neighbor is not known to have it a round later -> own turn again
    bulk     heard -> an instant in a bulk window -> every neighbor hears one that sent it: not sent; else sent
                   -> a round later -> a neighbor is not known to have it: sent (again)

A neighbor has a packet when it was heard to send it (passive acknowledgment, RFC 4728, 3.4.2), or to say so
(FANET_HELD). Bulk is sent only where a neighbor is out of reach of all that were heard to send it (scalable broadcast;
Peng and Lu, MobiHoc 2000). Sets of nodes are integers: bit i stands for node i + 1.
"""

import math
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush
from itertools import islice
from typing import Final

from fanet_mw.graph.topology import bits_of, nodes_of
from fanet_mw.node.duplicates import key_of, origin_and_seq
from fanet_mw.node.packet import Packet
from fanet_mw.units import US

_MOST_EARLY: Final = 1024
_MOST_DONE: Final = 1024
_MOST_PATIENCE: Final = 64
"""The longest interval between repetitions, in those of a channel that loses none at random."""
_REMEMBERED: Final = 32
"""The number of packets, about, over which the share that a neighbor was heard to send is averaged."""
_WEAK_SHARE: Final = 0.5
_OTHER_LINKS: Final = 2
"""A neighbor that is heard of fewer packets than that share is left to others, if it has so many links."""
_MOST_VAIN: Final = 16
"""So often something is sent again for a neighbor that never shows to have heard anything."""
_STALE_SHARE: Final = 4
"""The heap of packets by how they are missed is dropped when it has more entries than so many times the capacity."""
_WAY_ROUND: Final = 2
"""The hops that a flood may need to reach a neighbor by relays that this node does not hear."""

_ByLoss = tuple[int, bool, int, int]


def _key(packet: Packet) -> int:
    return key_of(packet.header.origin, packet.header.seq)


class _Spread:
    __slots__ = (
        "copy_ns",
        "from_ns",
        "having",
        "in_reach",
        "in_reach_twice",
        "left",
        "made_ns",
        "measured",
        "packet",
        "rank",
        "reached",
        "senders",
        "sent",
        "sent_ns",
        "spare",
        "taken_ns",
    )

    def __init__(self, packet: Packet, src: int | None, from_ns: int, taken_ns: int) -> None:
        self.packet = packet
        self.taken_ns = taken_ns
        self.made_ns = packet.header.origin_us * US
        self.rank = packet.header.priority, packet.header.origin_us, _key(packet)
        """Priority, birth, key: of new packets the most urgent go first, and of these the oldest."""
        self.sent = 0
        self.sent_ns = 0
        self.copy_ns = 0
        self.having = 0 if src is None else 1 << (src - 1)
        """The neighbors that are known to have it."""
        self.senders = self.having
        self.reached = 0
        """Bulk: the nodes in reach of those that were heard to send it."""
        self.in_reach = 0
        self.in_reach_twice = 0
        """Where frames are lost: the nodes with links to one, and to two, of those that were heard to send it."""
        self.measured = False
        """Urgent: true once it was noted which neighbors were heard to send it."""
        self.left = False
        """Bulk: true once it was left to others, because nobody lacked it."""
        self.from_ns = from_ns
        """Bulk: the instant before which it need not be looked at."""
        self.spare = False
        """Bulk: true if others are to pass it on first."""

    def reach(self, nodes: int) -> None:
        """One more node was heard to send it, which has links to these."""
        self.in_reach_twice |= self.in_reach & nodes
        self.in_reach |= nodes

    def by_loss(self) -> _ByLoss:
        """The least is missed least: less urgent, or sent, or of sent ones the older, of others the newer."""
        priority, origin_us, key = self.rank
        return -priority, not self.sent, origin_us if self.sent else -origin_us, key

    @property
    def again(self) -> bool:
        """True if it was sent, or left to others, before."""
        return self.left or self.sent > 0


class Spreading:
    """The packets that one node passes on."""

    def __init__(
        self, node: int, *, capacity: int, repeats: int, patience_ns: int, links: Sequence[int], lossy: bool = False
    ) -> None:
        """`patience_ns`: when a neighbor that has a packet was heard to say so. `links`: each node's, which change.
        `lossy`: frames are lost at random, so that not to hear a neighbor shows little.
        """
        self._node = node
        self._capacity = capacity
        self._repeats = repeats
        self._patience_ns = patience_ns
        self._links = links
        self._entries: dict[int, _Spread] = {}
        self._by_loss: list[_ByLoss] = []
        """A heap of all packets, those that are missed least first, while some do not fit; outdated entries are
        skipped."""
        self.urgent: dict[int, _Spread] = {}
        self._waiting: set[int] = set()
        self._hasty: dict[int, _Spread] = {}
        """The urgent ones that may go in a bulk slot if that comes before the turn."""
        self._bulk: dict[int, _Spread] = {}
        self._due: list[tuple[int, int]] = []
        """A heap of the instants and keys at which bulk is looked at; outdated entries are skipped."""
        self._ready: list[tuple[bool, tuple[int, int, int]]] = []
        """A heap of the bulk whose instant has come: sent before, rank."""
        self._done = OrderedDict[int, _Spread]()
        """The packets that need not be sent any more, the latest last. (The first entry of a plain dict is found behind
        all that was deleted before it.)"""
        self._early = OrderedDict[int, int]()
        """The neighbors that say to hold packets which this node does not have, the latest last."""
        self.repeated = 0
        self._lossy = lossy
        self._share = [1.0] * len(links)
        """The share of urgent packets that each neighbor was lately heard to send."""
        self._weak = 0
        """The neighbors that are heard so seldom that others are left to serve them."""
        self._vain: dict[int, int] = {}
        """How often something was sent again for each neighbor since it last showed to have heard anything."""

    def __contains__(self, key: object) -> bool:
        return key in self._entries

    def waiting(self) -> int:
        """The number of packets that have not been sent yet."""
        return len(self._waiting) + sum(1 for entry in self._bulk.values() if not entry.sent)

    def has_due_bulk(self, count: int) -> bool:
        """True if so many bulk packets, about, wait for a slot that this node sends before others, or again."""
        ready = (self._bulk[key] for _, (_, _, key) in self._ready if key in self._bulk)
        due = (entry for entry in ready if entry.sent or not (entry.again or entry.spare))
        return next(islice(due, count - 1, None), None) is not None

    # --- what is heard --------------------------------------------------------------------------------------------

    def push(
        self,
        packet: Packet,
        *,
        src: int | None,
        now_ns: int,
        bulk_from_ns: int | None = None,
        spare: bool = False,
        once: bool = False,
    ) -> Packet | None:
        """A new packet, from `src`; `spare`: unless others pass it on; `once`: not repeated. Returns an evicted one."""
        key = _key(packet)
        entry = self._entries[key] = _Spread(packet, src, bulk_from_ns or 0, now_ns)
        entry.having |= self._early.pop(key, 0)
        if src is not None:
            entry.having |= 1 << (packet.header.origin - 1)
            if src != packet.header.origin:
                self._vain.pop(src, None)
        if src is not None and self._lossy:
            entry.reach(self._links[src])
        entry.sent = self._repeats if once else 0
        if bulk_from_ns is None:
            self.urgent[key] = self._hasty[key] = entry
            self._waiting.add(key)
        else:
            self._bulk[key] = entry
            entry.spare = spare
            heappush(self._due, (bulk_from_ns, key))
            if src is not None and not entry.again:
                entry.reached |= entry.senders | self._links[src]
        self._rate(entry)
        if len(self._entries) <= self._capacity:
            return None
        evicted = self._evict()
        return None if evicted.sent else evicted.packet

    def _evict(self) -> _Spread:
        """Forget the packet that is missed least."""
        if not self._by_loss:
            self._by_loss = [entry.by_loss() for entry in self._entries.values()]
            heapify(self._by_loss)
        while (key := heappop(self._by_loss)[-1]) not in self._entries:
            pass  # of one that was sent since, the entry that says so came first
        entry = self._entries[key]
        self._remove(key)
        return entry

    def _rate(self, entry: _Spread) -> None:
        """Note how much a packet is missed now."""
        if len(self._by_loss) > _STALE_SHARE * self._capacity:
            self._by_loss.clear()  # made anew when the next packet does not fit
        if self._by_loss:
            heappush(self._by_loss, entry.by_loss())

    def _remove(self, key: int) -> None:
        del self._entries[key]
        self.urgent.pop(key, None)
        self._hasty.pop(key, None)
        self._bulk.pop(key, None)
        self._waiting.discard(key)

    def on_copy(self, key: int, src: int, *, neighbors: int, now_ns: int) -> bool:
        """A copy was heard from a neighbor; True if the neighbor does not know that this node has the packet."""
        entry = self._entries.get(key)
        own = 1 << (src - 1)
        if src in self._vain and origin_and_seq(key)[0] != src:
            del self._vain[src]
        if entry is None:
            done = self._done.get(key)
            if done is None:
                return True
            again = bool(done.senders & own)
            done.senders |= own
            return again
        links = self._links[src]
        if neighbors & links & ~entry.having:
            entry.copy_ns = now_ns  # who lacks it may have heard that copy
        if not (entry.left or entry.sent):
            entry.reached |= own | links  # those that hear the neighbor have it, too
        again = bool(entry.senders & own)
        if not again and self._lossy:
            entry.reach(links)
        entry.senders |= own
        entry.having |= own
        return again

    def on_held(self, keys: Iterable[int], src: int) -> None:
        theirs, early, entries, done = 1 << (src - 1), self._early, self._entries, self._done
        self._vain.pop(src, None)
        for key in keys:
            entry = entries.get(key)
            if entry is not None:
                entry.having |= theirs
            elif key not in done:
                early[key] = early.get(key, 0) | theirs
                early.move_to_end(key)
        while len(early) > _MOST_EARLY:
            early.popitem(last=False)

    def assume(self, node: int, *, until_ns: int) -> None:
        """A node that was elsewhere in the swarm has come near: what is older than an instant it has got there."""
        for entry in self._entries.values():
            if entry.taken_ns <= until_ns and (entry.again or entry.spare):
                entry.having |= 1 << (node - 1)

    def made_ns(self, key: int) -> float:
        """The instant at which a packet was made; long ago if this node does not remember it."""
        entry = self._entries.get(key) or self._done.get(key)
        return -math.inf if entry is None else entry.made_ns

    def recent(self, from_ns: int) -> list[int]:
        """The keys of the packets that this node got after an instant."""
        return [key for key, entry in self._entries.items() if entry.taken_ns > from_ns] + [
            key for key, done in self._done.items() if done.taken_ns > from_ns
        ]

    # --- what is sent ---------------------------------------------------------------------------------------------

    def spared(self, neighbors: int) -> list[int]:
        """The keys of urgent packets that no neighbor lacks, though this node has not sent them: they are done."""
        entries = [(key, self._entries[key]) for key in self._waiting]
        found = [(key, entry) for key, entry in entries if not entry.sent and self._all_have(entry, neighbors)]
        for key, entry in found:
            self._settle(key, entry)
        return [key for key, _ in found]

    def _all_have(self, entry: _Spread, neighbors: int) -> bool:
        """Urgent: True if this node need not send it even once. Where frames are lost at random it must, because who
        is heard to send shows whose links hold.
        """
        return bool(neighbors) and not self._lossy and not neighbors & ~entry.having

    def wanted(self, neighbors: int, *, start_ns: int, gone: int = 0) -> list[Packet]:
        """The urgent packets for a turn; forgets what nobody lacks, repeats nothing for `gone` ones."""
        patient_ns = start_ns - self._patience_ns
        served = neighbors & ~self._weak & ~self._deaf()
        done = []
        for key, entry in self.urgent.items():
            if self._lossy and not entry.measured and entry.sent and entry.sent_ns <= patient_ns - self._patience_ns:
                entry.measured = True
                self._measure(neighbors, entry.senders)
            if key in self._waiting:
                continue
            if entry.sent > self._repeats or not served & ~entry.having:
                done.append((key, entry))
            elif not served & ~gone & ~entry.having & ~entry.in_reach_twice:
                continue
            elif entry.sent_ns <= start_ns - self._patient_ns(entry) and entry.copy_ns <= patient_ns:
                self._waiting.add(key)
                self._again_for(served & ~gone & ~entry.having)
        for key, entry in done:
            self._settle(key, entry)
        chosen = [self._entries[key] for key in self._waiting]
        chosen.sort(key=lambda entry: (entry.rank[0], entry.again, entry.rank))
        return [entry.packet for entry in chosen]

    def _again_for(self, nodes: int) -> None:
        for node in nodes_of(nodes & ~self._links[self._node]):
            self._vain[node] = self._vain.get(node, 0) + 1

    def _deaf(self) -> int:
        """The neighbors that show by nothing that they hear: not by what they send or hold, nor by a link."""
        if not self._vain:
            return 0
        deaf = bits_of(node for node, times in self._vain.items() if times >= _MOST_VAIN)
        return deaf & ~self._links[self._node]

    def _patient_ns(self, entry: _Spread) -> int:
        """The time after which an urgent packet is sent again; ever longer where frames are lost at random."""
        return self._patience_ns * (min(1 << max(0, entry.sent - 1), _MOST_PATIENCE) if self._lossy else 1)

    def _measure(self, neighbors: int, senders: int) -> None:
        """All neighbors have sent a packet by now, and were heard or not."""
        for node in nodes_of(neighbors):
            own = 1 << (node - 1)
            self._share[node] += (bool(senders & own) - self._share[node]) / _REMEMBERED
            weak = self._share[node] < _WEAK_SHARE and self._links[node].bit_count() >= _OTHER_LINKS
            self._weak = self._weak | own if weak else self._weak & ~own

    def sent(self, packet: Packet, *, start_ns: int) -> int:
        """The packet is transmitted at `start_ns`; returns how often it has been."""
        key = _key(packet)
        entry = self._entries[key]
        self.repeated += entry.sent > 0
        entry.sent += 1
        entry.sent_ns = start_ns
        if entry.sent == 1:
            self._rate(entry)
        self._waiting.discard(key)
        self._hasty.pop(key, None)
        return entry.sent

    def take_hasty(self, room: int, neighbors: int) -> list[Packet]:
        """Urgent packets that go in a bulk slot now, as they fit, most urgent first; they go in the turn as well."""
        taken = []
        for entry in sorted(self._hasty.values(), key=lambda entry: entry.rank):
            if self._all_have(entry, neighbors):
                del self._hasty[_key(entry.packet)]
            elif len(entry.packet.frame) <= room:
                room -= len(entry.packet.frame)
                taken.append(entry.packet)
                del self._hasty[_key(entry.packet)]
        return taken

    def went_ahead(self, packet: Packet) -> None:
        """An urgent packet was sent at once, and goes in the turn as well."""
        self._hasty.pop(_key(packet), None)

    def forget(self, packet: Packet) -> bool:
        """Forget a packet that has expired; True if it was never sent."""
        key = _key(packet)
        fresh = not self._entries[key].sent
        self._remove(key)
        return fresh

    def next_bulk(self, neighbors: int, *, start_ns: int, gone: int = 0) -> Packet | None:
        """The bulk packet for a frame, new ones first; forgets what nobody lacks, repeats nothing for `gone` ones."""
        while self._due and self._due[0][0] <= start_ns:
            from_ns, key = heappop(self._due)
            entry = self._bulk.get(key)
            if entry is not None and entry.from_ns == from_ns:
                heappush(self._ready, (entry.again, entry.rank))
        gone |= self._deaf()
        while self._ready:
            _, (_, _, key) = heappop(self._ready)
            entry = self._bulk.get(key)
            if entry is None:
                continue
            if self._is_done(entry, neighbors):
                self._settle(key, entry)
                continue
            next_ns = self._not_before_ns(entry, neighbors & ~gone, start_ns)
            if entry.again and not neighbors & ~gone & ~entry.having:
                next_ns = start_ns + self._patience_ns
            if next_ns <= start_ns:
                if entry.sent:
                    self._again_for(neighbors & ~gone & ~entry.having)
                return entry.packet
            self._look(entry, key, next_ns)
        return None

    def _is_done(self, entry: _Spread, neighbors: int) -> bool:
        """Bulk: True if nobody lacks it, or it was sent often enough."""
        if entry.sent > self._repeats:
            return True
        if not entry.having:
            return False
        lacking = neighbors & ~entry.having
        return not lacking or (entry.again and not lacking & ~self._deaf())

    def _settle(self, key: int, entry: _Spread) -> None:
        self._remove(key)
        self._done[key] = entry
        if len(self._done) > _MOST_DONE:
            self._done.popitem(last=False)

    def _not_before_ns(self, entry: _Spread, neighbors: int, start_ns: int) -> int:
        """The instant before which others may do what sending this packet would."""
        if entry.again:
            return entry.copy_ns + self._patience_ns  # somebody else is at it
        if neighbors and not neighbors & ~(entry.reached | entry.having):
            entry.left = True
            return start_ns + _WAY_ROUND * self._patience_ns
        return start_ns

    def look_again(self, packet: Packet, *, from_ns: int) -> None:
        """Look at a bulk packet again from an instant on: does a neighbor still lack it?"""
        key = _key(packet)
        self._look(self._bulk[key], key, from_ns)

    def _look(self, entry: _Spread, key: int, from_ns: int) -> None:
        entry.from_ns = from_ns
        heappush(self._due, (from_ns, key))

    def bulk_due_ns(self, neighbors: int) -> int | None:
        """The instant before which no bulk need be looked at; None if there is none. What nobody lacks is forgotten."""
        if self._hasty:
            return 0
        while self._ready and not self._lacking(self._ready[0][1][2], neighbors):
            heappop(self._ready)
        if self._ready:
            return 0
        while self._due:
            from_ns, key = self._due[0]
            entry = self._lacking(key, neighbors)
            if entry is not None and entry.from_ns == from_ns:
                return from_ns
            heappop(self._due)
        return None

    def _lacking(self, key: int, neighbors: int) -> _Spread | None:
        """A bulk packet that a neighbor may lack; what nobody lacks is forgotten."""
        entry = self._bulk.get(key)
        if entry is not None and self._is_done(entry, neighbors):
            self._settle(key, entry)
            return None
        return entry

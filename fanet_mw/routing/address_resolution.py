"""Address resolution: which neighbor has which address, as a node with an IP stack must ask before its first unicast.

    unknown --frame--> waiting   a request is sent after U(0, 10 ms), again after 1 s, up to three times; 3 frames wait
    waiting --heard--> known     the frames are sent; known for 120 s, then the next frame causes a new request
    waiting --silence--> unknown [rfc826] or dead for 100 s [ns3]: waiting frames are dropped; with ns3 later ones too

`rfc826`: RFC 826's reception algorithm with RFC 1122, 2.3.2: one request per second and neighbor, the latest frames
wait. `ns3`: ns-3's ArpL3Protocol and ArpCache with their defaults: only expected answers are learned, frames that find
three waiting are dropped, one timer repeats all requests. Not modeled: gratuitous requests, conflict detection (RFC
5227), unicast polls; as in ns-3, a link that fails does not remove its entry.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.units import MS, NodeId, S

REQUEST_JITTER_NS: Final = 10 * MS
WAIT_REPLY_NS: Final = 1 * S
MAX_RETRIES: Final = 3
PENDING: Final = 3
ALIVE_NS: Final = 120 * S
DEAD_NS: Final = 100 * S
"""ns-3 `ArpL3Protocol::RequestJitter`, `ArpCache::WaitReplyTimeout`, `MaxRetries`, `PendingQueueSize`, `AliveTimeout`,
`DeadTimeout`. RFC 826 has no numbers; these comply with RFC 1122, 2.3.2."""


class Knowledge(Enum):
    """The state of a neighbor's address."""

    WAITING = "waiting"
    KNOWN = "known"
    DEAD = "dead"


class Outgoing(NamedTuple):
    """A unicast frame on its way to the MAC, and the packet that it carries."""

    packet: Packet
    frame: bytes
    next_hop: NodeId
    is_data: bool


@dataclass(slots=True)
class AddressEntry:
    """The address state of one neighbor."""

    knowledge: Knowledge
    since_ns: int
    """The instant at which the address became known, or was given up."""
    due_ns: int = 0
    """While waiting: when the next request is sent, or the address is given up."""
    retries: int = 0
    pending: list[Outgoing] = field(default_factory=list)


class Resolver:
    """The addresses that one node knows. `ask` sends a request for a neighbor at an instant."""

    def __init__(self, *, as_ns3: bool, draw: Callable[[], float], ask: Callable[[NodeId, int, int], None]) -> None:
        self._as_ns3 = as_ns3
        self._draw = draw
        self._ask = ask
        self._entries: dict[NodeId, AddressEntry] = {}
        self._due_ns: int | None = None
        """The instant at which the first of the waiting entries is due."""

    def knowledge(self, neighbor: NodeId, *, now_ns: int) -> Knowledge | None:
        """The state of a neighbor's address; None if nothing is known."""
        entry = self._entries.get(neighbor)
        if entry is None:
            return None
        ends_ns = {Knowledge.KNOWN: entry.since_ns + ALIVE_NS, Knowledge.DEAD: entry.since_ns + DEAD_NS}
        return None if now_ns > ends_ns.get(entry.knowledge, now_ns) else entry.knowledge

    def hold(self, out: Outgoing, *, start_ns: int, now_ns: int) -> Outgoing | None:
        """Keep a frame until its next hop's address is known, and request that; returns the frame given up for it."""
        entry = self._entries.get(out.next_hop)
        if entry is None or entry.knowledge is not Knowledge.WAITING:
            entry = self._wait(out.next_hop, now_ns=now_ns)
            self._ask(out.next_hop, start_ns + int(self._draw() * REQUEST_JITTER_NS), now_ns)
        if len(entry.pending) < PENDING:
            entry.pending.append(out)
            return None
        if self._as_ns3:
            return out
        entry.pending.append(out)
        return entry.pending.pop(0)

    def _wait(self, neighbor: NodeId, *, now_ns: int) -> AddressEntry:
        """Make a waiting entry. ns-3 has one timer for all waiting entries, so all are due at the same instant."""
        shared_ns = self._due_ns if self._as_ns3 else None
        entry = AddressEntry(Knowledge.WAITING, now_ns, now_ns + WAIT_REPLY_NS if shared_ns is None else shared_ns)
        self._entries[neighbor] = entry
        self._plan()
        return entry

    def on_address_message(self, neighbor: NodeId, *, asks_us: bool, answers_us: bool, now_ns: int) -> list[Outgoing]:
        """Handle a request or a reply of a neighbor by the rules; returns the frames that waited for its address."""
        entry = self._entries.get(neighbor)
        if self._as_ns3:
            learns = answers_us and entry is not None and entry.knowledge is Knowledge.WAITING
        else:
            learns = entry is not None or asks_us or answers_us
        if not learns:
            return []
        self._entries[neighbor] = AddressEntry(Knowledge.KNOWN, now_ns)
        self._plan()
        return [] if entry is None else entry.pending

    def expire(self, *, now_ns: int) -> list[Outgoing]:
        """Repeat requests that have no answer, or give them up; returns the frames that have waited in vain."""
        if self._due_ns is None or now_ns < self._due_ns:
            return []
        lost: list[Outgoing] = []
        for neighbor in sorted(self._entries):
            entry = self._entries[neighbor]
            if entry.knowledge is not Knowledge.WAITING or entry.due_ns > now_ns:
                continue
            if entry.retries < MAX_RETRIES:
                entry.retries += 1
                entry.due_ns = now_ns + WAIT_REPLY_NS
                self._ask(neighbor, now_ns, now_ns)
                continue
            lost += entry.pending
            if self._as_ns3:
                self._entries[neighbor] = AddressEntry(Knowledge.DEAD, now_ns)
            else:
                del self._entries[neighbor]
        self._plan()
        return lost

    def next_ns(self) -> int | None:
        return self._due_ns

    def _plan(self) -> None:
        waiting = (e.due_ns for e in self._entries.values() if e.knowledge is Knowledge.WAITING)
        self._due_ns = min(waiting, default=None)

    def waiting(self) -> int:
        return sum(out.is_data for entry in self._entries.values() for out in entry.pending)

"""Which neighbor has which address, as a node with an IP stack must ask before its first unicast to it.

    unknown --frame--> waiting   a request goes after U(0, 10 ms), again after 1 s, three times more; 3 frames wait
    waiting --heard--> known     what waits goes; known for 120 s, then the next frame asks again
    waiting --nobody--> unknown  [rfc826] or dead for 100 s [ns3]: what waits, and with ns3 what comes, is dropped

Two sets of rules. `rfc826`: RFC 826's reception algorithm (any request or reply of a known sender updates it, and
whoever is asked learns who asks), with RFC 1122, 2.3.2: one request a second per neighbor, the latest frames wait.
`ns3`: ns-3's ArpL3Protocol and ArpCache with their default attributes: only answers that are waited for teach, frames
that find three waiting are dropped, one timer retries all that wait. Does not model: gratuitous requests, conflict
detection (RFC 5227), unicast polls; a link that fails does not flush its entry (in ns-3 neither).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

from fanet_mw.node.queue import Packet
from fanet_mw.units import MS, NodeId, S

REQUEST_JITTER_NS: Final = 10 * MS
WAIT_REPLY_NS: Final = 1 * S
MAX_RETRIES: Final = 3
PENDING: Final = 3
ALIVE_NS: Final = 120 * S
DEAD_NS: Final = 100 * S
"""ns-3 `ArpL3Protocol::RequestJitter`, `ArpCache::WaitReplyTimeout`, `MaxRetries`, `PendingQueueSize`, `AliveTimeout`,
`DeadTimeout`. RFC 826 has no numbers; these keep within RFC 1122, 2.3.2."""


class Knowledge(Enum):
    """What a node knows of a neighbor's address."""

    WAITING = "waiting"
    KNOWN = "known"
    DEAD = "dead"


class Outgoing(NamedTuple):
    """A unicast frame on its way to the MAC, and the packet it carries."""

    packet: Packet
    frame: bytes
    next_hop: NodeId
    is_data: bool


@dataclass(slots=True)
class Entry:
    """One neighbor."""

    knowledge: Knowledge
    since_ns: int
    """When it came to be known, or was given up."""
    due_ns: int = 0
    """Waiting: when the next request goes, or it is given up."""
    retries: int = 0
    pending: list[Outgoing] = field(default_factory=list)


class Resolver:
    """The addresses that one node knows. `ask` sends a request for a neighbor at an instant."""

    def __init__(self, *, as_ns3: bool, draw: Callable[[], float], ask: Callable[[NodeId, int, int], None]) -> None:
        self._as_ns3 = as_ns3
        self._draw = draw
        self._ask = ask
        self._entries: dict[NodeId, Entry] = {}
        self._due_ns: int | None = None
        """When the first of those that wait is due."""

    def knowledge(self, neighbor: NodeId, *, now_ns: int) -> Knowledge | None:
        """What is known of a neighbor; None: nothing."""
        entry = self._entries.get(neighbor)
        if entry is None:
            return None
        ends_ns = {Knowledge.KNOWN: entry.since_ns + ALIVE_NS, Knowledge.DEAD: entry.since_ns + DEAD_NS}
        return None if now_ns > ends_ns.get(entry.knowledge, now_ns) else entry.knowledge

    def hold(self, out: Outgoing, *, start_ns: int, now_ns: int) -> Outgoing | None:
        """Keep a frame until its next hop is known, and ask; returns the frame that has to go for it, if any."""
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

    def _wait(self, neighbor: NodeId, *, now_ns: int) -> Entry:
        """ns-3 has one timer for all that wait: who comes later waits for the same instant."""
        shared_ns = self._due_ns if self._as_ns3 else None
        entry = Entry(Knowledge.WAITING, now_ns, now_ns + WAIT_REPLY_NS if shared_ns is None else shared_ns)
        self._entries[neighbor] = entry
        self._plan()
        return entry

    def heard(self, neighbor: NodeId, *, asks_us: bool, answers_us: bool, now_ns: int) -> list[Outgoing]:
        """A request or a reply of a neighbor: learn its address by the rules; returns what waited for it."""
        entry = self._entries.get(neighbor)
        if self._as_ns3:
            learns = answers_us and entry is not None and entry.knowledge is Knowledge.WAITING
        else:
            learns = entry is not None or asks_us or answers_us
        if not learns:
            return []
        self._entries[neighbor] = Entry(Knowledge.KNOWN, now_ns)
        self._plan()
        return [] if entry is None else entry.pending

    def expire(self, *, now_ns: int) -> list[Outgoing]:
        """Ask again for those who have not answered, or give them up; returns what waited in vain."""
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
                self._entries[neighbor] = Entry(Knowledge.DEAD, now_ns)
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
        """Data packets among the frames that wait."""
        return sum(out.is_data for entry in self._entries.values() for out in entry.pending)

"""Time synchronization over the air: hellos carry the time of one reference node from hop to hop, as in FTSP.

    hello n ends                   its sender and all receivers stamp that instant, each by its own clock
    hello n+1 says "hello n ended at swarm time t"     -> a pair (own stamp, t) -> the fit of `clock_fit`

Who is the reference, and what is believed: docs/explanation/time.md. A plausible forged beacon counts as one neighbor's
statement; it can be outvoted, but is not recognized: not a liar that is the only neighbor, nor liars that outnumber the
honest neighbors.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from fanet_mw.serial_number import following, newer
from fanet_mw.timesync.clock_fit import EXACT, ClockFit, Line, Oscillator, Pair, alike
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire.hello.beacon import TimeBeacon

_ENOUGH: Final = 2
"""The number of neighbors that must agree."""


class InitialSync:
    """The statements of neighbors while none has been accepted."""

    def __init__(self, oscillator: Oscillator, *, leader: NodeId, wait_ns: int, memory_ns: int) -> None:
        self._oscillator = oscillator
        self._leader = leader
        self._wait_ns = wait_ns
        """How long a single statement waits for a second one."""
        self._memory_ns = memory_ns
        """How long a statement counts."""
        self._stated: dict[NodeId, tuple[int, Pair]] = {}
        self._since_ns = 0
        """The instant since which there has always been a statement that counts."""

    def on_statement(self, src: NodeId, reference: int, pair: Pair, *, local_ns: int) -> bool:
        """A neighbor has stated the time; returns True if the node should follow this reference from now on."""
        horizon_ns = pair.local_ns - self._memory_ns
        self._stated = {node: stated for node, stated in self._stated.items() if stated[1].local_ns >= horizon_ns}
        if not self._stated:
            self._since_ns = local_ns
        self._stated[src] = reference, pair
        if src == reference == self._leader:
            return True
        statements = self._stated.values()
        agreeing = sum(of == reference and alike(other, pair, self._oscillator) for of, other in statements)
        contradicting = len(self._stated) - agreeing
        if local_ns - self._since_ns >= self._wait_ns:
            return agreeing >= contradicting
        return agreeing >= _ENOUGH and agreeing > contradicting


_LISTEN_HELLOS: Final = 2.5
"""How long the leader listens at its start, because a swarm that already has a time keeps it."""
_SILENT_HELLOS: Final = 16
"""A node that has had no news of a reference for this long becomes the reference; nodes with lower ids do so sooner."""
_FIRST_HELLOS: Final = 32
"""The same for a node that never had a time: the leader's time takes about two hello intervals for each hop."""
_STAGGER_HELLOS: Final = 0.5
_STAGGERED: Final = 32
_FRESH_HELLOS: Final = 4.5
"""A neighbor whose round has not advanced for this long has lost the reference."""
_SETTLED: Final = 8
"""The number of pairs that a node with a lower id collects before it takes over from the reference."""
_PROVEN: Final = 2
"""The number of pairs that it takes to follow another reference."""
_HASTY: Final = 4
"""Pairs of one neighbor that are closer together than a hello interval divided by this are not counted."""
_DOUBT_HELLOS: Final = 1.5
"""How long a node without a time waits for a second neighbor to state the same; each states it once per hello."""
_SUPPORT_HELLOS: Final = 3
"""How long a statement of a neighbor supports this node's time."""
_SUPPORTERS: Final = 2
_QUESTION_HELLOS: Final = 0.75
"""A node that several neighbors contradict while none has agreed for this long states the greatest error."""
_LOST_HELLOS: Final = 1.5
"""After this long its own clock must have jumped: it gives up its time and learns it anew."""
_CONTRADICTING: Final = 2
_STAMPS: Final = 4
"""The number of hellos of each neighbor whose ends are remembered."""
_NEIGHBORS: Final = 256
MOST_STATED_NS: Final = 20 * MS
"""The greatest error that hellos state: a greater one means no time, or nonsense."""
WORST_LIFE_NS: Final = 20 * S
_APART_HELLOS: Final = 9
"""A neighbor that for this long has stated no time, or one that cannot be followed, is out of step."""
_PPB: Final = 1e9
_U32: Final = 0xFFFF_FFFF


class Settings(NamedTuple):
    """The settings of a node's synchronization, which do not change while it runs."""

    node: NodeId
    leads: bool
    """True for the leader of the swarm, which waits for no other reference."""
    hello_ns: int
    oscillator: Oscillator
    flight_ns: int
    """The longest propagation delay to a neighbor."""
    limit_ns: int
    """A swarm time that differs from the own clock by more than this is not accepted."""
    leader: NodeId
    """The leader of the swarm; its statement of its own time needs no second statement."""

    @property
    def hop_ns(self) -> int:
        """The error that each hop adds: half the flight time is assumed, and two stamps are rounded."""
        return self.flight_ns // 2 + self.oscillator.stamp_ns


@dataclass(slots=True)
class _LastBeacon:
    """The last beacon of a neighbor, and when the neighbor's hellos ended by this node's clock."""

    heard_ns: int
    reference: int = 0
    round: int = 0
    said: int = 0
    hops: int = 0
    advanced_ns: int = 0
    trusted: bool = True
    """True if its last pair was accepted."""
    paired_ns: int | None = None
    in_step_ns: int = 0
    """The last instant at which it stated the time of this node's reference, or was new."""
    stamps: dict[int, int] = field(default_factory=dict)


class TimeSync:
    """The synchronization of one node. Instants are of the node's own clock unless they are said to be swarm time."""

    def __init__(self, own: Settings) -> None:
        self._own = own
        self._fit = ClockFit(own.oscillator)
        self._rival: tuple[int, ClockFit, int] | None = None
        """Another reference that may be followed: its id, its pairs so far, and since when it is considered."""
        self._neighbors: dict[NodeId, _LastBeacon] = {}
        self._doubt_ns = int(_DOUBT_HELLOS * own.hello_ns)
        self._first = InitialSync(
            own.oscillator, leader=own.leader, wait_ns=self._doubt_ns, memory_ns=int(_FRESH_HELLOS * own.hello_ns)
        )
        self._sent: tuple[int, int] | None = None
        """The last hello that this node has sent: its number, and when it ended."""
        self.reference: int | None = None
        """The reference whose time this node has, or None; after a restart it may be itself, not `is_reference`."""
        self.is_reference = False
        self._led_at: float | None = None
        """The rate of swarm time over this node's clock that it gave as the reference before it lost the time."""
        self._round = 0
        self._news_ns = 0
        self._claim_ns = 0
        self._worst: tuple[int, int] = (0, 0)
        """The greatest error known of any node, and when it was stated."""
        self.counts: Counter[str] = Counter()
        self._agreed: dict[int, int] = {}
        """When a neighbor last stated a time that agrees with this node's."""
        self._contradicting: set[int] = set()
        """The neighbors that have contradicted this node's time since the last one agreed."""
        self._agreed_ns = 0

    # --- the state of synchronization -----------------------------------------------------------------------------

    @property
    def synced(self) -> bool:
        return self.reference is not None

    @property
    def line(self) -> Line:
        return self._fit.line or EXACT

    def error_ns(self, local_ns: int) -> int | None:
        """A bound of this node's error against the reference; None when it is not synchronized."""
        if self.reference is None:
            return None
        return 0 if self.is_reference else self.line.error_ns(local_ns, self._own.oscillator)

    def supported(self, local_ns: int) -> bool:
        """True if two neighbors, or the reference itself, lately stated this node's time."""
        horizon_ns = local_ns - int(_SUPPORT_HELLOS * self._own.hello_ns)
        fresh = [node for node, agreed_ns in self._agreed.items() if agreed_ns >= horizon_ns]
        return len(fresh) >= _SUPPORTERS or self.reference in fresh

    def worst_ns(self, local_ns: int) -> int:
        """The greatest bound that any node is known to state, including this node."""
        if self._is_contradicted(local_ns, hellos=_QUESTION_HELLOS):
            return MOST_STATED_NS
        own_ns = min(self.error_ns(local_ns) or 0, MOST_STATED_NS)
        value_ns, stated_at_ns = self._worst
        return value_ns if value_ns > own_ns and local_ns - stated_at_ns < WORST_LIFE_NS else own_ns

    def hops(self, local_ns: int) -> int | None:
        """The hops from the reference; None when no neighbor knows the reference."""
        if self.is_reference:
            return 0
        near = (n.hops for n in self._neighbors.values() if n.trusted and self._is_fresh(n, local_ns))
        least = min(near, default=None)
        return None if least is None else min(255, least + 1)

    def _is_fresh(self, neighbor: _LastBeacon, local_ns: int) -> bool:
        return neighbor.reference == self.reference and not self._is_stale(neighbor.advanced_ns, local_ns)

    def _is_stale(self, news_ns: int, local_ns: int) -> bool:
        return local_ns - news_ns > _FRESH_HELLOS * self._own.hello_ns

    # --- sending --------------------------------------------------------------------------------------------------

    def start(self, local_ns: int) -> None:
        self._news_ns = local_ns
        self._wait(local_ns)
        if self._own.leads:
            self._claim_ns = local_ns + int(_LISTEN_HELLOS * self._own.hello_ns)

    def hello_sent(self, hello: int, *, ended_ns: int) -> None:
        self._sent = (hello, ended_ns)

    def beacon(self, local_ns: int) -> TimeBeacon | None:
        """The beacon for the next hello, about the previous one; None without a time, or without a previous hello."""
        self.pass_time(local_ns)
        hops = self.hops(local_ns)
        if self.reference is None or self._sent is None or hops is None:
            return None
        if self.reference == self._own.node and not self.is_reference:
            return None
        hello, ended_ns = self._sent
        t_ns = self.line.swarm_ns(ended_ns)
        error_ns = 0 if hops == 0 else self.line.error_ns(ended_ns, self._own.oscillator)
        if t_ns < 0 or error_ns > _U32:
            return None
        if hops == 0:
            self._round = following(self._round, bits=16)
        self._learn_worst(error_ns, stated_at_ns=local_ns)
        worst_ns, stated_at_ns = self._worst
        age_s = min(255, math.ceil((local_ns - stated_at_ns) / S))
        rate_ppb = 0 if hops == 0 else math.ceil(self.line.rate_error(self._own.oscillator) * _PPB)
        return TimeBeacon(
            t_ns, error_ns, rate_ppb, worst_ns, hello, self._round, self._own.node, self.reference, age_s, hops
        )

    def pass_time(self, local_ns: int) -> None:
        """Become the reference if there has been none for long enough, or if it is time to take over."""
        if self.is_reference:
            return
        needed = _PROVEN if self.reference == self._own.node else _SETTLED
        takes_over = self.reference is not None and self._own.node <= self.reference and len(self._fit) >= needed
        if local_ns >= self._claim_ns or takes_over:
            self._become_reference()
            self._agreed_ns = local_ns
            self._contradicting.clear()

    def _become_reference(self) -> None:
        """Become the reference: from now on swarm time is this node's line, without error."""
        rate = self.line.rate
        if self.reference == self._own.node and self._led_at is not None:
            rate = self._led_at  # it leads on, and a few pairs soon after each other tell no rate
        self._fit.replace(self.line._replace(rate=rate, stated_ns=0.0, offset_sd_ns=0.0, rate_sd=0.0, stated_rate=0.0))
        self.reference, self.is_reference, self._rival = self._own.node, True, None
        self.counts["claimed"] += 1

    def _arm(self, local_ns: int, *, hellos: int = _SILENT_HELLOS) -> None:
        staggered = hellos + _STAGGER_HELLOS * (self._own.node % _STAGGERED)
        self._claim_ns = local_ns + int(staggered * self._own.hello_ns)

    def _wait(self, local_ns: int) -> None:
        self._arm(local_ns, hellos=_FIRST_HELLOS)

    # --- receiving ------------------------------------------------------------------------------------------------

    def on_hello(self, src: NodeId, hello: int, beacon: TimeBeacon | None, *, ended_ns: int, local_ns: int) -> None:
        """A neighbor's hello was received, which ended at `ended_ns`, with the time beacon in it, if any."""
        neighbor = self._neighbor(src, local_ns)
        pair = None
        if beacon is not None:
            pair = self._pair(neighbor, src, beacon, local_ns)
        while len(neighbor.stamps) >= _STAMPS:
            del neighbor.stamps[next(iter(neighbor.stamps))]
        neighbor.stamps[hello] = ended_ns
        if beacon is not None and pair is not None:
            self._on_pair(neighbor, beacon, pair, local_ns)
        self._watch_step(neighbor, beacon, local_ns)

    def on_old_hello(self, src: NodeId, local_ns: int) -> None:
        """A hello in a neighbor's name is of another time: the neighbor is out of step, unless others of it are not."""
        self._watch_step(self._neighbor(src, local_ns), None, local_ns)

    def _watch_step(self, neighbor: _LastBeacon, beacon: TimeBeacon | None, local_ns: int) -> None:
        """A neighbor without the swarm's time disturbs turns: a clock with a greater error than hellos state."""
        if self.reference is None or (beacon is not None and beacon.reference == self.reference and neighbor.trusted):
            neighbor.in_step_ns = local_ns
        elif local_ns - neighbor.in_step_ns > _APART_HELLOS * self._own.hello_ns:
            self.counts["apart"] += 1
            self._learn_worst(MOST_STATED_NS, stated_at_ns=local_ns)

    def _neighbor(self, src: NodeId, local_ns: int) -> _LastBeacon:
        found = self._neighbors.get(src)
        if found is None:
            if len(self._neighbors) >= _NEIGHBORS:
                silent = min(sorted(self._neighbors), key=lambda node: self._neighbors[node].heard_ns)
                del self._neighbors[silent]
                self._agreed.pop(silent, None)
            found = self._neighbors[src] = _LastBeacon(local_ns, in_step_ns=local_ns)
        found.heard_ns = local_ns
        return found

    def _pair(self, neighbor: _LastBeacon, src: NodeId, beacon: TimeBeacon, local_ns: int) -> Pair | None:
        """Update what is known of a neighbor; returns the pair that its beacon completes, if it is admissible."""
        if beacon.node != src:
            self.counts["foreign"] += 1
            return None
        began_anew = newer(beacon.round, neighbor.said, bits=16) and self._is_stale(neighbor.advanced_ns, local_ns)
        neighbor.said = beacon.round
        if beacon.reference != neighbor.reference or newer(beacon.round, neighbor.round, bits=16) or began_anew:
            neighbor.reference, neighbor.round, neighbor.advanced_ns = beacon.reference, beacon.round, local_ns
            neighbor.hops = beacon.hops
            self._note_news(neighbor, local_ns)
        neighbor.hops = beacon.hops
        ended_ns = neighbor.stamps.pop(beacon.hello, None)
        if ended_ns is None or self._is_stale(neighbor.advanced_ns, local_ns):
            return None
        hello_ns = self._own.hello_ns  # one that seems to be far earlier was heard after this clock has jumped back
        if neighbor.paired_ns is not None and -hello_ns < ended_ns - neighbor.paired_ns < hello_ns // _HASTY:
            self.counts["hasty"] += 1  # a neighbor that sends more often must not have more weight
            return None
        offset_ns = beacon.t_ns - ended_ns
        if abs(offset_ns) > self._own.limit_ns:
            self.counts["implausible"] += 1
            if beacon.reference == self.reference or self.reference is None:
                self.contradicted(src, local_ns)
            if not self._own.leads:
                self._wait(local_ns)  # the swarm has a time, which this clock cannot have
            return None
        neighbor.paired_ns = ended_ns
        return Pair(
            ended_ns, offset_ns + self._own.flight_ns // 2, beacon.error_ns + self._own.hop_ns, beacon.rate_ppb / _PPB,
            source=src,
        )  # fmt: skip

    def _on_pair(self, neighbor: _LastBeacon, beacon: TimeBeacon, pair: Pair, local_ns: int) -> None:
        if self.reference is None:
            if not self._first.on_statement(NodeId(beacon.node), beacon.reference, pair, local_ns=local_ns):
                self.counts["doubted"] += 1
                self._claim_ns = max(self._claim_ns, local_ns + self._doubt_ns)  # the swarm has a time already
                return
            self.reference = beacon.reference
            self._note_news(neighbor, local_ns)
        if beacon.reference == self.reference:
            if self._fit.line is None or self._fit.agrees(pair):
                self._agreed[beacon.node] = self._agreed_ns = local_ns
                self._contradicting.clear()
            else:
                self.contradicted(beacon.node, local_ns)
            if self.reference is not None and not self.is_reference:
                self._follow(neighbor, pair, local_ns)
            self._learn_worst(beacon.worst_ns, stated_at_ns=local_ns - beacon.worst_age_s * S)
        elif beacon.reference < self.reference or (not self.is_reference and self._is_stale(self._news_ns, local_ns)):
            self._consider(beacon.reference, pair, local_ns)

    def contradicted(self, src: int, local_ns: int) -> None:
        """If several that agreed state another time, and nobody agrees, this clock has jumped."""
        if src in self._agreed:
            self._contradicting.add(src)
        if self._is_contradicted(local_ns, hellos=_QUESTION_HELLOS):
            self._worst = (MOST_STATED_NS, local_ns)
        if self.reference is not None and self._is_contradicted(local_ns, hellos=_LOST_HELLOS):
            self._lose(local_ns)

    def _is_contradicted(self, local_ns: int, *, hellos: float) -> bool:
        alone_ns = abs(local_ns - self._agreed_ns)  # the clock may have jumped back
        needed = min(_CONTRADICTING, len(self._agreed)) or _CONTRADICTING
        return len(self._contradicting) >= needed and alone_ns > hellos * self._own.hello_ns

    def _lose(self, local_ns: int) -> None:
        self.counts["lost"] += 1
        if self.is_reference:
            self._led_at = self.line.rate
        self.reference, self.is_reference, self._rival = None, False, None
        self._fit = ClockFit(self._own.oscillator)
        self._first = InitialSync(
            self._own.oscillator,
            leader=self._own.leader,
            wait_ns=self._doubt_ns,
            memory_ns=int(_FRESH_HELLOS * self._own.hello_ns),
        )
        self._neighbors.clear()
        self._agreed.clear()
        self._contradicting.clear()
        self._agreed_ns = local_ns
        self._wait(local_ns)

    def _follow(self, neighbor: _LastBeacon, pair: Pair, local_ns: int) -> None:
        """Use a pair from a neighbor that follows the same reference."""
        steps = self._fit.steps
        if self._fit.line is None:
            self._fit.add(pair)  # `InitialSync` has accepted it
            return
        agrees = self._fit.agrees(pair)
        if not agrees:
            neighbor.trusted = self._fit.add(pair)
            self.counts["outlier"] += not neighbor.trusted
            self.counts["step"] += self._fit.steps - steps
            if not neighbor.trusted:
                return
        neighbor.trusted = True
        if neighbor.hops + 1 == self.hops(local_ns) and agrees:
            self._fit.add(pair)

    def _note_news(self, neighbor: _LastBeacon, local_ns: int) -> None:
        """The reference was alive a moment ago, if this neighbor is one whose time this node uses."""
        if self.is_reference or neighbor.reference != self.reference or not neighbor.trusted:
            return
        if neighbor.hops + 1 == self.hops(local_ns):
            self._round = neighbor.round
            self._news_ns = local_ns
            self._arm(local_ns)

    def _learn_worst(self, value_ns: int, *, stated_at_ns: int) -> None:
        value_ns = min(value_ns, MOST_STATED_NS)
        worst_ns, at_ns = self._worst
        if value_ns > worst_ns or stated_at_ns - at_ns >= (0 if value_ns == worst_ns else WORST_LIFE_NS):
            self._worst = (value_ns, stated_at_ns)

    def _consider(self, reference: int, pair: Pair, local_ns: int) -> None:
        """Collect pairs of a reference with a lower id, or while the own one is silent; after `_PROVEN` follow it."""
        rival = self._rival
        if rival is None or reference < rival[0] or self._is_stale(rival[2], local_ns):
            rival = self._rival = (reference, ClockFit(self._own.oscillator), local_ns)
        if reference != rival[0]:
            return
        rival[1].add(pair)
        if len(rival[1]) < _PROVEN:
            return
        self.counts["step"] += self._fit.line is not None and not self._fit.agrees(pair)
        self._fit = rival[1]  # earlier pairs and their errors refer to the former reference
        self.reference, self.is_reference, self._rival = reference, False, None
        self._news_ns = local_ns
        self._arm(local_ns)

    # --- reporting ------------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        """The state and the counters, as JSON values."""
        return {
            "reference": self.reference,
            "pairs": len(self._fit),
            "rate_ppm": round(self.line.rate * 1e6, 4),
            **dict(sorted(self.counts.items())),
        }

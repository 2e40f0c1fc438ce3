"""A common time for the swarm: hellos carry the time of one reference hop by hop, two steps each, as in FTSP.

    hello n ends                   its sender and all who hear it stamp that instant, each by the own clock
    hello n+1 says "hello n ended at swarm time t"     -> a pair (own stamp, t) -> the fit of `clock_fit`

So contention, however long it defers a hello, costs nothing. The reference is the node with the lowest id: whoever
hears of none for a while takes its own clock, and whoever hears of a lower one follows it (root election by time-out,
Maroti et al. 2004). A reference that comes later, or takes over, goes on with the time that the swarm has. Pairs are
taken from the neighbors nearest to the reference; the others only contradict. News is news when the reference's
`round` went on.

Sans-IO: own instants and beacons in; the line to swarm time, its error and the next beacon out. Not here: secrecy or
proof of origin. A forged beacon that is plausible is believed as one neighbor's word; it is outvoted, not recognized.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from fanet_mw.timesync.clock_fit import EXACT, ClockFit, Line, Oscillator, Pair
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire.inner import TimeBeacon

_LISTEN_HELLOS: Final = 2.5
"""How long the leader listens at its start: a swarm that has a time already keeps it."""
_SILENT_HELLOS: Final = 16
"""Without news of a reference for so long, a node takes its place; the lower its id, the sooner."""
_STAGGER_HELLOS: Final = 0.5
_STAGGERED: Final = 32
_FRESH_HELLOS: Final = 4.5
"""A neighbor whose round did not go on for so long has lost the reference."""
_SETTLED: Final = 8
"""Pairs after which a node with a lower id takes over from the reference."""
_PROVEN: Final = 2
"""Pairs after which another reference is followed."""
_HASTY: Final = 4
"""Pairs of one neighbor that are closer than a hello interval by this are too many."""
_STAMPS: Final = 4
"""Hellos of a neighbor of which we remember when they ended."""
_NEIGHBORS: Final = 256
_WORST_NS: Final = 20 * MS
"""A greater error than this is a node that has no time yet, or nonsense: no guard is made for it."""
_WORST_LIFE_NS: Final = 20 * S
_PPB: Final = 1e9
_U32: Final = 0xFFFF_FFFF


class Settings(NamedTuple):
    """What does not change while a node is up."""

    node: NodeId
    leads: bool
    """Whether it is the swarm's leader, who waits for nobody."""
    hello_ns: int
    oscillator: Oscillator
    flight_ns: int
    """The longest that a frame flies to a neighbor."""
    limit_ns: int
    """A swarm time farther from the own clock is not believed."""

    @property
    def hop_ns(self) -> int:
        """What one hop may add to the error of a pair: half the flight is taken for granted, a stamp is cut twice."""
        return self.flight_ns // 2 + self.oscillator.stamp_ns


@dataclass(slots=True)
class _Neighbor:
    """What one neighbor said last, and when its hellos ended by our clock."""

    heard_ns: int
    reference: int = 0
    round: int = 0
    hops: int = 0
    advanced_ns: int = 0
    trusted: bool = True
    """Whether its last pair was believed."""
    paired_ns: int | None = None
    stamps: dict[int, int] = field(default_factory=dict)


class TimeSync:
    """One node's way to swarm time. All instants are of its own clock, unless they say swarm."""

    def __init__(self, own: Settings) -> None:
        self._own = own
        self._fit = ClockFit(own.oscillator)
        self._rival: tuple[int, ClockFit, int] | None = None
        """Another reference, its pairs so far, and since when."""
        self._neighbors: dict[NodeId, _Neighbor] = {}
        self._sent: tuple[int, int] | None = None
        """Our last hello that left: its number, and when it ended."""
        self.reference: int | None = None
        """Whose time we have; None: nobody's. Our own id, though we do not lead: the swarm's memory of us."""
        self.leading = False
        self._round = 0
        self._news_ns = 0
        self._claim_ns = 0
        self._worst: tuple[int, int] = (0, 0)
        """The greatest error we know of, and when it was stated."""
        self.counts: Counter[str] = Counter()

    # --- what we know ---------------------------------------------------------------------------------------------

    @property
    def synced(self) -> bool:
        return self.reference is not None

    @property
    def line(self) -> Line:
        """From the own clock to swarm time; the own clock itself before there is any."""
        return self._fit.line or EXACT

    def error_ns(self, local_ns: int) -> int | None:
        """The stated bound of our error against the reference; None: not synchronized."""
        if self.reference is None:
            return None
        return 0 if self.leading else self.line.error_ns(local_ns, self._own.oscillator)

    def worst_ns(self, local_ns: int) -> int:
        """The greatest bound that any node is known to state, our own included."""
        own_ns = min(self.error_ns(local_ns) or 0, _WORST_NS)
        value_ns, said_ns = self._worst
        return value_ns if value_ns > own_ns and local_ns - said_ns < _WORST_LIFE_NS else own_ns

    def hops(self, local_ns: int) -> int | None:
        """From the reference; None: nobody who knows it is in reach."""
        if self.leading:
            return 0
        near = (n.hops for n in self._neighbors.values() if n.trusted and self._is_fresh(n, local_ns))
        least = min(near, default=None)
        return None if least is None else min(255, least + 1)

    def _is_fresh(self, neighbor: _Neighbor, local_ns: int) -> bool:
        return neighbor.reference == self.reference and not self._is_stale(neighbor.advanced_ns, local_ns)

    def _is_stale(self, news_ns: int, local_ns: int) -> bool:
        return local_ns - news_ns > _FRESH_HELLOS * self._own.hello_ns

    # --- what we say ----------------------------------------------------------------------------------------------

    def start(self, local_ns: int) -> None:
        """The node is up."""
        self._news_ns = local_ns
        self._arm(local_ns)
        if self._own.leads:
            self._claim_ns = local_ns + int(_LISTEN_HELLOS * self._own.hello_ns)

    def hello_sent(self, hello: int, *, ended_ns: int) -> None:
        """A hello of ours has left the antenna."""
        self._sent = (hello, ended_ns)

    def beacon(self, local_ns: int) -> TimeBeacon | None:
        """What our next hello says of the last one; None while we know no time or no hello has left."""
        self.pass_time(local_ns)
        hops = self.hops(local_ns)
        if self.reference is None or self._sent is None or hops is None:
            return None
        if self.reference == self._own.node and not self.leading:
            return None
        hello, ended_ns = self._sent
        t_ns = self.line.swarm_ns(ended_ns)
        error_ns = 0 if hops == 0 else self.line.error_ns(ended_ns, self._own.oscillator)
        if t_ns < 0 or error_ns > _U32:
            return None
        if hops == 0:
            self._round = (self._round + 1) & 0xFFFF
        self._learn_worst(error_ns, said_ns=local_ns)
        worst_ns, said_ns = self._worst
        age_s = min(255, math.ceil((local_ns - said_ns) / S))
        rate_ppb = 0 if hops == 0 else math.ceil(self.line.rate_error(self._own.oscillator) * _PPB)
        return TimeBeacon(
            t_ns, error_ns, rate_ppb, worst_ns, hello, self._round, self._own.node, self.reference, age_s, hops
        )

    def pass_time(self, local_ns: int) -> None:
        """Become the reference, when there has been none for long enough, or when it is time to take over."""
        if self.leading:
            return
        needed = _PROVEN if self.reference == self._own.node else _SETTLED
        takes_over = self.reference is not None and self._own.node <= self.reference and len(self._fit) >= needed
        if local_ns >= self._claim_ns or takes_over:
            self._lead()

    def _lead(self) -> None:
        """From now on swarm time is our line, without error."""
        self._fit.settle(self.line._replace(stated_ns=0.0, offset_sd_ns=0.0, rate_sd=0.0, stated_rate=0.0))
        self.reference, self.leading, self._rival = self._own.node, True, None
        self.counts["claimed"] += 1

    def _arm(self, local_ns: int) -> None:
        hellos = _SILENT_HELLOS + _STAGGER_HELLOS * (self._own.node % _STAGGERED)
        self._claim_ns = local_ns + int(hellos * self._own.hello_ns)

    # --- what we hear ---------------------------------------------------------------------------------------------

    def hear(self, src: NodeId, hello: int, beacon: TimeBeacon | None, *, ended_ns: int, local_ns: int) -> None:
        """A neighbor's hello, which ended at `ended_ns`, with the time it carries, if any."""
        neighbor = self._neighbor(src, local_ns)
        pair = None
        if beacon is not None:
            pair = self._pair(neighbor, src, beacon, local_ns)
        while len(neighbor.stamps) >= _STAMPS:
            del neighbor.stamps[next(iter(neighbor.stamps))]
        neighbor.stamps[hello] = ended_ns
        if beacon is not None and pair is not None:
            self._judge(neighbor, beacon, pair, local_ns)

    def _neighbor(self, src: NodeId, local_ns: int) -> _Neighbor:
        found = self._neighbors.get(src)
        if found is None:
            if len(self._neighbors) >= _NEIGHBORS:
                silent = min(sorted(self._neighbors), key=lambda node: self._neighbors[node].heard_ns)
                del self._neighbors[silent]
            found = self._neighbors[src] = _Neighbor(local_ns)
        found.heard_ns = local_ns
        return found

    def _pair(self, neighbor: _Neighbor, src: NodeId, beacon: TimeBeacon, local_ns: int) -> Pair | None:
        """Take in what a neighbor says of itself; the pair it completes, if it is one that may be looked at."""
        if beacon.node != src:
            self.counts["foreign"] += 1
            return None
        if beacon.reference != neighbor.reference or 0 < ((beacon.round - neighbor.round) & 0xFFFF) < 0x8000:
            neighbor.reference, neighbor.round, neighbor.advanced_ns = beacon.reference, beacon.round, local_ns
            neighbor.hops = beacon.hops
            self._news(neighbor, local_ns)
        neighbor.hops = beacon.hops
        ended_ns = neighbor.stamps.pop(beacon.hello, None)
        if ended_ns is None or self._is_stale(neighbor.advanced_ns, local_ns):
            return None
        if neighbor.paired_ns is not None and ended_ns - neighbor.paired_ns < self._own.hello_ns // _HASTY:
            self.counts["hasty"] += 1  # whoever says more often has no more votes
            return None
        offset_ns = beacon.t_ns - ended_ns
        if abs(offset_ns) > self._own.limit_ns:
            self.counts["implausible"] += 1
            return None
        neighbor.paired_ns = ended_ns
        return Pair(
            ended_ns, offset_ns + self._own.flight_ns // 2, beacon.error_ns + self._own.hop_ns, beacon.rate_ppb / _PPB
        )

    def _judge(self, neighbor: _Neighbor, beacon: TimeBeacon, pair: Pair, local_ns: int) -> None:
        if self.reference is None:
            self.reference = beacon.reference
            self._news(neighbor, local_ns)
        if beacon.reference == self.reference:
            if not self.leading:
                self._follow(neighbor, pair, local_ns)
            self._learn_worst(beacon.worst_ns, said_ns=local_ns - beacon.worst_age_s * S)
        elif beacon.reference < self.reference or (not self.leading and self._is_stale(self._news_ns, local_ns)):
            self._consider(beacon.reference, pair, local_ns)

    def _follow(self, neighbor: _Neighbor, pair: Pair, local_ns: int) -> None:
        """The word of a neighbor that follows the same reference."""
        steps = self._fit.steps
        if self._fit.line is None:
            self._fit.add(pair)  # the first word of anybody is better than none
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

    def _news(self, neighbor: _Neighbor, local_ns: int) -> None:
        """The reference that we follow was alive a moment ago, as one says whose time we take."""
        if self.leading or neighbor.reference != self.reference or not neighbor.trusted:
            return
        if neighbor.hops + 1 == self.hops(local_ns):
            self._round = neighbor.round
            self._news_ns = local_ns
            self._arm(local_ns)

    def _learn_worst(self, value_ns: int, *, said_ns: int) -> None:
        value_ns = min(value_ns, _WORST_NS)
        if value_ns > self._worst[0] or said_ns - self._worst[1] >= _WORST_LIFE_NS:
            self._worst = (value_ns, said_ns)

    def _consider(self, reference: int, pair: Pair, local_ns: int) -> None:
        """Another reference, that has a lower id or comes when ours is silent: follow it when it is no accident."""
        rival = self._rival
        if rival is None or reference < rival[0] or self._is_stale(rival[2], local_ns):
            rival = self._rival = (reference, ClockFit(self._own.oscillator), local_ns)
        if reference != rival[0]:
            return
        rival[1].add(pair)
        if len(rival[1]) < _PROVEN:
            return
        if len(self._fit) < _PROVEN or not self._fit.agrees(pair):
            self.counts["step"] += self._fit.line is not None and not self._fit.agrees(pair)
            self._fit = rival[1]
        else:
            self._fit.add(pair)
        self.reference, self.leading, self._rival = reference, False, None
        self._news_ns = local_ns
        self._arm(local_ns)

    # --- for people -----------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        """JSON-able state and counters."""
        return {
            "reference": self.reference,
            "pairs": len(self._fit),
            "rate_ppm": round(self.line.rate * 1e6, 4),
            **dict(sorted(self.counts.items())),
        }

"""The traffic load of one node: when it sends the next packet, and how long that is.

Packets are generated at whole microseconds, because the header states no more.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from random import Random
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.application import Application, AppPort, Fate, Status
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario, Traffic
from fanet_mw.units import BROADCAST, MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire import PRIORITIES

_REFUSED_NS: Final = MS
"""A saturated source whose packet was not sent waits this long before it offers the next one."""
_ENDS: Final = frozenset((Fate.SENT, Fate.TURNED_AWAY, Fate.REFUSED, Fate.EXPIRED, Fate.DROPPED))
"""The fates after which a saturated source offers its next packet."""


class _Class(NamedTuple):
    """One class of traffic."""

    name: str
    traffic: Traffic
    first: bool

    @classmethod
    def of(cls, scenario: Scenario, name: str | None) -> "_Class":
        """The class of this name; None stands for the first one."""
        classes = scenario.traffic_classes
        first = next(iter(classes))
        chosen = first if name is None else name
        return cls(chosen, classes[chosen], chosen == first)

    def stream_name(self, use: str) -> str:
        """The name of a random stream. The first class always has the name that a single class has."""
        return use if self.first else f"{use} {self.name}"


def sources_of(scenario: Scenario, name: str | None = None) -> Sequence[int]:
    """The ids of the nodes that are sources of a traffic class, ascending; by default of the first class."""
    return _sources(scenario, _Class.of(scenario, name))


def _sources(scenario: Scenario, chosen: _Class) -> Sequence[int]:
    traffic = chosen.traffic
    if traffic.arrivals == "none":
        return ()
    return _drawn(
        traffic.sources, traffic.destination, count=scenario.nodes.count, leader=scenario.leader, seed=scenario.seed,
        stream_name=chosen.stream_name("sources"),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _drawn(
    sources: str | int | tuple[int, ...],
    destination: str | int,
    *,
    count: int,
    leader: NodeId,
    seed: int,
    stream_name: str,
) -> tuple[int, ...]:
    """The sources of a class among `count` nodes; each node of a large swarm asks for the same ones."""
    if isinstance(sources, tuple):
        return tuple(sorted(set(sources)))
    eligible = [node for node in range(1, count + 1) if node != destination]
    if isinstance(sources, str) or sources >= len(eligible):
        return tuple(eligible)
    members = [node for node in eligible if node != leader]
    if sources > len(members):
        members = eligible
    return tuple(sorted(stream(seed, stream_name).sample(members, sources)))


def targets_of(scenario: Scenario, source: int, name: str | None = None) -> Sequence[int]:
    """The ids of the nodes that are targets of the packets of `source`, of one class or of the first."""
    traffic = _Class.of(scenario, name).traffic
    if traffic.destination != "all":
        return [traffic.destination]
    wanted = traffic.targets or scenario.node_ids
    return [node for node in wanted if node != source]


class TrafficGenerator:
    """The instants and lengths of the packets of one class at one source."""

    def __init__(self, scenario: Scenario, node: NodeId, name: str | None = None) -> None:
        chosen = _Class.of(scenario, name)
        traffic = chosen.traffic
        self._kind = traffic.arrivals
        self.saturated = self._kind == "saturated"
        self._lead_ms = math.ceil(scenario.radio.lead_ms)
        self._interval_ns = max(US, round(traffic.interval_s * S))
        start_ns, self._end_ns = scenario.traffic_window_ns
        if traffic.start_s is not None:
            start_ns = seconds_to_ns(traffic.start_s)
        self._random: Random = stream(scenario.seed, chosen.stream_name("traffic"), node)
        self._on_ns, self._off_ns = seconds_to_ns(traffic.on_s), seconds_to_ns(traffic.off_s)
        self._active_until_ns = 0
        self._packets = sorted((start_ns + seconds_to_ns(at_s) // US * US, size) for at_s, size in traffic.packets)
        self._bytes = traffic.payload_bytes
        self._next_ns: int | None = None
        self.owed = 1
        """The number of packets that are generated at `next_ns`."""
        if node in _sources(scenario, chosen):
            self._next_ns = start_ns + self._first_gap_ns(start_ns)
            self.owed = self.depth if self.saturated else 1

    @property
    def next_bytes(self) -> int:
        return self._packets[0][1] if self._packets else self._bytes

    @property
    def depth(self) -> int:
        """Packets that a saturated source keeps queued: one in service, and those sent within two leads."""
        return 1 + 2 * self._lead_ms

    def _first_gap_ns(self, start_ns: int) -> int:
        """The time until the first packet: a random phase of the interval, or 0 for a saturated source."""
        if self._kind == "trace":
            return self._packets[0][0] - start_ns
        if self._kind == "on_off":
            phase_ns = int(self._random.random() * self._interval_ns) // US * US
            self._active_until_ns = start_ns + phase_ns + self._period_ns(self._on_ns)
            return phase_ns
        if self._kind == "cbr":
            return int(self._random.random() * self._interval_ns) // US * US
        return 0 if self.saturated else self._poisson_ns()

    def _poisson_ns(self) -> int:
        return round(self._random.expovariate(1 / self._interval_ns)) // US * US

    def _period_ns(self, mean_ns: int) -> int:
        """The length of an active period, or of a pause."""
        return round(self._random.expovariate(1 / mean_ns)) // US * US if mean_ns else 0

    def _following_ns(self, born_ns: int) -> int | None:
        if self._kind == "trace":
            del self._packets[0]
            return self._packets[0][0] if self._packets else None
        if self._kind == "on_off":
            next_ns = born_ns + self._interval_ns
            while next_ns >= self._active_until_ns:
                next_ns = max(next_ns, self._active_until_ns + self._period_ns(self._off_ns))
                self._active_until_ns = next_ns + self._period_ns(self._on_ns)
                if self._active_until_ns > next_ns:
                    break
            return next_ns
        return born_ns + (self._interval_ns if self._kind == "cbr" else self._poisson_ns())

    def start(self, now_ns: int) -> None:
        """Skip the packets that were due before now, because the process has only just started."""
        if self._next_ns is None or now_ns <= self._next_ns:
            return
        if self.saturated:
            self._next_ns = now_ns
            return
        while self._next_ns is not None and self._next_ns < min(now_ns, self._end_ns):
            self.advance()

    def next_ns(self) -> int | None:
        """The instant of the next packet; None if there is none, or if a saturated source waits for one to end."""
        if self._next_ns is None or self._next_ns >= self._end_ns:
            return None
        return self._next_ns

    def advance(self) -> None:
        assert self._next_ns is not None, "only a source that has a next packet can send it"
        if self.saturated:
            self._next_ns, self.owed = None, 0  # from now on, one packet for each one that ends
        else:
            self._next_ns = self._following_ns(self._next_ns)

    def on_ended(self, *, refused: bool, now_ns: int) -> bool:
        """A saturated source's packet has ended; True if the next one follows at once, otherwise at `next_ns`."""
        if now_ns >= self._end_ns:
            return False
        if refused:
            self.owed += 1
            if self._next_ns is None:
                self._next_ns = now_ns + _REFUSED_NS + self._lead_ms * MS
        return not refused


class Load(Application):
    """The application that sends the packets of one class at one node; their content does not matter."""

    def __init__(self, scenario: Scenario, node: NodeId, name: str) -> None:
        _, traffic, first = _Class.of(scenario, name)
        self.name = name
        self._node = node
        self._traffic = TrafficGenerator(scenario, node, name)
        self._destination = BROADCAST if traffic.destination == "all" else NodeId(traffic.destination)
        self._priority = PRIORITIES[traffic.priority]
        self._deadline_ns = None if traffic.deadline_s is None or first else seconds_to_ns(traffic.deadline_s)
        """The deadline of each packet; None for the first class, for which the protocol enforces it."""
        self.follows = _ENDS if self._traffic.saturated else ()
        self._queued: set[int] = set()
        """The packets of a saturated source that have not ended yet, by handle."""
        self._generated = 0

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        self._traffic.start(now_ns)

    def wake(self, now_ns: int) -> None:
        due_ns = self._traffic.next_ns()
        while due_ns is not None and due_ns <= now_ns:
            for _ in range(self._traffic.owed):
                self._send(due_ns)
            self._traffic.advance()
            due_ns = self._traffic.next_ns()

    def next_wake_ns(self) -> int | None:
        return self._traffic.next_ns()

    def on_status(self, status: Status, now_ns: int) -> None:
        if status.handle not in self._queued:
            return
        self._queued.discard(status.handle)
        if self._traffic.on_ended(refused=status.fate is not Fate.SENT, now_ns=now_ns):
            self._send(now_ns)

    def report(self) -> Mapping[str, Any]:
        return {"generated": self._generated}

    def _send(self, born_ns: int) -> None:
        self._generated += 1
        filler = wire.filler(self._traffic.next_bytes - wire.HEADER_BYTES, node=self._node)
        handle = self.port.send(
            filler,
            destination=self._destination,
            priority=self._priority,
            deadline_ns=self._deadline_ns,
            born_ns=born_ns,
        )
        if self._traffic.saturated:
            self._queued.add(handle)

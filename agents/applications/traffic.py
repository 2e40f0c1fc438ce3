"""The application load of one node: when it hands its node the next packet, and of what size.

`TrafficGenerator` says when, `Load` is the application that sends. Birth instants are whole microseconds, because
that is what the header carries.
"""

import math
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any, Final

from fanet_mw import wire
from fanet_mw.application import Application, AppPort, Fate, Status
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario, Traffic
from fanet_mw.units import BROADCAST, MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire import PRIORITIES

_REFUSED_NS: Final = MS
"""After a packet that the radio refused, a saturated source offers the next one so much later, not at once."""


def sources_of(scenario: Scenario, name: str | None = None) -> Sequence[int]:
    """The ids of the nodes that generate a class of traffic, ascending; by default the first class."""
    name, traffic = _class_of(scenario, name)
    eligible = [node for node in scenario.node_ids if node != traffic.destination]
    if traffic.arrivals == "none":
        return []
    if traffic.sources == "all":
        return eligible
    if isinstance(traffic.sources, tuple):
        return sorted(set(traffic.sources))
    members = [node for node in eligible if node != scenario.leader]
    if traffic.sources >= len(eligible):
        return eligible
    if traffic.sources > len(members):
        members = eligible
    return sorted(stream(scenario.seed, _use(scenario, name, "sources")).sample(members, traffic.sources))


def targets_of(scenario: Scenario, source: int, name: str | None = None) -> Sequence[int]:
    """The ids of the nodes for which a packet of `source` is meant, of one class or of the first."""
    name, traffic = _class_of(scenario, name)
    if traffic.destination != "all":
        return [traffic.destination]
    wanted = traffic.targets or scenario.node_ids
    return [node for node in wanted if node != source]


def _class_of(scenario: Scenario, name: str | None) -> tuple[str, Traffic]:
    classes = scenario.traffic_classes
    known = next(iter(classes)) if name is None else name
    return known, classes[known]


def _use(scenario: Scenario, name: str, use: str) -> str:
    """The name of a random stream; the first class, whatever it is called, has that of a single one."""
    return use if name == next(iter(scenario.traffic_classes)) else f"{use} {name}"


class TrafficGenerator:
    """The arrivals of one source of one class."""

    def __init__(self, scenario: Scenario, node: NodeId, name: str | None = None) -> None:
        name, traffic = _class_of(scenario, name)
        self._kind = traffic.arrivals
        self._lead_ms = math.ceil(scenario.radio.lead_ms)
        self._interval_ns = max(US, round(traffic.interval_s * S))
        start_ns, self._end_ns = scenario.traffic_window_ns
        if traffic.start_s is not None:
            start_ns = seconds_to_ns(traffic.start_s)
        self._random: Random = stream(scenario.seed, _use(scenario, name, "traffic"), node)
        self._on_ns, self._off_ns = seconds_to_ns(traffic.on_s), seconds_to_ns(traffic.off_s)
        self._active_until_ns = 0
        """The end of the period of activity, for arrivals `on_off`."""
        self._packets = sorted((start_ns + seconds_to_ns(at_s) // US * US, size) for at_s, size in traffic.packets)
        """The packets that are still to come, for arrivals `trace`."""
        self._bytes = traffic.payload_bytes
        self._next_ns: int | None = None
        self._owed = 1
        """The number of packets that are born at `next_ns`."""
        if node in sources_of(scenario, name):
            self._next_ns = start_ns + self._first_gap_ns(start_ns)
            self._owed = self.depth if self.saturated else 1

    @property
    def next_bytes(self) -> int:
        """The length of the packet that is born at `next_ns`."""
        return self._packets[0][1] if self._packets else self._bytes

    @property
    def depth(self) -> int:
        """The packets that a saturated source keeps outstanding: one in service, and those served within two leads."""
        return 1 + 2 * self._lead_ms

    @property
    def saturated(self) -> bool:
        return self._kind == "saturated"

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
        """The length of a period of activity, or of a pause."""
        return round(self._random.expovariate(1 / mean_ns)) // US * US if mean_ns else 0

    def _following_ns(self, born_ns: int) -> int | None:
        """The instant of the packet after the one that is born at an instant."""
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
        """Leave out what should have been born before now: the process has only just been started."""
        if self._next_ns is None or now_ns <= self._next_ns:
            return
        if self.saturated:
            self._next_ns = now_ns
            return
        while self._next_ns is not None and self._next_ns < min(now_ns, self._end_ns):
            self.advance()

    @property
    def owed(self) -> int:
        """The number of packets that are born at `next_ns`."""
        return self._owed

    def next_ns(self) -> int | None:
        """The instant of the next packet; None when there will be none (or, for a saturated source, none by itself)."""
        if self._next_ns is None or self._next_ns >= self._end_ns:
            return None
        return self._next_ns

    def advance(self) -> None:
        """Go on to the next packet: that of `next_ns` was sent."""
        assert self._next_ns is not None, "only a source that has a next packet can send it"
        if self.saturated:
            self._next_ns, self._owed = None, 0  # from here on, one packet for each that ends
        else:
            self._next_ns = self._following_ns(self._next_ns)

    def on_ended(self, *, refused: bool, now_ns: int) -> bool:
        """Take in that a packet of a saturated source has left, or was given up; True: the next one follows at once.

        After one that the radio refused it comes a moment later, and is asked for by `next_ns`.
        """
        if now_ns >= self._end_ns:
            return False
        if refused:
            self._owed += 1
            if self._next_ns is None:
                self._next_ns = now_ns + _REFUSED_NS + self._lead_ms * MS
        return not refused


class Load(Application):
    """One node's source of packets of one class, whose content does not matter."""

    def __init__(self, scenario: Scenario, node: NodeId, name: str) -> None:
        traffic = scenario.traffic_classes[name]
        self.name = name
        self._node = node
        self._traffic = TrafficGenerator(scenario, node, name)
        self._destination = BROADCAST if traffic.destination == "all" else NodeId(traffic.destination)
        self._priority = PRIORITIES[traffic.priority]
        first = name == next(iter(scenario.traffic_classes))
        self._deadline_ns = None if traffic.deadline_s is None or first else seconds_to_ns(traffic.deadline_s)
        """The deadline of packets; that of the first class is policed by the protocol, which knows it from the
        scenario."""
        self.follows = (Fate.SENT, Fate.TURNED_AWAY) if self._traffic.saturated else ()
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
        """A packet of a saturated source has left, or was given up."""
        if self._traffic.on_ended(refused=status.fate is Fate.TURNED_AWAY, now_ns=now_ns):
            self._send(now_ns)

    def report(self) -> Mapping[str, Any]:
        return {"generated": self._generated}

    def _send(self, born_ns: int) -> None:
        self._generated += 1
        filler = wire.filler(self._traffic.next_bytes - wire.HEADER_BYTES, node=self._node)
        self.port.send(
            filler,
            destination=self._destination,
            priority=self._priority,
            deadline_ns=self._deadline_ns,
            born_ns=born_ns,
        )

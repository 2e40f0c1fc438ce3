"""The application load of one node: when it hands its node the next packet, and of what size.

`Traffic` says when, `Load` is the application that sends. Birth instants are whole microseconds, because that is what
the header carries.
"""

import math
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any, Final

from fanet_mw import wire
from fanet_mw.application import Application, AppPort, Fate, Status
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, NodeId, S

_REFUSED_NS: Final = MS
"""After a packet that the radio refused, a saturated source offers the next one so much later, not at once."""


def sources_of(scenario: Scenario) -> Sequence[int]:
    """Ids of the nodes that generate application traffic, ascending."""
    traffic = scenario.traffic
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
    return sorted(stream(scenario.seed, "sources").sample(members, traffic.sources))


def targets_of(scenario: Scenario, source: int) -> Sequence[int]:
    """Ids of the nodes at which a packet of `source` is meant to arrive."""
    traffic = scenario.traffic
    if traffic.destination != "all":
        return [traffic.destination]
    wanted = traffic.targets or scenario.node_ids
    return [node for node in wanted if node != source]


class Traffic:
    """The arrivals of one source."""

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._kind = scenario.traffic.arrivals
        self._lead_ms = math.ceil(scenario.radio.lead_ms)
        self._interval_ns = max(US, round(scenario.traffic.interval_s * S))
        start_ns, self._end_ns = scenario.traffic_window_ns
        self._random: Random = stream(scenario.seed, "traffic", node)
        self._next_ns: int | None = None
        self._owed = 1
        """Packets that are born at `next_ns`."""
        if node in sources_of(scenario):
            self._next_ns = start_ns + self._first_gap_ns()
            self._owed = self.depth if self.saturated else 1

    @property
    def depth(self) -> int:
        """Packets a saturated source keeps outstanding: one in service, and what is served within two leads."""
        return 1 + 2 * self._lead_ms

    @property
    def saturated(self) -> bool:
        return self._kind == "saturated"

    def _first_gap_ns(self) -> int:
        """A CBR source starts at a random phase of its interval; a saturated one at once."""
        if self._kind == "cbr":
            return int(self._random.random() * self._interval_ns) // US * US
        return 0 if self.saturated else self._poisson_ns()

    def _poisson_ns(self) -> int:
        return round(self._random.expovariate(1 / self._interval_ns)) // US * US

    def start(self, now_ns: int) -> None:
        """What should have been born before now never was: the process has only just been started."""
        if self._next_ns is None or now_ns <= self._next_ns:
            return
        if self.saturated:
            self._next_ns = now_ns
            return
        while self._next_ns < min(now_ns, self._end_ns):
            self.advance()

    @property
    def owed(self) -> int:
        """How many packets are born at `next_ns`."""
        return self._owed

    def next_ns(self) -> int | None:
        """When the next packet is born; None when there will be none (or, saturated, none by itself)."""
        if self._next_ns is None or self._next_ns >= self._end_ns:
            return None
        return self._next_ns

    def advance(self) -> None:
        """The packet of `next_ns` was sent."""
        assert self._next_ns is not None, "only a source that has a next packet can send it"
        if self.saturated:
            self._next_ns, self._owed = None, 0  # from here on, one packet for each that ends
        else:
            self._next_ns += self._interval_ns if self._kind == "cbr" else self._poisson_ns()

    def ended(self, *, refused: bool, now_ns: int) -> bool:
        """A packet of a saturated source has left, or was given up; True: the next one follows at once.

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
    """One node's source of packets whose content does not matter."""

    name: Final = "traffic"

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._traffic = Traffic(scenario, node)
        self._destination = BROADCAST if scenario.traffic.destination == "all" else NodeId(scenario.traffic.destination)
        self._filler = wire.filler(scenario.traffic.payload_bytes - wire.HEADER_BYTES, node=node)
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
        if self._traffic.ended(refused=status.fate is Fate.TURNED_AWAY, now_ns=now_ns):
            self._send(now_ns)

    def report(self) -> Mapping[str, Any]:
        return {"generated": self._generated}

    def _send(self, born_ns: int) -> None:
        self._generated += 1
        self.port.send(self._filler, destination=self._destination, priority=wire.PRIORITY_BULK, born_ns=born_ns)

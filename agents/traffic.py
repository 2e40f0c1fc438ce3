"""The application load of one node: when it hands its node the next packet, and of what size.

Birth instants are whole microseconds, because that is what the header carries.
"""

import math
from collections.abc import Sequence
from random import Random
from typing import Final

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US, NodeId, S

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

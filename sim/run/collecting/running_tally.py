"""What a run in real time has achieved so far, from the trace records as they come in.

A packet counts when it is ripe: no copy of it can come any more, or a quarter of the run has passed since. Afterwards
it is forgotten, so memory does not grow with the run. The figures of the result are computed from the whole trace.
"""

from collections import Counter, deque
from collections.abc import Iterable
from typing import Final, NamedTuple

from agents.applications.traffic import targets_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, Delivered, Generated, Record, Refuted
from fanet_mw.wire import PRIORITY_BULK
from sim.observation.observer import Observer
from sim.results.mission import Confirmations
from sim.world.environment.survivors import place

_RIPE_SHARE: Final = 4
"""A short run does not wait for a whole lifetime before it says what was delivered."""
_PARTS: Final = 3
"""The share is counted anew so many times until a packet is ripe."""


class Progress(NamedTuple):
    """The state of a swarm that runs, for those who watch it."""

    swarm_s: float
    duration_s: float
    time_scale: float
    """The pace of the swarm's time: 1 is real time."""
    delivered: float | None
    """The share of the traffic's copies that arrived, of packets that are ripe; None: there are none yet."""
    late: float | None
    """The share of frames that were announced too late; None in virtual time, where none is."""
    confirmed: int | None
    """None: not counted."""
    without_phone: int
    """The persons who were found otherwise than by a phone."""
    survivors: int
    """Of the scenario; 0: nobody is searched for."""

    def in_words(self) -> str:
        """All but the time, in words."""
        parts = [f"clock {self.time_scale:.3g}" if self.late is not None else f"{self.time_scale:.3g} x real time"]
        if self.delivered is not None:
            parts.append(f"delivered {self.delivered:.1%}")
        if self.late is not None:
            parts.append(f"late {self.late:.2%}")
        if self.survivors and self.confirmed is not None:
            parts.append(f"confirmed {self.confirmed} of {self.survivors}")
        if self.without_phone:
            parts.append(f"{self.without_phone} more without a phone")
        return ", ".join(parts)

    def sentence(self) -> str:
        return f"{self.swarm_s:.0f} of {self.duration_s:g} s: {self.in_words()}"


class RunningTally(Observer):
    """What of the first class of traffic was delivered, and the survivors confirmed near their true places."""

    def __init__(self, scenario: Scenario) -> None:
        self._traffic = next(iter(scenario.traffic_classes))
        lifetime_ns = scenario.routing.lifetime_ns(PRIORITY_BULK)
        self._ripe_ns = min(lifetime_ns, scenario.duration_ns // _RIPE_SHARE)
        self._targets = {node: frozenset(targets_of(scenario, node)) for node in scenario.node_ids}
        self._sent: dict[tuple[int, int], int] = {}
        """The instant of each packet that is not ripe, by origin and number."""
        self._copies: deque[Counter[tuple[int, int]]] = deque([Counter()], maxlen=_PARTS + 2)
        """The copies that came in each part of the time until a packet is ripe, the latest last."""
        self._latest_ns = self._since_ns = 0
        self._wanted = self._delivered = 0
        self._confirmations = Confirmations(place(scenario))
        self.confirmed: set[int] = set()
        """The survivors whose phones were confirmed, as the summary counts them."""
        self.without_phone: set[int] = set()
        """The other survivors who were found as persons."""

    def take_records(self, records: Iterable[Record]) -> None:
        """Count records of one process, in the order in which it made them."""
        for record in records:
            match record:
                case Delivered():
                    if record.node in self._targets.get(record.origin, ()):
                        self._copies[-1][record.origin, record.seq] += 1
                    self._latest_ns = max(self._latest_ns, record.t_ns)
                case Generated(app=self._traffic):
                    self._sent[record.node, record.seq] = record.t_ns
                    self._latest_ns = max(self._latest_ns, record.t_ns)
                case Confirmed() | Refuted():
                    self._confirmations.add(record)
                    self.confirmed = {one.survivor for one in self._confirmations.right()}
                    self.without_phone = self._confirmations.found_ns().keys() - self.confirmed
                case _:
                    pass
        self._forget()

    def _forget(self) -> None:
        """Count what is ripe, and forget the copies of packets that are ripe by now."""
        if self._latest_ns < self._since_ns + self._ripe_ns // _PARTS:
            return
        for key in [key for key, t_ns in self._sent.items() if t_ns <= self._latest_ns - self._ripe_ns]:
            del self._sent[key]
            wanted = len(self._targets[key[0]])
            self._wanted += wanted
            self._delivered += min(wanted, sum(copies[key] for copies in self._copies))
        self._copies.append(Counter())
        self._since_ns = self._latest_ns

    def delivered_share(self) -> float | None:
        """The share of the copies of ripe packets that arrived; None while there are none."""
        return self._delivered / self._wanted if self._wanted else None

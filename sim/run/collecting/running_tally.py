"""What a run in real time has achieved so far, from the trace records as they come in.

A packet counts when it is `_RIPE_NS` old, because its copies take some seconds to arrive. Afterwards it is forgotten,
so memory does not grow with the run. The figures of the result are computed from the whole trace.
"""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from agents.applications.traffic import targets_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, Delivered, Generated, Record, Refuted
from fanet_mw.units import S

_RIPE_NS: Final = 10 * S


class RunningTally:
    """The share of the first class of traffic that was delivered, and the survivors that were confirmed."""

    def __init__(self, scenario: Scenario) -> None:
        self._traffic = next(iter(scenario.traffic_classes))
        self._targets = {node: len(targets_of(scenario, node)) for node in scenario.node_ids}
        self._sent: dict[tuple[int, int], int] = {}
        """The instant of each packet that is not ripe, by origin and number."""
        self._copies: Counter[tuple[int, int]] = Counter()
        self._older_copies: Counter[tuple[int, int]] = Counter()
        self._latest_ns = self._since_ns = 0
        self._wanted = self._delivered = 0
        self.confirmed: set[int] = set()

    def take(self, records: Iterable[Record]) -> None:
        """Count records of one process, in the order in which it made them."""
        for record in records:
            match record:
                case Delivered():
                    self._copies[record.origin, record.seq] += 1
                case Generated(app=self._traffic):
                    self._sent[record.node, record.seq] = record.t_ns
                    self._latest_ns = max(self._latest_ns, record.t_ns)
                case Confirmed():
                    self.confirmed.add(record.survivor)
                case Refuted():
                    self.confirmed.discard(record.survivor)
                case _:
                    pass
        self._forget()

    def _forget(self) -> None:
        """Count what is ripe, and forget the copies of packets that are ripe by now."""
        if self._latest_ns < self._since_ns + _RIPE_NS:
            return
        for key in [key for key, t_ns in self._sent.items() if t_ns <= self._latest_ns - _RIPE_NS]:
            del self._sent[key]
            wanted = self._targets[key[0]]
            self._wanted += wanted
            self._delivered += min(wanted, self._copies[key] + self._older_copies[key])
        self._older_copies, self._copies = self._copies, Counter()
        self._since_ns = self._latest_ns

    def delivered_share(self) -> float | None:
        """The share of the copies of ripe packets that arrived; None while there are none."""
        return self._delivered / self._wanted if self._wanted else None

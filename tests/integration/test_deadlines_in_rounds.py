"""Deadlines of messages in rounds: what travels in turns is held against the bound, bulk, which has none, is not."""

import pytest

from fanet_mw.application import Application, Data, Fate, Status
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_REPORT
from sim.run.virtual import Observed
from sim.scenarios import catalog


class Sender(Application):
    """Sends one message with a deadline, and keeps what became of it."""

    name = "sender"
    follows = (Fate.ADMITTED, Fate.REFUSED)

    def __init__(self, priority: int, deadline_ns: int) -> None:
        self._priority, self._deadline_ns = priority, deadline_ns
        self._due_ns: int | None = 8 * S
        self.fates: list[tuple[Fate, int | None]] = []

    def wake(self, now_ns: int) -> None:
        if self._due_ns is not None and now_ns >= self._due_ns:
            self._due_ns = None
            content = Data(9, b"x")
            self.port.send(content, destination=NodeId(3), priority=self._priority, deadline_ns=self._deadline_ns)

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def on_status(self, status: Status, now_ns: int) -> None:
        self.fates.append((status.fate, status.interval_ns))


@pytest.mark.parametrize(
    ("priority", "deadline_ns", "fate"),
    [
        (PRIORITY_REPORT, 5 * S, Fate.ADMITTED),
        (PRIORITY_REPORT, 1 * MS, Fate.REFUSED),
        (PRIORITY_BULK, 1 * MS, Fate.ADMITTED),
    ],
)
def test_a_deadline_is_held_against_the_bound_of_its_own_priority(priority: int, deadline_ns: int, fate: Fate) -> None:
    scenario = catalog.find("quick", ["routing.protocol=rounds", "duration_s=10", "traffic.arrivals=none"])
    sender = Sender(priority, deadline_ns)
    observed = Observed(scenario, applications=lambda node: [sender] if node == 1 else [])
    observed.host.start()
    observed.host.run(9 * S)
    assert [got for got, _ in sender.fates] == [fate]

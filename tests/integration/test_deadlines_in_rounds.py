"""Deadlines of messages in rounds: what travels in turns is held against the bound, bulk, which has none, is not."""

import pytest

from fanet_mw.application import Application, Data, Fate, Status
from fanet_mw.units import BROADCAST, MS, NodeId, S
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


class Burst(Application):
    """Sends bulk to all ten times a second from 6 s on, and keeps what became of it."""

    name = "burst"
    follows = (Fate.ADMITTED, Fate.REFUSED)

    def __init__(self) -> None:
        self._due_ns = 6 * S
        self.told: list[Status] = []

    def wake(self, now_ns: int) -> None:
        if now_ns >= self._due_ns:
            self._due_ns += S // 10
            self.port.send(Data(9, b"x" * 400), destination=NodeId(BROADCAST), priority=PRIORITY_BULK)

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def on_status(self, status: Status, now_ns: int) -> None:
        self.told.append(status)


@pytest.mark.slow
def test_whose_bulk_is_refused_is_told_so_and_no_interval_that_is_for_reports() -> None:
    load = ["traffic.arrivals=cbr", "traffic.interval_s=0.02", "traffic.payload_bytes=1000", "traffic.deadline_s=1"]
    burst = Burst()
    scenario = catalog.find("quick", ["routing.protocol=rounds", "duration_s=11", *load])
    observed = Observed(scenario, applications=lambda node: [burst] if node == 1 else [])
    observed.host.start()
    observed.host.run(9 * S)
    refused = [status for status in burst.told if status.fate is Fate.REFUSED]
    assert refused
    assert {status.interval_ns for status in refused} == {None}

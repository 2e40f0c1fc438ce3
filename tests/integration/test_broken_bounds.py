"""Whole runs whose nodes promise too little, on purpose: the summary counts what was broken, and by how much."""

from collections.abc import Callable
from typing import Any

import pytest

from fanet_mw.routing.clustered.timetable.stated_delays import StatedDelays
from fanet_mw.trace import BoundStated
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

LINE = ['nodes.layout="line"', "nodes.count=5", "clusters.count=4", "traffic.sources=4", "traffic.interval_s=0.25"]
TIMES = ["duration_s=16", "warmup_s=10", "clusters.flooding_period_s=0.2"]


def run(monkeypatch: pytest.MonkeyPatch, promise: Callable[[int], int]) -> dict[str, Any]:
    """`promise`: what a node says instead of its bound."""
    honest = StatedDelays.state

    def too_little(self: StatedDelays, *given: Any, **instants: int) -> None:
        honest(self, *given, **instants)
        records = self._port.records
        if isinstance(records[-1], BoundStated):
            records[-1] = records[-1]._replace(bound_ns=promise(records[-1].bound_ns))

    monkeypatch.setattr(StatedDelays, "state", too_little)
    return finish(simulate(catalog.find("clusters", [*LINE, *TIMES])), out=None)


def test_bounds_that_are_stated_too_low_are_broken_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = run(monkeypatch, lambda ns: ns)
    bound, slowest_ms = honest["bound"], honest["delay_ms"]["max"]
    assert (bound["violations"], bound["within_share"]) == (0, 1.0)
    assert 0.8 < slowest_ms / bound["worst_ms"] <= 1, "nearly reached"
    share = 0.99 * slowest_ms / bound["worst_ms"]
    low = run(monkeypatch, lambda ns: int(share * ns))["bound"]
    assert 0 < low["violations"] < low["deliveries"] / 10, "a hundredth below the slowest"
    assert low["observed_max_ms"] == slowest_ms
    none = run(monkeypatch, lambda _: 1)["bound"]
    assert none["violations"] == none["deliveries"] == bound["deliveries"] > 100
    assert none["within_share"] == 0

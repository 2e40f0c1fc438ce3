"""Packets for a neighbor: one frame each, and soon, whatever relays floods."""

from functools import lru_cache
from typing import Any

import pytest
from kit import slow

from fanet_mw.application import Application, Data
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

GRID = ["nodes.count=12", "clusters.count=11", "duration_s=16", "warmup_s=11", "drain_s=1", "traffic.payload_bytes=900"]
TO_ONE = ["traffic.destination=6", "traffic.sources=[5,7]", "traffic.interval_s=0.05"]


@lru_cache
def summary_of(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*GRID, *settings])), out=None)


@pytest.mark.parametrize(("relay", "p50_ms", "worst_ms"), [("counter", 2, 30), *slow(("scheduled", 10, 60))])
def test_a_packet_for_a_neighbor_is_one_frame_and_does_not_wait(relay: str, p50_ms: float, worst_ms: float) -> None:
    chosen = f"clusters.relay={relay}"
    silent, found = summary_of(chosen, "traffic.sources=0", "traffic.arrivals=none"), summary_of(chosen, *TO_ONE)
    assert found["pdr"] == 1.0
    assert found["frames"]["sent"] - silent["frames"]["sent"] <= 1.2 * found["generated"]
    assert found["delay_ms"]["p50"] < p50_ms
    assert found["delay_ms"]["max"] < worst_ms
    if relay == "scheduled":
        assert found["bound"]["stated_share"] == found["bound"]["within_share"] == 1.0


def test_a_packet_for_a_node_five_hops_away_is_five_frames() -> None:
    """The first are flooded; then the receiver has shown the way to itself."""
    far = ("traffic.destination=12", "traffic.sources=[1]", "traffic.interval_s=0.05")
    silent, found = (
        summary_of("clusters.relay=counter", "traffic.sources=0", "traffic.arrivals=none"),
        summary_of("clusters.relay=counter", *far),
    )
    assert found["pdr"] == 1.0
    assert found["frames"]["sent"] - silent["frames"]["sent"] <= 6.5 * found["generated"]
    assert found["delay_ms"]["p50"] < 15


class Courier(Application):
    """Node 2 sends a long message to all."""

    name, ports = "courier", (1,)

    def __init__(self, node: int, *, confirm: bool) -> None:
        self._due_ns = 11 * S if node == 2 else None
        self._confirm = confirm

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> None:
        self._due_ns = None
        self.port.send(Data(1, bytes(12_000)), confirm=self._confirm, lifetime_ns=30 * S)


@pytest.mark.parametrize("relay", [*slow("counter"), "scheduled"])
def test_a_message_that_all_confirm_takes_less_than_twice_the_frames(relay: str) -> None:
    scenario = catalog.find(
        "clusters", [*GRID, f"clusters.relay={relay}", "traffic.sources=0", "traffic.arrivals=none", "duration_s=24"]
    )

    def frames(*, confirm: bool | None) -> int:
        outcome = simulate(
            scenario, applications=lambda node: [] if confirm is None else [Courier(node, confirm=confirm)]
        )
        return int(finish(outcome, out=None)["frames"]["sent"])

    silent = frames(confirm=None)
    assert frames(confirm=True) - silent < 2 * (frames(confirm=False) - silent)

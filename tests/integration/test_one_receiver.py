"""Packets for a neighbor: one frame each, and soon, whatever relays floods."""

from typing import Any

import pytest

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

GRID = ["nodes.count=12", "clusters.count=11", "duration_s=16", "warmup_s=11", "drain_s=1", "traffic.payload_bytes=900"]
TO_ONE = ["traffic.destination=6", "traffic.sources=[5,7]", "traffic.interval_s=0.05"]


def summary_of(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*GRID, *settings])), out=None)


@pytest.mark.parametrize(("relay", "p50_ms", "worst_ms"), [("counter", 2, 30), ("scheduled", 10, 60)])
def test_a_packet_for_a_neighbor_is_one_frame_and_does_not_wait(relay: str, p50_ms: float, worst_ms: float) -> None:
    chosen = f"clusters.relay={relay}"
    silent, found = summary_of(chosen, "traffic.sources=0", "traffic.arrivals=none"), summary_of(chosen, *TO_ONE)
    assert found["pdr"] == 1.0
    assert found["frames"]["sent"] - silent["frames"]["sent"] <= 1.2 * found["generated"]
    assert found["delay_ms"]["p50"] < p50_ms
    assert found["delay_ms"]["max"] < worst_ms
    if relay == "scheduled":
        assert found["bound"]["stated_share"] == found["bound"]["within_share"] == 1.0

"""Whole swarms with several packets in a frame: as much arrives, by fewer frames."""

from typing import Any

import pytest

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

SHORT = ["duration_s=15", "warmup_s=12", "drain_s=1"]


def summary_of(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*SHORT, "clusters.flooding_period_s=1", *settings])), out=None)


@pytest.mark.slow
def test_heads_that_release_small_packets_together_need_half_the_frames() -> None:
    small = ["traffic.payload_bytes=64", "traffic.interval_s=0.2", "clusters.count=8", "duration_s=14"]
    one_by_one, together = (summary_of("clusters.relay=all", f"routing.aggregate={on}", *small) for on in (False, True))
    assert together["frames"]["sent"] < one_by_one["frames"]["sent"] / 2
    assert together["delay_ms"]["p50"] < one_by_one["delay_ms"]["p50"]
    assert together["frames"]["closes"]

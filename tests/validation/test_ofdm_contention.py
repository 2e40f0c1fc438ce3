"""Saturated unicast at OFDM rates against closed forms: one sender exactly, several by Bianchi (JSAC 18(3), 2000).

54 Mb/s, ACK 24 Mb/s, 1024 bytes of UDP payload: 184 us and 28 us, 6 us more each at 2.4 GHz.
"""

from typing import Any

import pytest
from medium_driver import contention, disc
from reference import bianchi

from fanet_mw.units import NodeId

A = {"standard": "a"}
G = {"standard": "g"}
G_SHORT = {"standard": "g", "slot": "short"}


@pytest.mark.parametrize(
    ("radio", "cycle_us"),
    [
        (A, 34 + 7.5 * 9 + 184 + 16 + 28),
        (G, 50 + 7.5 * 20 + 190 + 10 + 34),
        (G_SHORT, 28 + 7.5 * 9 + 190 + 10 + 34),
    ],
)  # DIFS, mean backoff, frame, SIFS, ACK
def test_one_sender_gets_the_channel_less_its_overhead(radio: dict[str, Any], cycle_us: float) -> None:
    air = contention(
        [(0, 0), (10, 0)], interval_s=0.0002, sources=[1], dst=NodeId(2), duration_s=3, warmup_s=0.5,
        lifetime_ms=1e6, **radio,
    )["air"]  # fmt: skip
    assert air["throughput_mbps"] == pytest.approx(8 * 1024 / cycle_us, rel=0.005)
    assert air["mean_retries"] == 0


@pytest.mark.parametrize("count", [3, 10, 25])
def test_several_share_it_as_bianchi_says(count: int) -> None:
    """Fewer attempts fail than in the model, by 0.02: who has collided waits 45 us for the ACK, five slots that it does
    not know of, while the others already count down."""
    mbps, failure = bianchi(
        count, success_us=184 + 16 + 28 + 34, collision_us=184 + 34, payload_bytes=1024, window=16, slot_us=9
    )
    air = contention(
        disc(count, radius_m=20), interval_s=0.0003 * count, sources=range(1, count + 1), dst=None, duration_s=5,
        warmup_s=1, lifetime_ms=1e6, **A,
    )["air"]  # fmt: skip
    assert air["throughput_mbps"] == pytest.approx(mbps, rel=0.05)
    assert air["attempt_failure"] == pytest.approx(failure, abs=0.03)

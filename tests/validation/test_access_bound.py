"""The bound on access to the head, against the emulator: bursts of acknowledged unicasts from all members at once."""

import pytest
from access_bound import ContendingTraffic, access_bound
from medium_driver import disc, medium, poses

from fanet_mw.airtime import DETECT_NS, OVERHEAD_BYTES, airtime_ns
from fanet_mw.bounds import Bounded, Dcf, Refused
from fanet_mw.bus.messages import TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Radio
from fanet_mw.units import MS, US, NodeId, S

HEAD = NodeId(1)
AIRTIME_NS = airtime_ns(1024 + OVERHEAD_BYTES, Radio(), rate_mbps=11)


def outcomes(stations: int, *, seed: int, frames_each: int = 1, size: int = 1024, **radio: object) -> list[TxStatus]:
    """Every member queues its frames for the head at the same instant, 1 s; all statuses."""
    air = medium(stations, seed=seed, lifetime_ms=60_000, **radio)
    topics = Topics("v")
    air.start(0)
    air.receive(topics.pose, poses(disc(stations, radius_m=60)), 0)
    for node in range(2, stations + 1):
        for seq in range(frames_each):
            request = TxRequest(seq, S, bytes(size), HEAD, wants_status=True)
            air.receive(topics.radio_tx(node), request, S)
    while (wake_ns := air.next_wake_ns()) is not None and wake_ns < 9 * S:
        air.wake(wake_ns)
    return [message for _, message in air.outbox if type(message) is TxStatus]


def test_the_defaults_are_those_of_the_reference_radio() -> None:
    assert Dcf() == Dcf.of(Radio())
    assert Dcf().slot_ns > DETECT_NS, "a backoff slot that is cut short costs at most itself"


@pytest.mark.parametrize("access", ["standard", "ns3"])
@pytest.mark.parametrize(("stations", "frames_each"), [(2, 1), (5, 3), (12, 1), (24, 2)])
def test_no_unicast_takes_longer_than_its_bound(access: str, stations: int, frames_each: int) -> None:
    bound = access_bound(
        Dcf(), AIRTIME_NS, ContendingTraffic(stations, AIRTIME_NS, frames_each, own_frames=frames_each)
    )
    assert isinstance(bound, Bounded)
    worst = 0
    for seed in range(15):
        found = outcomes(stations, seed=seed, frames_each=frames_each, access=access)
        assert len(found) == (stations - 1) * frames_each
        assert {status.outcome for status in found} <= {TxOutcome.ACKED, TxOutcome.RETRY_LIMIT}
        worst = max(worst, max(status.end_ns for status in found) - S)
    assert worst <= bound.delay_ns


def test_with_backoffs_of_fixed_size_the_bound_of_a_lone_station_is_near() -> None:
    """One sender whose head is out of range makes all attempts: DIFS against EIFS and draws differ."""
    air = medium(2, cw_min=1, cw_max=1, lifetime_ms=60_000)
    topics = Topics("v")
    air.start(0)
    air.receive(topics.pose, poses([(0.0, 0.0), (900.0, 0.0)]), 0)
    air.receive(topics.radio_tx(2), TxRequest(0, S, bytes(1024), HEAD, wants_status=True), S)
    while (wake_ns := air.next_wake_ns()) is not None and wake_ns < 9 * S:
        air.wake(wake_ns)
    (status,) = [message for _, message in air.outbox if type(message) is TxStatus]
    bound = access_bound(Dcf(cw_min=1, cw_max=1), AIRTIME_NS, ContendingTraffic(1, AIRTIME_NS))
    assert isinstance(bound, Bounded)
    assert status.outcome is TxOutcome.RETRY_LIMIT
    assert 0 <= bound.delay_ns - (status.end_ns - S) <= (7 * (364 - 50 + 20) + 50) * US


def test_a_window_that_is_too_short_is_refused_with_both_lengths() -> None:
    found = access_bound(Dcf(), 1 * MS, ContendingTraffic(10, 1 * MS), window_ns=20 * MS)
    assert isinstance(found, Refused)
    assert "20000000 ns" in found.reason

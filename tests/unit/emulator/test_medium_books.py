"""What the medium counts, by hand: air statistics over the measured time, lateness, what it holds of each node."""

from collections.abc import Callable

import pytest
from hand_driven import NAMES, Air, receptions, statuses

from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from fanet_mw.airtime import Timing
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, S

MakeScenario = Callable[..., Scenario]
FRAME_NS = 984 * US


def test_air_statistics_are_of_the_time_between_warm_up_and_drain(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 4, "warmup_s": 1, "drain_s": 1, "duration_s": 10})
    start_ns, end_ns = scenario.traffic_window_ns
    air = Air(scenario, [0, 100, 200, 9000])
    within = [start_ns + 100 * MS, start_ns + 200 * MS, start_ns + 300 * MS]
    for at_ns in (start_ns - 100 * MS, *within, end_ns + 1 * MS):
        air.send(1, at_ns, now_ns=max(0, at_ns - 1 * MS))
    air.run(until_ns=10 * S)
    said = air.medium.report()["air"]
    span_ns = end_ns - start_ns
    assert said["throughput_mbps"] == pytest.approx(3 * 8 * 1024 / (span_ns / S) / 1e6, rel=1e-3)
    assert said["busy"] == pytest.approx(3 * 3 * FRAME_NS / (4 * span_ns), rel=0.01), "three of four sense each frame"
    assert said["pdr"] == 1.0


def test_a_medium_is_busy_until_the_last_of_overlapping_signals_ends(make_scenario: MakeScenario) -> None:
    """Node 2 senses both hidden ones, one after the other begun: 300 us and a frame; each of them itself alone."""
    air = Air(make_scenario(**{"nodes.count": 3, "duration_s": 10}), [0, 200, 400])
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + 300 * US)
    air.run(until_ns=10 * S)
    expected_ns = (FRAME_NS + 300 * US) + 2 * FRAME_NS
    assert air.medium.report()["air"]["busy"] == pytest.approx(expected_ns / (3 * 10 * S), abs=1e-6)


def test_attempts_that_fail_and_retries_are_counted(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "duration_s": 10, "warmup_s": 0}), [0, 400])
    air.send(1, 1 * MS, dst=2)
    air.run(until_ns=500 * MS)
    air.place([0, 100], 500 * MS)
    air.send(1, 600 * MS, dst=2, now_ns=500 * MS)
    air.run(until_ns=10 * S)
    said = air.medium.report()["air"]
    assert said["attempt_failure"] == pytest.approx(7 / 8, abs=1e-6)
    assert said["mean_retries"] == 3.0, "six of the first, none of the second"


def test_what_failed_before_the_warm_up_was_over_is_not_counted(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "duration_s": 10, "warmup_s": 1}), [0, 400])
    air.send(1, 1 * MS, dst=2)
    air.run(until_ns=500 * MS)
    air.place([0, 100], 500 * MS)
    air.send(1, 2 * S, dst=2, now_ns=500 * MS)
    air.run(until_ns=10 * S)
    said = air.medium.report()["air"]
    assert (said["attempt_failure"], said["mean_retries"], said["pdr"]) == (0.0, 0.0, 1.0)


def test_requests_in_time_count_for_the_percentiles_of_lateness(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    for number in range(100):
        at_ns = (10 + 2 * number) * MS
        air.send(1, at_ns, now_ns=at_ns + (8 * MS if number >= 98 else 0))
    air.run()
    late = air.medium.report()["late"]
    percentiles = {"p50_ms": 0.0, "p99_ms": 10.0, "max_ms": 8.0}
    assert (
        late == {"late_frames": 2, "frames": 100, "close_frames": 98, "late_moments": 1, "sum_ms": 16.0} | percentiles
    )


def test_requests_in_the_last_quarter_of_their_lead_and_moments_with_late_ones_are_counted(
    make_scenario: MakeScenario,
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.lead_ms": 40.0, "time_scale": 2.0}), [0, 100])
    for ahead_ms in (40, 10, 9, 0):
        air.send(1, (100 + ahead_ms) * MS, now_ns=100 * MS)
    for at_ms in (200, 249, 250, 251, 300):  # a moment is 50 ms long at twice real time
        air.send(1, (at_ms - 1) * MS, now_ns=at_ms * MS)
    late = air.medium.report()["late"]
    assert (late["close_frames"], late["late_frames"], late["late_moments"]) == (2, 5, 3)


def test_what_a_node_may_announce_is_bounded_and_what_has_ended_makes_room(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.queue_frames": 1}), [0, 100])
    for number in range(1100):
        air.send(1, (1000 + 2 * number) * MS, payload=bytes(20))
    assert air.medium.report()["frames"]["dropped"] == {"backlog": 1100 - 1025}
    air.run(until_ns=4 * S)
    air.send(1, 5 * S, now_ns=4 * S, payload=bytes(20))
    air.run(until_ns=6 * S)
    frames = air.medium.report()["frames"]
    assert frames == {"sent": 1101, "delivered": 1026, "in_flight": 0, "dropped": {"backlog": 75}}


def test_a_node_that_starts_again_has_lost_nothing_on_the_bus(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 1 * MS)
    air.send(1, 3 * MS)
    air._seq[1] = 0
    air.send(1, 5 * MS)
    air.run()
    assert air.medium.report()["frames"] == {"sent": 3, "delivered": 3, "in_flight": 0, "dropped": {}}


def test_a_number_that_makes_no_sense_shows_no_lost_requests(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    for at_ms, number in enumerate((7, 5, 1 << 31, (1 << 32) - 1, 0, 2), start=1):
        air._seq[1] = number
        air.send(1, at_ms * 2 * MS)
    air.run()
    assert air.medium.report()["frames"] == {"sent": 7, "delivered": 6, "in_flight": 0, "dropped": {"bus": 1}}


def test_a_driver_hands_receptions_over_in_batches(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.handover_ms": 5}), [0, 100])
    air.send(1, 1 * MS)
    air.send(1, 2 * MS)
    heard = []
    while (wake_ns := air.medium.next_wake_ns()) is not None:
        air.medium.wake(wake_ns)
        heard += [(wake_ns, m.end_ns) for _, m in air.medium.outbox if isinstance(m, Reception)]
        air.medium.outbox.clear()
        if wake_ns > 20 * MS:
            break
    assert [told_ns for told_ns, _ in heard] == [5 * MS, 5 * MS]
    assert heard[0][1] == 1 * MS + FRAME_NS + 334, "stamped when it ended, whenever it was told"


def test_a_reception_says_its_power_in_dbm(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2})
    air = Air(scenario, [0, 100])
    air.send(1, 1 * MS)
    (reception,) = [h.message for h in air.run() if isinstance(h.message, Reception)]
    assert reception.rssi_dbm == pytest.approx(scenario.radio.tx_power_dbm, abs=0.002)


def test_a_status_is_for_who_asked_for_it(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    for seq, asks in enumerate((True, False)):
        request = TxRequest(seq, (1 + 2 * seq) * MS, bytes(50), BROADCAST, wants_status=asks)
        air.medium.receive(NAMES.radio_tx(1), request, 0)
    assert [h.message.seq for h in air.run() if isinstance(h.message, TxStatus)] == [0]


def test_a_unicast_that_always_collided_was_given_up(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3, "radio.max_attempts": 1}), [0, 200, 400])
    air.send(1, 1 * MS, dst=2)
    air.send(3, 1 * MS + 500 * US)
    heard = air.run()
    assert receptions(heard) == []
    assert (1, TxOutcome.RETRY_LIMIT) in [(node, outcome) for node, outcome, _, _ in statuses(heard)]
    assert air.medium.report()["frames"]["dropped"] == {"collision": 1, "retry_limit": 1}


@pytest.mark.parametrize("standard", ["b", "g", "a"])
@pytest.mark.parametrize("apart_m", [8_000.0, 40_000.0, 600_000.0])
def test_every_frame_to_a_far_station_ends_before_the_next_one_begins(
    make_scenario: MakeScenario, standard: str, apart_m: float
) -> None:
    """A link carries one frame at a time, so delays of DIFS or more are shortened to less than that."""
    keys = {"radio.standard": standard, "radio.range_m": 1e6, "radio.cw_min": 1}
    if standard == "g":
        keys["radio.slot"] = "short"
    scenario = make_scenario(**{"nodes.count": 2, "duration_s": 10, **keys})
    timing = Timing.of(scenario.radio)
    air = Air(scenario, [0, apart_m])
    for _ in range(50):
        air.send(1, 1 * MS, payload=bytes(16))
    heard = air.run(until_ns=1 * S)
    said = air.medium.report()
    assert said["frames"] == {"sent": 50, "delivered": 50, "in_flight": 0, "dropped": {}}
    assert said["copies"] == {"on_air": 50, "received": 50, "lost": {}, "in_flight": 0}
    sent_ns = [end_ns for _, _, end_ns, _ in statuses(heard)]
    true_ns = round(apart_m / SPEED_OF_LIGHT_M_S * 1e9)
    assert {end_ns - at_ns for (_, _, end_ns), at_ns in zip(receptions(heard), sent_ns, strict=True)} == {
        min(true_ns, timing.difs_ns - 1)
    }

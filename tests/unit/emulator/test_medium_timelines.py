"""The air, computed by hand to the microsecond: DSSS 11 Mb/s, long preamble, 1024 B payload = 984 us, ACK 203 us."""

from array import array
from collections.abc import Callable
from typing import Any

import pytest
from hand_driven import NAMES, PAYLOAD, Air, receptions, statuses

from emulator.late_requests import LateRequests
from fanet_mw.airtime import frame_ns
from fanet_mw.bus.messages import Obstructions, Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, S

FRAME_NS, ACK_NS, DIFS_NS, SIFS_NS, SLOT_NS = 984 * US, 203 * US, 50 * US, 10 * US, 20 * US
MakeScenario = Callable[..., Scenario]


@pytest.fixture(params=["ns3", "standard"])
def access(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_airtimes_are_the_standards() -> None:
    assert frame_ns(1088, rate_mbps=11, short=False) == FRAME_NS
    assert frame_ns(14, rate_mbps=11, short=False) == ACK_NS
    assert frame_ns(14, rate_mbps=1, short=False) == (192 + 112) * US
    assert frame_ns(1088, rate_mbps=5.5, short=True) == (96 + 1583) * US
    assert frame_ns(100, rate_mbps=1, short=True) == (192 + 800) * US, "1 Mb/s knows no short preamble"


@pytest.mark.parametrize("access", ["ns3", ["difs"]])
def test_a_lone_broadcast_waits_one_difs_as_ns3_has_it(make_scenario: MakeScenario, access: str | list[str]) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.access": access}), [0, 200])
    air.send(1, 1 * MS)
    assert receptions(air.run()) == [(2, 1, 1 * MS + DIFS_NS + FRAME_NS + 667)]


@pytest.mark.parametrize("access", ["standard", [], ["eifs", "sums", "onset"]])
def test_a_lone_broadcast_on_a_long_idle_medium_goes_at_once_as_the_standard_has_it(
    make_scenario: MakeScenario, access: str | list[str]
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.access": access}), [0, 200])
    air.send(1, 1 * MS)
    assert receptions(air.run()) == [(2, 1, 1 * MS + FRAME_NS + 667)]


def test_unicast_is_acknowledged_after_sifs(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 150])
    air.send(1, 1 * MS, dst=2)
    heard = air.run()
    there_ns = 1 * MS + FRAME_NS + 500
    assert receptions(heard) == [(2, 1, there_ns)]
    assert statuses(heard) == [(1, TxOutcome.ACKED, there_ns + SIFS_NS + ACK_NS + 500, 1)]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_relay_that_owes_an_ack_draws_no_backoff_as_ns3_has_it(make_scenario: MakeScenario, seed: int) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.access": "ns3", "seed": seed}), [0, 150])
    air.send(1, 1 * MS, dst=2)
    there_ns = 1 * MS + DIFS_NS + FRAME_NS + 500
    air.run(until_ns=there_ns)
    air.send(2, there_ns, now_ns=there_ns)
    back_ns = there_ns + SIFS_NS + ACK_NS + DIFS_NS + FRAME_NS + 500
    assert receptions(air.run()) == [(1, 2, back_ns)]


def test_unicast_to_a_station_out_of_range_is_given_up_after_seven_attempts(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 400])
    air.send(1, 1 * MS, dst=2)
    ((node, outcome, _, attempts),) = statuses(air.run())
    assert (node, outcome, attempts) == (1, TxOutcome.RETRY_LIMIT, 7)
    assert air.medium.report()["frames"]["dropped"] == {"no_receiver": 1}


def test_a_frame_queued_during_anothers_difs_collides_as_ns3_has_it(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3, "radio.access": "ns3"}), [0, 100, 200])
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + 2 * US)
    assert receptions(air.run()) == []
    report = air.medium.report()
    assert report["frames"]["dropped"] == {"collision": 2}
    assert report["copies"] == {"on_air": 4, "received": 0, "lost": {"collision": 2, "half_duplex": 2}, "in_flight": 0}


def test_a_frame_queued_while_the_medium_is_busy_waits_for_it_difs_and_its_backoff(
    make_scenario: MakeScenario, access: str
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.access": access}), [0, 150])
    air.send(1, 1 * MS)
    air.send(2, 1 * MS + 300 * US)
    first, second = receptions(air.run())
    backoff_ns = second[2] - first[2] - DIFS_NS - FRAME_NS - 500
    assert backoff_ns % SLOT_NS == 0
    assert 0 <= backoff_ns <= 31 * SLOT_NS


def test_after_its_own_frame_a_station_waits_for_one_that_is_still_on_the_air(make_scenario: MakeScenario) -> None:
    """Both begin at once; the short frame takes 312 us, the long one 984."""
    air = Air(make_scenario(**{"nodes.count": 2, "radio.cw_min": 1, "radio.access": "standard"}), [0, 200])
    air.send(1, 1 * MS, payload=bytes(100))
    air.send(1, 1 * MS, payload=bytes(100))
    air.send(2, 1 * MS)
    (_, _, first_ns, _), (_, _, long_ns, _), (_, _, second_ns, _) = statuses(air.run())
    assert (first_ns, long_ns) == (1 * MS + 312 * US, 1 * MS + FRAME_NS)
    idle_ns = long_ns + 667
    assert second_ns - 312 * US - idle_ns in (DIFS_NS, DIFS_NS + SLOT_NS)
    assert air.medium.report()["air"]["busy"] == pytest.approx((984 + 312) * US / S, rel=0.01), "at both stations"


def test_a_frame_whose_ack_does_not_come_is_not_repeated_while_another_is_on_the_air(
    make_scenario: MakeScenario,
) -> None:
    keys = {"nodes.count": 3, "radio.cw_min": 1, "radio.max_attempts": 2, "radio.access": "standard"}
    air = Air(make_scenario(**keys), [0, 200, -900])
    air.send(1, 1 * MS, dst=3, payload=bytes(100))
    air.send(2, 1 * MS)
    found = {node: (end_ns, attempts) for node, _, end_ns, attempts in statuses(air.run())}
    end_ns, attempts = found[1]
    assert attempts == 2
    began_ns = end_ns - 312 * US - (10 + 20 + 192) * US  # the frame, and the wait for its ACK
    waited_ns = began_ns - (found[2][0] + 667) - DIFS_NS
    assert 0 <= waited_ns <= 3 * SLOT_NS


def test_a_backoff_freezes_while_the_medium_is_busy(make_scenario: MakeScenario) -> None:
    """Three stations queue while a fourth transmits: later backoffs go on where they stood, none starts anew."""
    air = Air(make_scenario(**{"nodes.count": 4, "seed": 3}), [0, 1, 2, 3])
    air.send(1, 1 * MS)
    for node in (2, 3, 4):
        air.send(node, 1 * MS + 300 * US)
    ends = [end for receiver, _, end in receptions(air.run()) if receiver == 1]
    first_end = 1 * MS + FRAME_NS
    gaps = [later - earlier - FRAME_NS - DIFS_NS for earlier, later in zip([first_end, *ends], ends, strict=False)]
    assert sum(gaps) <= 31 * SLOT_NS + 100, "all counted the same idle slots"
    assert all(gap >= -100 for gap in gaps)


def test_hidden_terminals_collide_in_the_middle_and_do_not_hear_each_other(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 200, 400])
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + 500 * US)
    assert receptions(air.run()) == []


def test_a_colliding_pair_backs_off_and_both_arrive(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 200, 400])
    air.send(1, 1 * MS, dst=2)
    air.send(3, 1 * MS, dst=2)
    heard = air.run()
    assert sorted(outcome for _, outcome, _, _ in statuses(heard)) == [TxOutcome.ACKED] * 2
    assert sorted((receiver, src) for receiver, src, _ in receptions(heard)) == [(2, 1), (2, 3)]
    assert max(attempts for *_, attempts in statuses(heard)) > 1


def test_a_station_that_moves_out_of_range_in_mid_frame_still_gets_that_frame_and_not_the_next(
    make_scenario: MakeScenario,
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 200])
    air.send(1, 1 * MS)
    air.place([0, 900], 1 * MS + 500 * US)
    air.send(1, 5 * MS, now_ns=2 * MS)
    assert receptions(air.run()) == [(2, 1, 1 * MS + FRAME_NS + 667)]


def test_the_queue_limit_and_the_lifetime_drop_with_their_reasons(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.queue_frames": 5, "radio.lifetime_ms": 3}), [0, 100])
    for _ in range(8):
        air.send(1, 1 * MS)
    dropped = air.run() and air.medium.report()["frames"]["dropped"]
    assert dropped["mac_queue_full"] == 3
    assert dropped["mac_lifetime"] >= 2


def test_a_frame_that_waits_beyond_its_own_end_is_dropped_and_the_next_one_goes(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 50])
    air.send(3, 1 * MS)
    air.send(1, 1 * MS + 100 * US, until_ns=1 * MS + FRAME_NS)
    air.send(1, 1 * MS + 200 * US, until_ns=9 * MS)
    heard = air.run()
    assert [outcome for node, outcome, _, _ in statuses(heard) if node == 1] == [TxOutcome.LIFETIME, TxOutcome.SENT]
    assert air.medium.report()["frames"]["dropped"] == {"mac_lifetime": 1}


def test_however_late_a_request_is_it_counts_by_its_lateness() -> None:
    late = LateRequests(time_scale=1.0)
    for late_ms in (0.05, 3, 700, 5000):
        assert late.is_too_late(round(late_ms * MS), now_ns=0) == (late_ms > 50)
    assert [late.report(requests)["p50_ms"] for requests in (4, 8)] == [5.0, 0.0]
    assert [late.report(requests)["p99_ms"] for requests in (4, 100, 400)] == [5000.0, 1000.0, 0.0]


def test_late_requests_are_counted_and_very_late_ones_dropped(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 8 * MS, now_ns=10 * MS)
    air.send(1, 10 * MS, now_ns=70 * MS)
    heard = air.run()
    report = air.medium.report()
    assert report["late"]["late_frames"] == 2
    assert report["frames"]["dropped"] == {"late": 1}
    assert [outcome for _, outcome, _, _ in statuses(heard)] == [TxOutcome.LATE, TxOutcome.SENT]


@pytest.mark.parametrize(
    "wrong", [{"dst": 77}, {"payload": bytes(5000)}, {"payload": b""}, {"at_ns": 2**62}],
    ids=["no such node", "too long", "empty", "absurd instant"],
)  # fmt: skip
def test_a_request_that_can_never_be_sent_is_refused_not_called_late(
    make_scenario: MakeScenario, wrong: dict[str, Any]
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, **{"at_ns": 1 * MS, **wrong})
    assert [outcome for _, outcome, _, _ in statuses(air.run())] == [TxOutcome.REFUSED]


def test_hostile_requests_are_counted_and_never_raised(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 1 * MS, dst=77)
    air.send(1, 1 * MS, payload=bytes(5000))
    air.send(1, 1 * MS, payload=b"")
    air.send(1, 2**62)
    request = TxRequest(0, 0, PAYLOAD, BROADCAST, wants_status=False)
    for topic in (NAMES.radio_tx(9), NAMES.radio_tx("x"), "nonsense", NAMES.radio_tx(0)):
        air.medium.receive(topic, request, 0)
    air.medium.receive(NAMES.pose, Poses(0, array("H", [1, 2]), array("d", [0.0] * 6)), 0)
    air.medium.receive(NAMES.pose, Poses(0, array("H", [1]), array("d", [float("nan")] * 6)), 0)
    air.medium.receive(NAMES.radio_tx(1), TxStatus(0, TxOutcome.SENT, 0, 0), 0)
    assert receptions(air.run()) == []
    report = air.medium.report()
    assert report["frames"]["dropped"] == {"malformed": 2, "no_receiver": 1, "too_large": 1}
    assert report["refused"] == {"message_type": 1, "poses": 2, "unknown_station": 4}


def test_a_gap_in_a_nodes_sequence_is_frames_that_the_bus_lost(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 1 * MS)
    air._seq[1] += 3
    air.send(1, 3 * MS)
    air.run()
    report = air.medium.report()
    assert report["frames"] == {"sent": 5, "delivered": 2, "in_flight": 0, "dropped": {"bus": 3}}
    assert report["requests"] == {"1": {"all": 5, "before_restart": 0}, "2": {"all": 0, "before_restart": 0}}


def test_a_node_that_starts_again_is_counted_in_both_its_lives(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    for t_ns in (1 * MS, 3 * MS, 5 * MS):
        air.send(1, t_ns)
    air._seq[1] = 0
    air.send(1, 7 * MS)
    air.run()
    assert air.medium.report()["requests"]["1"] == {"all": 4, "before_restart": 3}


@pytest.mark.parametrize(("standard", "reached_m", "missed_m"), [("b", 2900, 3100), ("a", 1300, 1400)])
def test_an_ack_over_more_than_a_slot_of_way_there_and_back_comes_too_late(
    make_scenario: MakeScenario, standard: str, reached_m: float, missed_m: float
) -> None:
    for metres, attempts in ((reached_m, 1), (missed_m, 7)):
        air = Air(make_scenario(**{"nodes.count": 2, "radio.standard": standard, "radio.range_m": 5000}), [0, metres])
        air.send(1, 1 * MS, dst=2)
        assert [tried for *_, tried in statuses(air.run())] == [attempts]


@pytest.mark.parametrize(("losses_ddb", "lost_db"), [([], 12.0), ([73], 7.3), ([250], 25.0)])
def test_a_pair_that_something_parts_is_weaker_by_the_loss_that_the_world_says_or_the_scenario_s(
    make_scenario: MakeScenario, losses_ddb: list[int], lost_db: float
) -> None:
    keys = {"nodes.count": 3, "radio.channel": "friis", "radio.obstruction_loss_db": 12}
    rssi_dbm = []
    for parted in (False, True):
        air = Air(make_scenario(**keys), [0.0, 60.0, -60.0])
        if parted:
            obstructions = Obstructions(0, array("H", [1, 2]), array("H", losses_ddb))
            air.medium.receive(NAMES.obstruction, obstructions, 0)
            air.place([0.0, 60.0, -60.0], 0)
        air.send(1, 5 * MS)
        heard = {h.node: h.message for h in air.run() if isinstance(h.message, Reception)}
        rssi_dbm.append((heard[2].rssi_dbm, heard[3].rssi_dbm))
    (before, other), (after, other_after) = rssi_dbm
    assert before - after == pytest.approx(lost_db, abs=1e-6)
    assert other == other_after

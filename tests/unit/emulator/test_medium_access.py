"""When a station may send, to the microsecond: EIFS, virtual carrier sense, backoffs and windows (802.11-2020, 10.3).

DSSS 11 Mb/s, long preamble: 1024 B last 984 us, an ACK 203 us, an ACK at 1 Mb/s 304 us. Where the instant of a backoff
is to be known, it is a whole number of slots behind the instant from which slots count: that tells one from another.
"""

from collections.abc import Callable
from itertools import pairwise

import pytest
from hand_driven import NAMES, Air, receptions, statuses

from fanet_mw.bus.messages import TxOutcome
from fanet_mw.bus.radio_control import Degrade
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US, NodeId

FRAME_NS, ACK_NS, DIFS_NS, SIFS_NS, SLOT_NS = 984 * US, 203 * US, 50 * US, 10 * US, 20 * US
EIFS_NS = SIFS_NS + 304 * US + DIFS_NS
TIMEOUT_NS = SIFS_NS + SLOT_NS + 192 * US
SHORT = bytes(100)
SHORT_NS = (192 + 120) * US
"""100 B and 64 of headers at 11 Mb/s."""
MakeScenario = Callable[..., Scenario]


@pytest.fixture(params=["ns3", "standard"])
def access(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def slots_behind(start_ns: int, from_ns: int) -> int:
    """Backoff slots between two instants, which must be whole."""
    slots, rest_ns = divmod(start_ns - from_ns, SLOT_NS)
    assert rest_ns == 0, f"{start_ns} ns is not whole slots behind {from_ns} ns"
    return slots


# --- EIFS ---------------------------------------------------------------------------------------------------------


def middle_of_two_hidden(scenario: Scenario, places_m: list[float]) -> Air:
    """Node 1 sends a long frame; node 3, which does not hear it, a short one into it: node 2 decodes neither."""
    air = Air(scenario, places_m)
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + 200 * US, payload=SHORT)
    return air


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_after_a_frame_that_cannot_be_decoded_a_station_waits_for_eifs(
    make_scenario: MakeScenario, access: str, seed: int
) -> None:
    keys = {"nodes.count": 3, "radio.access": access, "seed": seed}
    air = middle_of_two_hidden(make_scenario(**keys), [0, 200, 400])
    air.send(2, 1 * MS + 500 * US)
    ends = {(node, src): end_ns for node, src, end_ns in receptions(air.run())}
    first_ns = 1 * MS + (DIFS_NS if access == "ns3" else 0)
    idle_ns = first_ns + FRAME_NS + 667
    assert 0 <= slots_behind(ends[1, 2] - FRAME_NS - 667, idle_ns + EIFS_NS) <= 31


def test_a_frame_that_is_decoded_ends_the_wait_for_eifs(make_scenario: MakeScenario) -> None:
    """Node 4 hears node 3 only. What it sends 60 us after the bad frame comes through: from there DIFS is enough."""
    air = middle_of_two_hidden(make_scenario(**{"nodes.count": 4}), [0, 240, 480, 400])
    air.send(2, 1 * MS + 500 * US)
    air.send(4, 2 * MS + 50 * US, payload=SHORT)
    ends = {(node, src): end_ns for node, src, end_ns in receptions(air.run())}
    whole_ns = 2 * MS + 50 * US + SHORT_NS + 534
    assert ends[2, 4] == whole_ns
    assert 0 <= slots_behind(ends[1, 2] - FRAME_NS - 801, whole_ns + DIFS_NS) <= 31


# --- virtual carrier sense ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("queued_us", [1500, 2100])
def test_who_hears_a_unicast_but_not_its_ack_keeps_silent_for_the_ack(
    make_scenario: MakeScenario, access: str, queued_us: int
) -> None:
    """Node 2 acknowledges to node 1; node 3 hears node 1 alone, and queues during the frame or during the ACK."""
    drawn = set()
    for seed in range(1, 7):
        keys = {"nodes.count": 3, "radio.access": access, "seed": seed}
        air = Air(make_scenario(**keys), [0, -200, 200])
        air.send(1, 1 * MS, dst=2)
        air.send(3, queued_us * US)
        heard = air.run()
        sent_ns = 1 * MS + (DIFS_NS if access == "ns3" else 0)
        reserved_ns = sent_ns + FRAME_NS + 667 + SIFS_NS + ACK_NS
        assert statuses(heard)[0][:3] == (1, TxOutcome.ACKED, reserved_ns + 667)
        (end_ns,) = (end_ns for node, src, end_ns in receptions(heard) if (node, src) == (1, 3))
        drawn.add(slots_behind(end_ns - FRAME_NS - 667, reserved_ns + DIFS_NS))
    assert len(drawn) > 2, "who waits draws a backoff"
    assert 0 <= min(drawn) <= max(drawn) <= 31


# --- backoffs -----------------------------------------------------------------------------------------------------


def backoffs_of_broadcasts(scenario: Scenario, count: int) -> list[int]:
    """Slots before each of so many broadcasts in a row, but the first."""
    air = Air(scenario, [0, 150])
    for _ in range(count):
        air.send(1, 1 * MS, payload=SHORT)
    ends = [end_ns for _, _, end_ns in receptions(air.run())]
    assert len(ends) == count
    return [slots_behind(b - SHORT_NS, a + DIFS_NS) for a, b in pairwise(ends)]


def test_backoffs_are_uniform_over_the_contention_window(make_scenario: MakeScenario, access: str) -> None:
    slots = backoffs_of_broadcasts(make_scenario(**{"nodes.count": 2, "radio.access": access}), 300)
    assert min(slots) == 0
    assert max(slots) == 31
    assert 14 < sum(slots) / len(slots) < 17


def test_stations_draw_apart(make_scenario: MakeScenario) -> None:
    """Two that find the medium busy at the same time do not go on to collide again and again."""
    air = Air(make_scenario(**{"nodes.count": 3, "radio.queue_frames": 100}), [0, 10, 20])
    air.send(3, 1 * MS)
    for _ in range(40):
        air.send(1, 1 * MS + 100 * US, payload=SHORT)
        air.send(2, 1 * MS + 100 * US, payload=SHORT)
    air.run()
    assert air.medium.report()["frames"]["delivered"] > 70


@pytest.mark.parametrize(
    ("queued_ns", "idle_from_ns"),
    [
        (1 * MS + FRAME_NS + 500 + 20 * US, 1 * MS + FRAME_NS + 500),  # idle, but not yet for DIFS
        (1 * MS + 500 + 4 * US, 1 * MS + FRAME_NS + 500),  # the very instant at which the medium is sensed busy
    ],
)
def test_who_does_not_find_the_medium_idle_for_difs_draws_a_backoff(
    make_scenario: MakeScenario, queued_ns: int, idle_from_ns: int
) -> None:
    drawn = set()
    for seed in range(1, 9):
        air = Air(make_scenario(**{"nodes.count": 2, "seed": seed}), [0, 150])
        air.send(1, 1 * MS)
        air.send(2, queued_ns)
        ends = {src: end_ns for _, src, end_ns in receptions(air.run())}
        drawn.add(slots_behind(ends[2] - FRAME_NS - 500, idle_from_ns + DIFS_NS))
    assert len(drawn) > 3, "with each seed another one"
    assert 0 <= min(drawn) <= max(drawn) <= 31


def test_a_slot_that_is_interrupted_is_counted_again_when_the_medium_is_idle(make_scenario: MakeScenario) -> None:
    """Node 3 begins in the second slot of node 2's backoff: one slot has passed."""
    first_ns = 1 * MS + FRAME_NS + 500 + DIFS_NS
    compared = 0
    for seed in range(1, 9):
        begins_ns = []
        for interrupted in (False, True):
            air = Air(make_scenario(**{"nodes.count": 3, "radio.access": "standard", "seed": seed}), [0, 150, 150])
            air.send(1, 1 * MS)
            air.send(2, 1 * MS + 300 * US)
            if interrupted:
                air.send(3, first_ns + 30 * US, payload=SHORT)
            begins_ns += [end_ns - FRAME_NS for node, _, end_ns, _ in statuses(air.run()) if node == 2]
        slots = slots_behind(begins_ns[0], first_ns)
        if slots > 2:
            compared += 1
            assert slots_behind(begins_ns[1], first_ns + 30 * US + SHORT_NS + DIFS_NS) == slots - 1
    assert compared > 4


@pytest.mark.parametrize(("later_ns", "outcome"), [(0, TxOutcome.LIFETIME), (1, TxOutcome.SENT)])
def test_a_frame_may_begin_before_its_end_and_not_at_it(
    make_scenario: MakeScenario, later_ns: int, outcome: TxOutcome
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.access": "ns3"}), [0, 150])
    air.send(1, 1 * MS, until_ns=1 * MS + DIFS_NS + later_ns)
    assert [found for _, found, _, _ in statuses(air.run())] == [outcome]


# --- attempts and windows -----------------------------------------------------------------------------------------


def slots_of_attempts(scenario: Scenario, attempts: int) -> int:
    """Slots of all backoffs of a unicast that nobody acknowledges."""
    air = Air(scenario, [0, 400])
    air.send(1, 1 * MS, dst=2)
    ((_, outcome, end_ns, made),) = statuses(air.run())
    assert (outcome, made) == (TxOutcome.RETRY_LIMIT, attempts)
    return slots_behind(end_ns, 1 * MS + attempts * (FRAME_NS + TIMEOUT_NS) + (attempts - 1) * DIFS_NS)


def test_the_window_doubles_after_a_failure_up_to_its_bound(make_scenario: MakeScenario) -> None:
    def slots(attempts: int, cw_max: int) -> list[int]:
        keys = {"nodes.count": 2, "radio.max_attempts": attempts, "radio.cw_max": cw_max}
        return [slots_of_attempts(make_scenario(**keys, seed=seed), attempts) for seed in range(1, 31)]

    assert slots(1, 1023) == [0] * 30
    second = slots(2, 1023)
    assert 31 < max(second) <= 63
    assert max(slots(4, 63)) <= 3 * 63
    assert 63 + 127 < max(slots(4, 1023)) <= 63 + 127 + 255


@pytest.mark.parametrize("comes_back_ms", [None, 4])
def test_the_window_is_the_least_again_after_an_ack_and_after_giving_up(
    make_scenario: MakeScenario, comes_back_ms: int | None
) -> None:
    """The receiver is out of reach, and stays so, or comes back after some attempts; then a broadcast follows."""
    drawn = []
    for seed in range(1, 13):
        air = Air(make_scenario(**{"nodes.count": 3, "radio.max_attempts": 6, "seed": seed}), [0, 400, 150])
        air.send(1, 1 * MS, dst=2)
        air.send(1, 1 * MS, payload=SHORT)
        if comes_back_ms is not None:
            air.run(until_ns=comes_back_ms * MS)
            air.place([0, 150, 150], comes_back_ms * MS)
        heard = air.run()
        ended_ns = {outcome: end_ns for _, outcome, end_ns, _ in statuses(heard)}
        outcome = TxOutcome.RETRY_LIMIT if comes_back_ms is None else TxOutcome.ACKED
        end_ns = max(end_ns for node, _, end_ns in receptions(heard) if node == 3)
        drawn.append(slots_behind(end_ns - 500 - SHORT_NS, ended_ns[outcome] + DIFS_NS))
    assert max(drawn) <= 31
    assert len(set(drawn)) > 3, "what follows a frame of our own waits for a backoff"


def test_as_ns3_has_it_the_window_outlives_the_frame_and_is_the_least_again_one_failure_later(
    make_scenario: MakeScenario,
) -> None:
    """Three attempts fail: 63, 127, 255 slots. A broadcast and the next unicast are drawn from the last window; the
    first failure of that unicast, the fourth in a row, resets it: 31 and 63 slots.
    """
    after_failures, later = [], []
    for seed in range(1, 25):
        keys = {"nodes.count": 3, "radio.max_attempts": 3, "radio.access": ["window"], "seed": seed}
        air = Air(make_scenario(**keys), [0, 400, 150])
        air.send(1, 1 * MS, dst=2)
        air.send(1, 1 * MS, payload=SHORT)
        air.send(1, 1 * MS, dst=2)
        first_ns, short_ns, last_ns = [end_ns for _, _, end_ns, _ in statuses(air.run())]
        after_failures.append(slots_behind(short_ns - SHORT_NS, first_ns + DIFS_NS))
        later.append(slots_behind(last_ns, short_ns + 3 * (DIFS_NS + FRAME_NS + TIMEOUT_NS)))
    assert 127 < max(after_failures) <= 255
    assert 127 < max(later) <= 255 + 31 + 63


def test_an_ack_for_another_is_none_for_us(make_scenario: MakeScenario) -> None:
    """Node 1 asks node 2, who is not there; node 3 acknowledges to node 4 just then, heard by node 1, as node 4 is not.

    log_distance, sensitivity -79.5 dBm: 207 m. Node 4 begins first, 12 m from node 3, and node 1 does not disturb it.
    """
    keys = {"nodes.count": 4, "radio.channel": "log_distance", "radio.sensitivity_dbm": -79.5, "radio.max_attempts": 1}
    air = Air(make_scenario(**keys), [0, 9000, 200, 212])
    air.send(4, 1 * MS, dst=3)
    air.send(1, 1 * MS + 5 * US, dst=2)
    assert {node: outcome for node, outcome, _, _ in statuses(air.run())} == {
        4: TxOutcome.ACKED,
        1: TxOutcome.RETRY_LIMIT,
    }


def test_a_unicast_whose_acks_are_lost_is_repeated_and_handed_up_once(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 150])
    loss = Degrade("acks", NodeId(2), NodeId(1), both=False, loss_db=0.0, loss_share=1.0)
    air.medium.receive(NAMES.radio_control, loss, 0)
    air.send(1, 1 * MS, dst=2)
    heard = air.run()
    assert [(node, src) for node, src, _ in receptions(heard)] == [(2, 1)]
    assert [(outcome, attempts) for _, outcome, _, attempts in statuses(heard)] == [(TxOutcome.RETRY_LIMIT, 7)]
    assert air.medium.report()["frames"] == {"sent": 1, "delivered": 1, "in_flight": 0, "dropped": {}}


def test_who_acknowledges_loses_what_it_has_begun_to_receive(make_scenario: MakeScenario) -> None:
    """Node 3, which node 1 does not hear, begins 2 us behind a unicast to node 2: its preamble is found before SIFS."""
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 200, 400])
    air.send(1, 1 * MS, dst=2)
    air.send(3, 1 * MS + FRAME_NS + 2 * US)
    heard = air.run()
    assert (1, TxOutcome.ACKED) in [(node, outcome) for node, outcome, _, _ in statuses(heard)]
    assert [(node, src) for node, src, _ in receptions(heard)] == [(2, 1)]
    assert air.medium.report()["copies"]["lost"] == {"half_duplex": 1}

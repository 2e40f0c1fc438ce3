"""What a timetable is computed for: how far interference reaches, how long a hop takes, and one node's view of it."""

from collections.abc import Callable

import pytest

from fanet_mw.routing.clustered.tdma.turn_timing import Turns, turn_ns, turn_slack_ns
from fanet_mw.routing.clustered.timetable.interference import InterferenceByDistance
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.routing.clustered.timetable.turn_size import links, superframe
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.units import MS, US, Enu, NodeId

MakeScenario = Callable[..., Scenario]
KEYS = {"clusters.relay": "scheduled", "nodes.count": 5}


def test_a_turn_holds_difs_the_longest_backoff_the_frame_and_the_slack(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**KEYS, **{"clusters.turn_slack_us": 100})
    assert turn_ns(scenario, payload_bytes=1024) == (50 + 31 * 20 + 984 + 100) * US


@pytest.mark.parametrize(("error_us", "fits"), [(40, True), (41, False)])
def test_the_slack_of_a_turn_holds_two_clocks_that_are_wrong_and_the_flight(
    make_scenario: MakeScenario, error_us: int, fits: bool
) -> None:
    """100 us: 20 us of flight, and one clock early by 40 us while another is as late."""
    scenario = make_scenario(**KEYS, **{"clusters.turn_slack_us": 100})
    assert clocks_fit(scenario.clock, slack_ns=turn_slack_ns(scenario), clock_error_ns=error_us * US) == fits


@pytest.mark.parametrize(
    ("sync", "error_us", "fits"), [("beacons", 19_999, True), ("beacons", 20_000, False), ("none", 20_000, True)]
)
def test_an_error_that_hellos_cut_may_be_any_and_fits_no_slack(
    make_scenario: MakeScenario, sync: str, error_us: int, fits: bool
) -> None:
    """Hellos state 20 ms of every error that is greater, too; of clocks left alone the bound itself is known."""
    scenario = make_scenario(**KEYS, **{"clock.sync": sync, "clock.offset_ms": 20, "clusters.turn_slack_us": 60_000})
    assert clocks_fit(scenario.clock, slack_ns=turn_slack_ns(scenario), clock_error_ns=error_us * US) == fits


def test_interference_reaches_twice_as_far_as_reception_where_it_is_a_matter_of_power(
    make_scenario: MakeScenario,
) -> None:
    scenario = make_scenario(**KEYS, **{"radio.channel": "log_distance"})
    assert links(scenario, superframe(scenario)).interference_m == 2 * scenario.radio.range_m


@pytest.mark.parametrize(
    ("sigma_m", "bias_m", "margin_m"),
    [(0, 0, 1.5), (1.5, 0, 1.5 + 4 * 2**0.5 * 1.5), (30, 0, 1.5 + 4 * 2**0.5 * 5), (3, 4, 1.5 + 4 * 2**0.5 * 5)],
)
def test_with_a_range_interference_reaches_that_far_and_by_errors_of_gps_farther(
    make_scenario: MakeScenario, sigma_m: float, bias_m: float, margin_m: float
) -> None:
    errors = {"world.gps_sigma_m": sigma_m, "sensors.gps_bias_m": bias_m}
    scenario = make_scenario(**KEYS, **errors)
    margin = links(scenario, superframe(scenario)).interference_m - scenario.radio.range_m
    assert margin == pytest.approx(margin_m)


@pytest.mark.parametrize(("channel", "heard"), [("range", 0b110), ("log_distance", 0)])
def test_the_post_disturbs_as_much_farther_as_its_antenna_reaches_and_with_a_range_is_heard_so_far(
    make_scenario: MakeScenario, channel: str, heard: int
) -> None:
    keys = {"nodes.count": 2, "ground.at_m": [0, 0], "ground.gain_dbi": 12.1, "radio.channel": channel}
    scenario = make_scenario(**keys)  # as far as four times the range
    swarm = InterferenceByDistance(
        ((NodeId(1), Enu(-900, 0, 0)), (NodeId(2), Enu(900, 0, 0)), (NodeId(3), Enu(0, 0, 0))),
        links(scenario, superframe(scenario))._replace(interference_m=255.0),
    )
    assert swarm.disturbs == (0b100, 0b100, 0b011)
    assert swarm.hears[0] == swarm.hears[1] == heard & 0b100


def test_a_hop_takes_the_turns_of_lead_and_handover(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**KEYS, **{"radio.lead_ms": 10, "radio.handover_ms": 20})
    turns = superframe(scenario)
    assert links(scenario, turns).hop_turns == 1 + -(-30 * MS // turns.turn_ns)


def test_a_turn_beyond_the_superframe_is_heard_in_the_next_one() -> None:
    turns = Turns(0, 100 * MS, 40 * MS, 2 * MS, 29)
    table = Timetable((Turn(28, NodeId(1), NodeId(1), 0), Turn(30, NodeId(2), NodeId(1), 0)), {}, {}, 2)
    plan = NodeTimetable.of(
        NodeId(3), 0, FittedTimetable(turns, table, together=1, frame_bytes=1024, whole=True, enough=True)
    )
    assert plan.heard == {(28, 1): (28, 1, 0), (1, 2): (30, 1, 0)}

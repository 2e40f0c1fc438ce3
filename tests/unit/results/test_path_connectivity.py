"""What share of the time distances leave a way open, by which results of any protocol are bounded."""

import pytest
from kit import MakeScenario

from fanet_mw.trace import Posed, ProcessEnded, ProcessStarted
from fanet_mw.units import S
from sim.results.links_over_time import LinksOverTime, connectivity
from sim.results.outcome import Outcome


@pytest.mark.parametrize(("spacing_m", "share"), [(240, 1.0), (260, 0.0)])
@pytest.mark.parametrize("window_s", [0.4, 5])
def test_at_rest_a_row_is_connected_always_or_never_however_short_the_window(
    make_scenario: MakeScenario, spacing_m: float, share: float, window_s: float
) -> None:
    keys = {"nodes.count": 3, "nodes.spacing_m": spacing_m, "nodes.layout": "line", "radio.range_m": 250}
    window = {"warmup_s": 1.1, "drain_s": 1, "duration_s": 2.1 + window_s}
    assert connectivity(make_scenario(**keys, **window)) == share


def test_who_never_says_where_it_is_stays_where_it_was_put(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 3, "nodes.spacing_m": 240, "nodes.layout": "line", "radio.range_m": 250}
    links = LinksOverTime(Outcome(make_scenario(**keys), "virtual", 1.0, [], {}))
    assert links.at(0).tolist() == [[True, True, False], [True, True, True], [False, True, True]]
    assert links.at(0) is links.at(0)


def test_who_is_in_reach_at_an_instant_has_a_link_in_the_seconds_before_and_after_it(
    make_scenario: MakeScenario,
) -> None:
    keys = {"nodes.count": 2, "nodes.spacing_m": 900, "nodes.layout": "line", "radio.range_m": 250}
    records = [Posed(second * S, 2, -250.0 if second == 2 else 450.0, 0.0, 50.0) for second in (1, 2, 3)]
    links = LinksOverTime(Outcome(make_scenario(**keys), "virtual", 1.0, records, {}))
    assert [bool(links.at(second)[0, 1]) for second in range(4)] == [False, True, True, False]


def test_the_post_on_the_ground_is_as_far_in_reach_as_its_antenna_makes_it(make_scenario: MakeScenario) -> None:
    """A gain of 20 dBi makes a reach of 250 m ten times as long."""
    keys = {"nodes.count": 2, "nodes.spacing_m": 900, "nodes.layout": "line", "radio.range_m": 250}
    for gain_dbi, reached in ((0, [False, False]), (20, [True, True])):
        scenario = make_scenario(**keys, **{"ground.at_m": [0, 2400], "ground.gain_dbi": gain_dbi})
        linked = LinksOverTime(Outcome(scenario, "virtual", 1.0, [], {})).at(0)
        assert linked[2, :2].tolist() == linked[:2, 2].tolist() == reached
        assert not linked[0, 1], "UAVs have no antenna of that kind"


@pytest.mark.parametrize(("gain_dbi", "share"), [(0, 0.0), (20, 1.0)])
def test_the_post_on_the_ground_is_a_target_and_passes_on(
    make_scenario: MakeScenario, gain_dbi: float, share: float
) -> None:
    keys = {"nodes.count": 2, "nodes.spacing_m": 900, "nodes.layout": "line", "radio.range_m": 250}
    ground = {"ground.at_m": [0, 2400], "ground.gain_dbi": gain_dbi}
    assert connectivity(make_scenario(**keys, **ground, **{"traffic.sources": [1]})) == share


def test_who_was_started_again_has_links_again(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 2, "nodes.spacing_m": 240, "nodes.layout": "line", "radio.range_m": 250}
    records = [ProcessEnded(2 * S, 2, "agent-2", -9), ProcessStarted(5 * S, 2, "agent-2")]
    links = LinksOverTime(Outcome(make_scenario(**keys), "virtual", 1.0, records, {}))
    assert [bool(links.at(second)[0, 1]) for second in (1, 3, 6)] == [True, False, True]


@pytest.mark.parametrize(("sources", "to", "share"), [([1], 2, 1.0), ([1], 3, 0.0), ([1, 3], 2, 0.5), ([2, 3], 1, 0.5)])
def test_pairs_are_those_of_the_traffic(make_scenario: MakeScenario, sources: list[int], to: int, share: float) -> None:
    """Two stand together, and one is far away."""
    keys = {"nodes.count": 3, "nodes.layout": "explicit", "nodes.positions_m": [[0, 0, 50], [100, 0, 50], [900, 0, 50]]}
    traffic = {"traffic.sources": sources, "traffic.destination": to, "radio.range_m": 250}
    assert connectivity(make_scenario(**keys, **traffic)) == share

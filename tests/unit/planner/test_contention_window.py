"""Hellos and the window in which they contend."""

import pytest

from fanet_mw.graph.topology import within_range
from fanet_mw.routing.clustered.tdma.hello_room import crowd, hellos_ns
from fanet_mw.units import MS, Enu, NodeId
from sim.planner.problems_and_notes import too_short
from sim.scenarios import catalog
from sim.world.environment.layout import positions

LINE = within_range({NodeId(i): Enu(200.0 * i, 0.0, 0.0) for i in range(1, 8)}, range_m=250)


def test_those_within_two_hops_count_with_what_each_says_in_a_superframe() -> None:
    """Five nodes, one hello each although two fall due, or half a one: 137 + 64 bytes at 11 Mb/s, the preamble, DIFS,
    and a mean backoff of 7 / 2 slots.
    """
    for hello_s, each in ((1, 1), (4, 0.5)):
        scenario = catalog.find("clusters", ["clusters.flooding_period_s=2", f"routing.hello_interval_s={hello_s}"])
        assert hellos_ns(scenario, crowd(LINE)) == pytest.approx(5 * each * (192 + 147 + 50 + 70) * 1000, rel=0.01)


@pytest.mark.parametrize(("rate_mbps", "fits"), [(1, False), (11, True)])
def test_a_window_that_is_too_short_is_told_with_what_it_needs(rate_mbps: float, *, fits: bool) -> None:
    keys = ["clusters.flooding_period_s=4", "clusters.contention_ms=20", "radio.cw_min=1"]
    scenario = catalog.find("clusters", [*keys, f"radio.rate_mbps={rate_mbps}"])
    places = dict(zip(scenario.node_ids, positions(scenario), strict=True))
    adjacency = within_range(places, range_m=scenario.radio.range_m)
    said = list(too_short(scenario, adjacency))
    assert (not said) == fits
    assert fits or ("contention window of 20 ms" in said[0] and hellos_ns(scenario, crowd(adjacency)) > 15 * MS)


@pytest.mark.parametrize(("contention_ms", "fits"), [(5, False), (5.2, False), (6, True)])
def test_hellos_that_fit_by_their_airtime_need_time_in_which_to_begin(contention_ms: float, *, fits: bool) -> None:
    """They take 0.6 ms. In the last 5 ms of a window none begins, so in the first one all would begin at once."""
    keys = ["clusters.flooding_period_s=0.25", "routing.hello_interval_s=1", f"clusters.contention_ms={contention_ms}"]
    scenario = catalog.find("clusters", keys)
    assert hellos_ns(scenario, crowd(LINE)) < 0.6 * MS
    said = list(too_short(scenario, LINE))
    assert (not said) == fits
    assert fits or "which has to be at least 6" in said[0]

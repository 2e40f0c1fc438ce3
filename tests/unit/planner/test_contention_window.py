"""Hellos and the window in which they contend."""

import pytest
from kit import slow

from fanet_mw.graph.topology import within_range
from fanet_mw.units import MS, Enu, NodeId
from fanet_mw.wire.hello.claims import MESSAGE_BYTES
from sim.planner.answer import judge
from sim.planner.contention_window import claimed_hellos_ns, hellos_ns, too_short, too_short_for_claims
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.layout import positions

LINE = within_range({NodeId(i): Enu(200.0 * i, 0.0, 0.0) for i in range(1, 8)}, range_m=250)


def test_those_within_two_hops_count_with_what_each_says_in_a_superframe() -> None:
    """Five nodes, two hellos each: 137 + 64 bytes at 11 Mb/s and the preamble, DIFS, a mean backoff of 7 / 2 slots."""
    scenario = catalog.find("clusters", ["clusters.flooding_period_s=2", "routing.hello_interval_s=1"])
    assert hellos_ns(scenario, LINE) == pytest.approx(5 * 2 * (192 + 147 + 50 + 70) * 1000, rel=0.01)


@pytest.mark.parametrize(("hello_s", "fits"), [(1.0, False), (2.0, True)])
def test_a_window_that_is_too_short_is_told_with_what_it_needs(hello_s: float, *, fits: bool) -> None:
    keys = ["clusters.flooding_period_s=4", "clusters.contention_ms=20", "radio.cw_min=1"]
    scenario = catalog.find("clusters", [*keys, f"routing.hello_interval_s={hello_s}"])
    places = dict(zip(scenario.node_ids, positions(scenario), strict=True))
    adjacency = within_range(places, range_m=scenario.radio.range_m)
    said = list(too_short(scenario, adjacency))
    assert (not said) == fits
    assert fits or ("contention window of 20 ms" in said[0] and hellos_ns(scenario, adjacency) > 15 * MS)


@pytest.mark.parametrize(("contention_ms", "fits"), [(5, False), (5.2, False), (6, True)])
def test_hellos_that_fit_by_their_airtime_need_time_in_which_to_begin(contention_ms: float, *, fits: bool) -> None:
    """They take 0.6 ms. In the last 5 ms of a window none begins, so in the first one all would begin at once."""
    keys = ["clusters.flooding_period_s=0.25", "routing.hello_interval_s=1", f"clusters.contention_ms={contention_ms}"]
    scenario = catalog.find("clusters", keys)
    assert hellos_ns(scenario, LINE) < 0.6 * MS
    said = list(too_short(scenario, LINE))
    assert (not said) == fits
    assert fits or "which has to be at least 6" in said[0]


CLAIMED = ('clusters.relay="claimed"', "clusters.flooding_period_s=1", "routing.hello_interval_s=1")


def test_half_of_the_hellos_of_claimed_slots_contend_with_all_claims_that_they_name() -> None:
    """Two periods in a hello interval, five nodes: each has a quarter of a hello in each window."""
    scenario = catalog.find("clusters", CLAIMED)
    one_ns = (192 + (137 + MESSAGE_BYTES + 64) * 8 / 11 + 50 + 70) * 1000
    assert claimed_hellos_ns(scenario, LINE) == pytest.approx(5 / 4 * one_ns, rel=0.01)
    crowd = {NodeId(i): tuple(NodeId(j) for j in range(1, 19) if j != i) for i in range(1, 19)}
    one_ns += MESSAGE_BYTES * 8 / 11 * 1000  # 17 neighbors take two messages
    assert claimed_hellos_ns(scenario, crowd) == pytest.approx(18 / 4 * one_ns, rel=0.01)


def test_hellos_that_no_turn_holds_contend_always() -> None:
    crowd = {NodeId(i): tuple(NodeId(j) for j in range(1, 121) if j != i) for i in range(1, 121)}
    short = catalog.find("clusters", [*CLAIMED, "traffic.payload_bytes=64"])
    long = catalog.find("clusters", [*CLAIMED, "traffic.payload_bytes=2000"])
    assert claimed_hellos_ns(short, crowd) == 2 * claimed_hellos_ns(long, crowd)


@pytest.mark.parametrize(("contention_ms", "fits"), [*slow((10, True)), (6, False)])
def test_claimed_slots_lose_packets_where_the_plan_says_that_the_hellos_do_not_fit(
    contention_ms: float, *, fits: bool
) -> None:
    keys = (*CLAIMED, "nodes.spacing_m=100", "traffic.interval_s=20", f"clusters.contention_ms={contention_ms}")
    scenario = catalog.find("clusters", [*keys, "duration_s=26", "warmup_s=14"])
    _, plan, feasible = judge(scenario, change=False)
    assert feasible == fits
    assert fits or ("contention_ms = 6 has to be at least 10" in plan["problems"][0] and len(plan["problems"]) == 1)
    assert (finish(simulate(scenario), out=None)["pdr"] == 1.0) == fits


def test_the_least_window_that_is_named_is_long_enough() -> None:
    places = {NodeId(i): Enu(10.0 * i, 0.0, 0.0) for i in range(1, 41)}
    adjacency = within_range(places, range_m=250)
    (said,) = too_short_for_claims(catalog.find("clusters", [*CLAIMED, "clusters.contention_ms=5"]), adjacency)
    least = int(said.split("has to be at least ")[1].split(",")[0])
    enough, less = (
        list(too_short_for_claims(catalog.find("clusters", [*CLAIMED, f"clusters.contention_ms={ms}"]), adjacency))
        for ms in (least, least - 1)
    )
    assert not enough
    assert less

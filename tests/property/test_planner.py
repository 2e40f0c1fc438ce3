"""The planner: no simulated head exceeds its delays, problems are named, and the change it proposes does help."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from agents.applications.traffic import sources_of
from fanet_mw import wire
from fanet_mw.bounds import Bounded, Refused
from fanet_mw.graph.topology import within_range
from fanet_mw.mavlink import Encoder
from fanet_mw.rng import stream
from fanet_mw.trace import Delivered
from fanet_mw.units import MS, Enu, NodeId, S
from sim.planner.cheapest_change import _changes, cheapest_change
from sim.planner.demand import TrafficClass, demands
from sim.planner.flood_cost import FloodCost
from sim.planner.head_slot import ClassLoad, slot_delays, work_ns
from sim.planner.plan import plan
from sim.planner.plan_text import describe, describe_change
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site
from sim.planner.timetable_plan import table_for
from sim.planner.uplink_delay import access_outcome, ways
from sim.run.virtual import simulate as simulate_swarm
from sim.scenarios import catalog
from sim.world.environment.layout import positions

# --- one head against exact simulation ---


def simulate(shares, arrivals, *, usable, period, start):
    """Floods of several lengths, the most urgent first, whole floods in the slot: worst delays, most waiting."""
    queues = [list(at) for at in arrivals]
    t, worst, waiting = 0, [0] * len(shares), 0
    while any(queues):
        t = max(t, min(queue[0] for queue in queues if queue))
        while True:
            ready = [i for i, queue in enumerate(queues) if queue and queue[0] <= t]
            waiting = max(waiting, sum(1 for queue in queues for at in queue if at <= t))
            length = shares[ready[0]].flood.spacing_ns
            begin = start + (t - start) // period * period
            if t <= begin + usable - length:
                break
            t = begin + period
        index = ready[0]
        t += length
        worst[index] = max(worst[index], t - queues[index].pop(0))
        waiting = max(waiting, 1 + sum(1 for queue in queues for at in queue if at < t))
    return worst, waiting


def test_an_urgent_packet_waits_for_the_less_urgent_flood_that_has_begun() -> None:
    """Units of 10; of a slot of 140, 100 are left: 5 units after the wait for the slot, of which 4 are the flood."""
    shares = [ClassLoad(1, 10_000, cost(10)), ClassLoad(1, 100_000, cost(40))]
    (urgent, bulk), _ = slot_delays(shares, usable_ns=140, period_ns=1000, jitter_ns=0)
    assert urgent == Bounded(1000 - 100 + 10 + 5 * 10)
    assert bulk == Bounded(1000 - 100 + 10 + 5 * 10)


@st.composite
def heads(draw):
    classes = draw(st.integers(1, 3))
    shares = [
        ClassLoad(draw(st.integers(0, 3)), draw(st.integers(60, 400)), cost(draw(st.integers(1, 9))))
        for _ in range(classes)
    ]
    usable = draw(st.integers(5, 60))
    return shares, usable, draw(st.integers(usable, 3 * usable)), draw(st.integers(0, 200))


def cost(spacing: int, duration: int | None = None) -> FloodCost:
    return FloodCost(duration or spacing, spacing, proven=True)


@examples(50)
@given(heads(), st.integers(0, 10**6))
def test_no_head_takes_longer_or_holds_more_than_its_plan(head, seed) -> None:
    shares, usable, period, jitter = head
    bounds, waiting = slot_delays(shares, usable_ns=usable, period_ns=period, jitter_ns=jitter)
    rng = stream(seed, "head")
    arrivals = []
    for share in shares:
        at = []
        for _ in range(share.sources):
            phase, calm = rng.randrange(share.interval_ns), rng.randrange(25)
            at += [phase + n * share.interval_ns + (jitter if n < calm else 0) for n in range(25)]
        arrivals.append(sorted(at))
    if max(s.flood.spacing_ns for s in shares if s.sources) > usable if any(arrivals) else True:
        return
    seen, most = simulate(shares, arrivals, usable=usable, period=period, start=rng.randrange(period))
    for bound, worst in zip(bounds, seen, strict=True):
        assert isinstance(bound, Refused) or worst <= bound.delay_ns
    assert waiting is None or most <= waiting


def test_the_urgent_are_bounded_though_the_bulk_overloads_the_slot() -> None:
    shares = [ClassLoad(2, 10_000, cost(10)), ClassLoad(50, 100, cost(20))]
    bounds, waiting = slot_delays(shares, usable_ns=200, period_ns=1000, jitter_ns=0)
    assert isinstance(bounds[0], Bounded)
    assert isinstance(bounds[1], Refused)
    assert waiting is None


def test_a_flood_adds_what_it_runs_beyond_its_spacing() -> None:
    short, _ = slot_delays([ClassLoad(1, 1000, cost(10))], usable_ns=100, period_ns=1000, jitter_ns=0)
    long, _ = slot_delays([ClassLoad(1, 1000, cost(10, 75))], usable_ns=100, period_ns=1000, jitter_ns=0)
    assert short == [Bounded(1000 - 100 + 2 * 10)]
    assert long == [Bounded(1000 - 100 + 2 * 10 + 65)]


def test_work_is_what_all_floods_of_a_period_take() -> None:
    shares = [ClassLoad(3, 500, cost(10)), ClassLoad(2, 1000, cost(7))]
    assert work_ns(shares, period_ns=2000) == 3 * 4 * 10 + 2 * 2 * 7


# --- plans of scenarios ---


GRID = {"nodes.count": 45, "clusters.count": 4, "clusters.flooding_period_s": 5}


@pytest.fixture
def planned(make_scenario):
    def build(**keys):
        scenario = make_scenario(**{**GRID, **keys})
        return plan(scenario, placed(scenario))

    return build


def placed(scenario) -> dict[NodeId, Enu]:
    return {NodeId(i + 1): at for i, at in enumerate(positions(scenario))}


def test_the_reference_grid_at_one_packet_a_second_is_feasible_and_at_ten_is_not(planned) -> None:
    assert planned(**{"traffic.interval_s": 1.0}).feasible
    busy = planned(**{"traffic.interval_s": 0.1})
    assert not busy.feasible
    assert any(f"head {busy.bottleneck.head}" in problem for problem in busy.problems)
    assert busy.bottleneck.utilization > 5


def test_load_that_does_not_fit_has_to_go_and_no_step_less_would_do(planned, make_scenario) -> None:
    scenario = make_scenario(**{**GRID, "traffic.interval_s": 0.05})
    change = cheapest_change(scenario, placed(scenario))
    ((key, interval),) = change.variant.settings
    assert key == "traffic.interval_s"
    assert planned(**{"traffic.interval_s": interval}).feasible
    assert not planned(**{"traffic.interval_s": interval * 0.69}).feasible


def test_the_proposed_change_is_feasible_and_none_that_is_less_is(planned, make_scenario) -> None:
    no_turns = {"clusters.contention_ms": 990}
    scenario = make_scenario(**{**GRID, "clusters.count": 22, "clusters.flooding_period_s": 1, **no_turns})
    assert not plan(scenario, placed(scenario)).feasible
    change = cheapest_change(scenario, placed(scenario))
    assert change.plan.feasible
    assert plan(change.variant.scenario, placed(scenario)).feasible
    less = [
        variant for variant in _changes(Site(scenario, placed(scenario)), None) if variant.size < change.variant.size
    ]
    assert less
    assert not any(plan(variant.scenario, placed(scenario)).feasible for variant in less)
    assert all(argument in describe_change(change, change.plan) for argument in change.variant.arguments)


def test_a_lifetime_shorter_than_the_bound_is_a_problem(planned) -> None:
    found = planned(**{"routing.lifetime_s": 3})
    assert any("routing.lifetime_s = 3" in problem for problem in found.problems)


def test_a_queue_that_would_overflow_is_a_problem(planned) -> None:
    found = planned(**{"routing.queue_frames": 20})
    assert any("routing.queue_frames = 20" in problem for problem in found.problems)


@pytest.mark.parametrize("arrivals", ["saturated", "poisson"])
def test_traffic_without_a_least_interval_is_refused(planned, arrivals) -> None:
    found = planned(**{"traffic.arrivals": arrivals})
    assert isinstance(found, Refused)
    assert arrivals in describe(found)


def test_no_traffic_is_feasible(planned) -> None:
    assert planned(**{"traffic.arrivals": "none"}).feasible


def test_nodes_out_of_reach_are_named_and_make_it_infeasible(make_scenario) -> None:
    scenario = make_scenario(**{"nodes.count": 5, "nodes.layout": "line", "clusters.count": 1})
    places = placed(scenario)
    places[NodeId(5)] = Enu(9000.0, 0.0, 50.0)
    found = plan(scenario, places)
    assert isinstance(found, ScenarioPlan)
    assert not found.feasible
    assert found.cut_off == (5,)
    assert "reaches node 5" in describe(found)


def test_light_traffic_has_a_proven_way_to_the_head_and_heavy_an_assumed_one(make_scenario) -> None:
    keys = {"nodes.count": 5, "nodes.layout": "line", "clusters.flooding_period_s": 5}
    light = make_scenario(**{**keys, "traffic.interval_s": 10, "radio.max_attempts": 3})
    found = plan(light, placed(light))
    assert isinstance(found.access, Bounded)
    assert not any("assumed" in note for note in found.notes)
    heavy = make_scenario(**{**keys, "traffic.interval_s": 0.05})
    assert any("assumed" in note for note in plan(heavy, placed(heavy)).notes)


def test_the_text_says_verdict_bounds_bottleneck_and_change(planned) -> None:
    text = describe(planned(**{"traffic.interval_s": 0.1, "mission.survivors": 4}))
    for words in (
        "NOT FEASIBLE",
        "45 nodes, 4 clusters",
        "report, 45 sources every 5 s: at most",
        "the slot of head",
        "equation (4)",
    ):
        assert words in text
    assert text == describe(planned(**{"traffic.interval_s": 0.1, "mission.survivors": 4}))


# --- timetables ---

TIMETABLE = {
    "clusters.relay": "scheduled",
    "clusters.flooding_period_s": 0.5,
    "clusters.guard_ms": 1,
    "radio.lead_ms": 0,
    "radio.cw_min": 7,
    "traffic.interval_s": 1.0,
}


def test_where_every_node_is_a_head_the_bound_is_the_protocol_s_own(make_scenario) -> None:
    scenario = make_scenario(**{"nodes.count": 45, **TIMETABLE, "clusters.count": 44})
    found = plan(scenario, placed(scenario), sources=[NodeId(n) for n in range(2, 46)])
    assert found.feasible
    assert found.access == Bounded(0)
    places = tuple(sorted(placed(scenario).items()))
    table = table_for(scenario, places, {NodeId(n): NodeId(n) for n in range(2, 46)})
    own = {NodeId(n): tuple(turn.offset for turn in table.table.roots() if turn.node == n) for n in range(2, 46)}
    bounds = [table.turns.worst_ns(own[n], span=table.table.spans[n], interval_ns=S) for n in own]
    assert found.classes[0].bound == Bounded(max(bounds))


def test_no_delivery_of_a_whole_swarm_is_later_than_the_plan() -> None:
    scenario = catalog.find("clusters", ["duration_s=20"])
    found = plan(scenario, placed(scenario), sources=[NodeId(n) for n in sources_of(scenario)])
    delays = [record.delay_ns for record in simulate_swarm(scenario).records if isinstance(record, Delivered)]
    assert len(delays) > 5000
    assert 0.7 * found.classes[0].bound.delay_ns < max(delays) <= found.classes[0].bound.delay_ns


def test_members_of_a_cluster_have_turns_on_their_way_to_the_head(make_scenario) -> None:
    scenario = make_scenario(**{"nodes.count": 45, **TIMETABLE, "clusters.count": 8})
    found = plan(scenario, placed(scenario))
    assert found.feasible
    assert found.proven
    assert found.access == Bounded(0)
    assert len(found.clusters) == 45, "each node lets out its own packets"


def test_members_contend_again_where_the_turns_suffice_for_heads_only(make_scenario) -> None:
    settings = {"nodes.count": 45, **TIMETABLE, "clusters.count": 8, "clusters.flooding_period_s": 0.15}
    scenario = make_scenario(**settings)
    found = plan(scenario, placed(scenario))
    assert len(found.clusters) == 9
    assert isinstance(found.access, Refused)
    assert "assumed" in found.notes[0]


def test_floods_that_do_not_fit_the_turns_are_the_one_problem_named(make_scenario) -> None:
    scenario = make_scenario(
        **{"nodes.count": 45, **TIMETABLE, "clusters.count": 44, "clusters.flooding_period_s": 0.06}
    )
    found = plan(scenario, placed(scenario))
    (problem,) = found.problems
    assert "one packet of each of 45 roots needs" in problem
    assert cheapest_change(scenario, placed(scenario)).plan.feasible


def test_a_slack_that_leaves_too_few_turns_is_named_with_the_most_that_fits() -> None:
    scenario = catalog.find("clusters", ["clusters.turn_slack_us=3000"])
    (problem,) = plan(scenario, placed(scenario)).problems
    most_us = int(problem.removesuffix(" it has enough").rsplit(" ", 1)[1])
    assert f"with clusters.turn_slack_us of at most {most_us}" in problem
    assert 2500 < most_us < 3000
    fits = catalog.find("clusters", [f"clusters.turn_slack_us={most_us}"])
    assert not any("roots needs" in problem for problem in plan(fits, placed(fits)).problems)


@pytest.mark.parametrize(
    ("settings", "needed_us"),
    [
        (["clock.offset_ms=1"], "2020"),
        (["clock.drift_ppm=10"], "1220"),
    ],
)
def test_clocks_that_nothing_brings_together_need_twice_their_error_and_20_us(
    settings: list[str], needed_us: str
) -> None:
    """After 60 s at 10 ppm they are 600 us off."""
    scenario = catalog.find("clusters", settings)
    problem = plan(scenario, placed(scenario)).problems[-1]
    assert "clusters.turn_slack_us = 50" in problem
    assert f"at least {needed_us}:" in problem
    for mend in (f"clusters.turn_slack_us={needed_us}", "clock.sync=beacons"):
        enough = catalog.find("clusters", [*settings, mend])
        assert not any("nothing brings them together" in p for p in plan(enough, placed(enough)).problems)


def test_a_time_in_hellos_is_proposed_to_clocks_that_are_apart() -> None:
    scenario = catalog.find("clusters", ["clock.offset_ms=1"])
    found = cheapest_change(scenario, placed(scenario), sources=[NodeId(node) for node in range(2, 46)])
    assert found is not None
    assert found.variant.arguments == ("clock.sync=beacons",)
    assert any("while clocks are known within 15 us" in note for note in found.plan.notes)


def test_of_many_heads_the_fullest_are_listed_and_the_others_counted() -> None:
    scenario = catalog.find("clusters")
    text = describe(plan(scenario, placed(scenario)))
    assert "and 37 heads with no fuller slots" in text


def test_repairs_are_said_to_come_later_than_any_bound(planned) -> None:
    assert "repairs" in describe(planned(**{"clusters.repair_s": 10}))
    assert "repairs" not in describe(planned())


def test_every_packet_goes_through_all_nodes_between_it_and_its_head() -> None:
    line = within_range({NodeId(n): Enu(200.0 * n, 0, 0) for n in range(1, 6)}, range_m=250)
    one = TrafficClass("application", 100, S, tuple(NodeId(n) for n in (1, 2, 5)))
    found = ways(line, dict.fromkeys(line, NodeId(3)), [one])
    assert found.hops == {1: 2, 2: 1, 3: 0, 4: 1, 5: 2}
    assert {n: row[0] for n, row in found.through.items()} == {1: 1, 2: 2, 3: 0, 4: 1, 5: 1}


def test_a_lifetime_is_that_of_the_class(planned) -> None:
    keys = {"mission.survivors": 4, "routing.report_lifetime_s": 4, "routing.lifetime_s": 30}
    (problem,) = planned(**keys).problems
    assert problem.startswith("report: takes up to")
    assert "expires after routing.report_lifetime_s = 4" in problem
    assert planned(**{**keys, "routing.report_lifetime_s": 0}).feasible


def test_warnings_are_a_class_of_their_own_that_expires_first(planned) -> None:
    found = planned(**{"mission.collision_horizon_s": 12, "mission.collision_distance_m": 15})
    assert [c.name for c in found.classes] == ["warning", "application"]
    warning = demands(found.scenario)[0]
    said = Encoder(NodeId(1)).collision(NodeId(2), closest_s=1.0, altitude_m=0.0, horizontal_m=0.0)
    assert warning.payload_bytes == wire.HEADER_BYTES + len(said)
    assert any("warning" in p and "routing.safety_lifetime_s = 1" in p for p in found.problems)


def test_each_hop_takes_the_lead_and_the_handover_and_packets_may_be_late_by_them(make_scenario) -> None:
    line = within_range({NodeId(n): Enu(200.0 * n, 0, 0) for n in range(1, 4)}, range_m=250)
    one = TrafficClass("application", 100, S // 5, (NodeId(3),))
    found = ways(line, dict.fromkeys(line, NodeId(1)), [one])

    def bound_ns(**keys: float) -> int:
        scenario = make_scenario(**{**GRID, **{f"radio.{key}": value for key, value in keys.items()}})
        outcome = access_outcome(scenario, line, found, [one], spacing_ns=None)
        assert isinstance(outcome, Bounded), outcome
        return outcome.delay_ns

    plain_ns = bound_ns(lead_ms=0, handover_ms=0)
    assert bound_ns(lead_ms=5, handover_ms=0) == plain_ns + 2 * 5 * MS
    assert bound_ns(lead_ms=0, handover_ms=1) == plain_ns + 2 * MS
    assert bound_ns(lead_ms=0, handover_ms=250) > plain_ns + 2 * 250 * MS, "one packet more may have come by then"

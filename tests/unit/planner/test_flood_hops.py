"""Floods that the hop limit ends, or that rely on links that do not exist: no such plan is feasible."""

import math
from typing import Any

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.graph.topology import within_range
from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.units import Enu, NodeId
from sim.planner.answer import judge
from sim.planner.flood_hops import flood_hops, too_many
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

LINE = ('nodes.layout="line"', "nodes.count=6", "clusters.count=5", "traffic.sources=5", "clusters.contention_ms=60")
TIMES = ("duration_s=18", "warmup_s=12")
ONE, TWO, THREE = NodeId(1), NodeId(2), NodeId(3)


def planned(*settings: str) -> tuple[bool, str]:
    _, plan, feasible = judge(catalog.find("clusters", [*LINE, *settings]), change=False)
    return feasible, " ".join(plan["problems"])


def run(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*LINE, *TIMES, *settings])), out=None)


@pytest.mark.parametrize("relay", ["scheduled", "all"])
def test_as_many_hops_as_a_flood_needs_are_enough_and_one_less_is_not(relay: str) -> None:
    keys = (f'clusters.relay="{relay}"', "traffic.interval_s=5", "clusters.flooding_period_s=1")
    assert planned(*keys, "routing.hop_limit=5") == (True, "")
    problem = "packets need up to 5 hops, and end after routing.hop_limit = 4: it has to be at least 5"
    assert planned(*keys, "routing.hop_limit=4") == (False, problem)


def test_the_hops_to_a_head_count_too() -> None:
    """The only head is in the middle: three hops to the farthest node, two on the way from the last one."""
    keys = ('clusters.relay="all"', "clusters.count=1", "traffic.interval_s=5", "clusters.flooding_period_s=1")
    assert planned(*keys, "routing.hop_limit=5")[0]
    assert planned(*keys, "routing.hop_limit=4")[1].startswith("packets need up to 5 hops")


def test_a_swarm_whose_hop_limit_is_just_enough_misses_nothing_and_with_one_less_does() -> None:
    assert run("routing.hop_limit=5")["pdr"] == 1.0
    assert run("routing.hop_limit=4")["pdr"] < 1.0


def test_more_hops_than_any_packet_may_make_are_said_to_be_too_many() -> None:
    limit = catalog.find("clusters", [*LINE, "routing.hop_limit=255"])
    assert not list(too_many(limit, 255))
    assert list(too_many(limit, 256)) == [
        "packets need up to 256 hops, and end after routing.hop_limit = 255: its greatest value is 255"
    ]


@pytest.mark.parametrize("relay", ["scheduled", "all"])
def test_a_plan_whose_floods_end_early_has_no_bound(relay: str) -> None:
    keys = (*LINE, f'clusters.relay="{relay}"', "traffic.interval_s=5", "clusters.flooding_period_s=1")
    _, plan, _ = judge(catalog.find("clusters", [*keys, "routing.hop_limit=4"]), change=False)
    assert [c["bound_ms"] for c in plan["classes"]] == [None]
    assert "at most" not in str(plan["classes"])


def test_over_lossy_links_the_hop_limit_is_named_too() -> None:
    lossy = (*LINE, 'radio.channel="log_distance"', 'radio.fading="rician"', "nodes.spacing_m=120")
    _, plan, _ = judge(catalog.find("clusters", [*lossy, "routing.hop_limit=1"]), change=False)
    assert any("and end after routing.hop_limit = 1" in problem for problem in plan["problems"])
    assert set(plan["draws"][0]["likely_ms"].values()) == {None}
    _, plan, _ = judge(catalog.find("clusters", lossy), change=False)
    assert not any("hop_limit" in problem for problem in plan["problems"])


def test_a_node_states_a_bound_only_if_its_floods_reach_everyone() -> None:
    """The leader is in the middle. Floods of the two ends need five hops, those of the other sources at most four."""
    middle = 'nodes.leader_at="middle"'
    some = run(middle, "routing.hop_limit=4")["bound"]
    assert some["violations"] == 0
    assert some["within_share"] == some["stated_share"] == pytest.approx(3 / 5)
    assert run(middle, "routing.hop_limit=5")["bound"]["within_share"] == 1.0


def test_no_node_states_a_bound_if_the_leader_may_not_know_all_nodes() -> None:
    """The leader is one of the ends, and the joins of the other end do not come so far."""
    assert run("routing.hop_limit=4")["bound"] == {}


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (("clusters.link_m=450",), "clusters.link_m = 450"),
        (("nodes.spacing_m=120", "clusters.link_m=130", "clusters.interference_m=130"), "interference_m = 130"),
    ],
)
def test_a_timetable_for_links_or_interference_that_are_other_than_the_radio_s_is_not_feasible(
    settings: tuple[str, ...], named: str
) -> None:
    more = ("nodes.count=16", "clusters.count=15", "traffic.sources=15", "traffic.interval_s=0.25")
    feasible, problem = planned(*more, *settings)
    assert not feasible
    assert named in problem
    assert "radio.range_m = 250" in problem
    assert run(*more, *settings, "clusters.resume=false")["pdr"] < 0.9, "what is lost is not sent later"


def test_links_longer_than_the_range_that_no_flood_uses_are_fine() -> None:
    assert planned("clusters.link_m=300")[0]


def test_two_frames_in_one_turn_that_meet_at_a_node_are_not_received() -> None:
    places = {node: Enu(200.0 * index, 0.0, 0.0) for index, node in enumerate((ONE, TWO, THREE))}
    geometry = Geometry(250, 250, turns=10, hop_turns=1)
    adjacency = within_range(places, range_m=250)
    alone = Timetable((Turn(0, ONE, ONE, 0), Turn(1, TWO, ONE, 0)), {}, {}, 2)
    assert flood_hops(alone, adjacency, geometry)[ONE] == (2, ())
    meeting = Timetable((*alone.turns, Turn(10, THREE, THREE, 0)), {}, {}, 2)
    assert flood_hops(meeting, adjacency, geometry)[ONE] == (0, (TWO, THREE)), "turn 10 is turn 0 of the next one"
    late = Timetable((Turn(0, ONE, ONE, 0), Turn(1, TWO, ONE, 0)), {}, {}, 2)
    assert flood_hops(late, adjacency, geometry._replace(hop_turns=2))[ONE].missed == (THREE,), "too soon to relay"


@pytest.mark.parametrize("deadline_s", [0.0, -1.0, 1e7, 1e308, math.inf, math.nan])
def test_a_deadline_beyond_any_run_is_refused(deadline_s: float) -> None:
    with pytest.raises(ConfigError, match=r"--deadline .*: must be > 0 and <= 1e\+06 \[s\]"):
        judge(catalog.find("clusters", LINE), deadline_s=deadline_s, change=False)

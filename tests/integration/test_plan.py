"""`fanet plan` before take-off against what the same swarm then does."""

import json
import subprocess
import sys
from typing import Any

import pytest
from kit import slow

from fanet_mw.scenario import Scenario, config
from fanet_mw.units import NodeId
from fanet_mw.wire.places import rounded
from sim.cli.app import app
from sim.planner.answer import judge
from sim.planner.plan import plan
from sim.planner.scenario_plan import ScenarioPlan
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.layout import positions


def all_send(nodes: int) -> tuple[str, ...]:
    """The settings of a swarm whose nodes all send but the leader, and are heads."""
    return f"nodes.count={nodes}", f"clusters.count={nodes - 1}", f"traffic.sources={nodes - 1}"


def planned(*settings: str, deadline_s: float | None = None, **options: bool) -> tuple[str, dict[str, Any], bool]:
    return judge(catalog.find("clusters", settings), deadline_s=deadline_s, **{"change": False, **options})


def without_capacity(*settings: str) -> ScenarioPlan:
    """The plan alone: the least interval that `judge` searches for takes seconds where packets are many."""
    scenario = catalog.find("clusters", settings)
    at = {NodeId(node): rounded(place) for node, place in zip(scenario.node_ids, positions(scenario), strict=True)}
    found = plan(scenario, at)
    assert isinstance(found, ScenarioPlan)
    return found


@pytest.mark.parametrize(
    "settings",
    [
        (),
        pytest.param(("clusters.count=8",), marks=pytest.mark.slow),
        pytest.param(("radio.lead_ms=10", "clusters.flooding_period_s=1"), marks=pytest.mark.slow),
    ],
)
def test_the_bound_that_is_planned_is_the_one_that_the_nodes_compute_in_flight(settings: tuple[str, ...]) -> None:
    scenario = catalog.find(
        "clusters",
        [*all_send(20), "duration_s=20", "warmup_s=12", "world.gps_sigma_m=0", "sensors.gps_bias_m=0", *settings],
    )
    _, plan, feasible = judge(scenario, deadline_s=None)
    assert feasible
    assert plan["proven"]
    assert plan["classes"][0]["bound_ms"] == pytest.approx(greatest_stated_ms(scenario), abs=0.001)


def greatest_stated_ms(scenario: Scenario) -> float:
    reports = simulate(scenario).reports.values()
    return float(max(report["bound_ms"] for report in reports if report.get("bound_ms")))


LINE = (
    "nodes.count=16",
    "nodes.layout=line",
    "clusters.count=4",
    "clusters.flooding_period_s=0.25",
    "radio.cw_min=7",
    "radio.lead_ms=5",
    "traffic.sources=15",
)


def test_where_gps_errs_the_plan_has_the_greatest_bound_of_all_its_draws() -> None:
    """Nodes compute the timetable from positions that err, so its floods begin in another order."""
    scenario = catalog.find("clusters", ["duration_s=15", "warmup_s=12", *LINE, "seed=2"])
    text, plan, feasible = judge(scenario, change=False)
    _, exact, _ = judge(catalog.find("clusters", [*LINE, "world.gps_sigma_m=0", "sensors.gps_bias_m=0"]), change=False)
    assert feasible
    assert (exact["confidence"], plan["confidence"]) == (1.0, pytest.approx(20 / 21))
    exact_ms, plan_ms = (made["classes"][0]["bound_ms"] for made in (exact, plan))
    assert exact_ms <= greatest_stated_ms(scenario) <= plan_ms
    assert exact_ms < plan_ms
    assert f"at most {plan['classes'][0]['bound_ms'] / 1000:.3f} s in 95 % of flights" in text


@pytest.mark.parametrize("channel", ["range", *slow("log_distance")])
def test_floods_that_miss_nodes_with_reported_positions_are_a_problem(channel: str) -> None:
    """In the middle of the line two nodes are 2 m too far from each other, and another node is a way around; GPS
    errs by 1.5 m.
    """
    places = [[0, 0, 50], [200, 0, 50], [452, 0, 50], [650, 0, 50], [326, 150, 50]]
    settings = (f"nodes.positions_m={places}", "nodes.layout=explicit", "nodes.count=5", "clusters.count=4",
                "traffic.sources=4", f"radio.channel={channel}", "clusters.links=places",
                "clusters.link_m=250")  # fmt: skip
    _, plan, feasible = planned(*settings, "world.gps_sigma_m=1.5")
    assert not feasible
    assert "floods that miss others" in plan["problems"][0]
    assert planned(*settings, "world.gps_sigma_m=0", "sensors.gps_bias_m=0")[2]


@pytest.mark.parametrize("spacing_m", [250, 245])
@pytest.mark.slow
def test_links_that_gps_may_take_for_none_are_a_problem_and_a_greater_distance_of_links_is_proposed(
    spacing_m: float,
) -> None:
    """Each node of a line hears only the next ones. Without one of these links the swarm is in parts."""
    settings = (*LINE, "nodes.count=12", "traffic.sources=11", f"nodes.spacing_m={spacing_m}", "world.gps_sigma_m=1.5")
    _, plan, feasible = planned(*settings, change=True)
    assert not feasible
    assert "draws of the positions that GPS gives" in plan["problems"][0]
    (argument,) = plan["change"]["set"]
    assert argument.startswith("clusters.link_m=")
    changed = catalog.find("clusters", ["duration_s=20", "warmup_s=12", *settings, argument])
    assert planned(*settings, argument)[2]
    assert finish(simulate(changed), out=None)["pdr"] == 1.0


@pytest.mark.slow
def test_links_that_come_and_go_with_errors_of_gps_are_told_with_what_they_do() -> None:
    """Nodes two places apart in the grid are 250 m from each other, as far as the radio reaches."""
    size = ("nodes.count=16", "nodes.columns=4", "clusters.count=4", "traffic.sources=15")
    text, plan, feasible = planned(*size, "nodes.spacing_m=125")
    assert feasible
    assert plan["varying_links"] == 16
    assert "16 pairs of nodes are about 250 m apart" in " ".join(text.split())
    assert "but for changes of the timetable" in " ".join(text.split())
    assert "every packet reaches everyone" not in " ".join(text.split())
    text, plan, _ = planned(*size, "nodes.spacing_m=100")
    assert plan["varying_links"] == 0
    assert "but for changes of the timetable" not in " ".join(text.split())


@pytest.mark.parametrize(("period_s", "told"), [(2, False), *slow((5, True))])
def test_traffic_that_begins_before_the_timetable_is_told_so(period_s: float, *, told: bool) -> None:
    """The swarm joins within some 6 s, and its schedule begins with the period after the next."""
    settings = (f"clusters.flooding_period_s={period_s}", "warmup_s=12", "nodes.count=9", "clusters.count=8",
                "traffic.sources=8")  # fmt: skip
    _, plan, _ = planned(*settings)
    assert any("nodes have their timetable some 16 s after the start" in note for note in plan["notes"]) == told


def test_bounds_with_repair_are_estimates_because_repairs_contend_beside_the_turns() -> None:
    size = ("nodes.count=9", "clusters.count=8", "traffic.sources=8")
    assert planned(*size)[1]["proven"]
    text, plan, feasible = planned(*size, "clusters.repair_s=5")
    assert feasible
    assert not plan["proven"]
    assert "may reach into turns" in " ".join(text.split())


def test_packets_to_heads_have_to_fit_the_contention_window_too() -> None:
    """At 1 Mb/s a frame takes 9 ms, and the turns of such a swarm suffice for heads only."""
    settings = ("nodes.count=31", "nodes.layout=disc", "nodes.radius_m=180", "clusters.count=11", "traffic.sources=27",
                "traffic.interval_s=1.35", "radio.rate_mbps=1", "radio.cw_min=3", "radio.lead_ms=0", "seed=3",
                "clusters.flooding_period_s=0.3", "clusters.contention_ms=60")  # fmt: skip
    _, plan, feasible = planned(*settings)
    assert not feasible
    assert any("hellos and packets to heads of a superframe take" in problem for problem in plan["problems"])


def test_a_leader_whose_announcements_expire_before_its_turn_is_a_problem() -> None:
    _, plan, feasible = planned("routing.lifetime_s=0.4", "clusters.flooding_period_s=0.5", "traffic.interval_s=0.5")
    assert not feasible
    assert any("nodes would elect another leader" in problem for problem in plan["problems"])


@pytest.mark.parametrize(("nodes", "interval_s"), [(12, 0.01), (45, 0.1)])
@pytest.mark.slow
def test_a_load_that_does_not_fit_is_told_with_the_one_that_does(nodes: int, interval_s: float) -> None:
    size = all_send(nodes)
    text, plan, feasible = planned(*size, f"traffic.interval_s={interval_s}")
    assert not feasible
    assert f"one packet per source every {interval_s}" in text
    least_s = plan["superframe"]["least_interval_s"]
    assert without_capacity(*size, f"traffic.interval_s={least_s}").feasible
    assert not without_capacity(*size, f"traffic.interval_s={0.99 * least_s}").feasible


@pytest.mark.parametrize(
    ("nodes", "settings", "deadline_s"),
    [*slow((20, ("clusters.flooding_period_s=0.1",), None), (20, (), 0.2)), (9, ("clusters.relay=all",), 0.3)],
)
def test_the_change_that_it_proposes_makes_it_feasible(
    nodes: int, settings: tuple[str, ...], deadline_s: float | None
) -> None:
    size = all_send(nodes)
    _, plan, feasible = planned(*size, *settings, deadline_s=deadline_s, change=True)
    assert not feasible
    assert planned(*size, *settings, *plan["change"]["set"], deadline_s=deadline_s)[2]


def test_a_deadline_that_cannot_be_met_is_no_plan() -> None:
    text, plan, feasible = planned(*all_send(12), deadline_s=0.2)
    assert feasible
    assert plan["classes"][0]["deadline_met"]
    assert "deadline 0.2 s met" in " ".join(text.split())
    text, plan, feasible = planned(*all_send(12), deadline_s=0.1)
    assert not feasible
    assert not plan["classes"][0]["deadline_met"]
    assert "takes up to 164.6 ms, the deadline is 100 ms" in text


@pytest.mark.parametrize("relay", ["scheduled", *slow("all")])
def test_a_swarm_in_parts_is_told_with_who_is_out_of_reach(relay: str) -> None:
    here, there = [[200 * i, 0, 50] for i in range(5)], [[200 * i, 2000, 50] for i in range(3)]
    layout = ["nodes.count=8", "traffic.sources=7", 'nodes.layout="explicit"', f"nodes.positions_m={here + there}"]
    text, plan, feasible = planned(*layout, "clusters.count=7", f"clusters.relay={relay}", change=True)
    assert not feasible
    assert plan["cut_off"] == [6, 7, 8]
    assert plan["classes"][0]["bound_ms"] is None
    assert "reaches nodes 6, 7, 8" in text
    assert plan["change"] is None
    assert "come nearer" in text


TWELVE = ("--set", *all_send(12))


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("clusters", *TWELVE, "--json"), 0, '"feasible": true'),
        *slow((("clusters", "--deadline", "0.5", "--json"), 1, '"clusters.flooding_period_s=')),
        (("convoy",), 0, "FEASIBLE  convoy"),
        (("rescue",), 0, "a round of"),
        (
            ("rescue", "--set", "traffic.sources=0", "routing.lifetime_s=4"),
            0,
            "longer than routing.lifetime_s = 4 states",
        ),
        (("rescue", "--deadline", "0.5"), 1, "not within the deadline of 500 ms"),
        (("rescue", "--set", "clock.offset_ms=0.1"), 1, "rounds.turn_slack_us = 50 has to be at"),
        (("rescue", "--set", "clock.sync=gps", "clock.offset_ms=20000"), 1, "accepts no time that differs by more"),
        (("flooding",), 2, 'only "clustered" and "rounds" can be planned'),
        (("clusters", "--deadline", "-1"), 2, "must be > 0"),
    ],
)
def test_the_command_prints_its_verdict_and_ends_with_it(
    arguments: tuple[str, ...], code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if code == 2:  # what becomes of an error is the program's
        done = subprocess.run(
            [sys.executable, "-m", "sim.cli.app", "plan", *arguments], capture_output=True, text=True, timeout=60
        )
        returned, out = done.returncode, done.stdout + done.stderr
    else:
        returned, out = app(["plan", *arguments], result_action="return_value"), capsys.readouterr().out
    assert returned == code, out
    assert said in out
    assert ("lifetime_s" in out) == ("lifetime_s" in said)
    if "--json" in arguments and code != 2:
        assert json.loads(out)["superframe"]["turns"] == 375


@pytest.mark.parametrize("sources", ["0", '"all"'])
def test_a_lone_node_has_a_plan_though_it_is_heard_by_nobody(sources: str) -> None:
    text, plan, feasible = planned("nodes.count=1", "clusters.count=1", f"traffic.sources={sources}")
    assert feasible
    assert "FEASIBLE" in text
    assert "loss" not in plan, "there is no link on which anything could be lost"


NINE = ("nodes.count=9", "clusters.count=8", "traffic.sources=8", "duration_s=20", "warmup_s=12", "seed=2")


def with_classes(*classes: dict[str, Any]) -> Scenario:
    """Nine nodes with these classes of traffic."""
    tree = catalog.find("clusters", NINE).model_dump(exclude_none=True)
    return config.build({**tree, "traffic": [{"payload_bytes": 1024, "sources": 8, **keys} for keys in classes]})


@pytest.mark.slow
def test_classes_of_one_priority_wait_for_each_other_and_the_plan_counts_both() -> None:
    """Each class alone would take at most 110 ms; in the run packets of both come at once, and one takes 150 ms."""
    _, alone, feasible = judge(with_classes({"name": "a", "interval_s": 0.16}))
    assert feasible
    scenario = with_classes({"name": "a", "interval_s": 0.16}, {"name": "b", "interval_s": 0.16})
    _, plan, feasible = judge(scenario)
    assert feasible
    bounds_ms = [each["bound_ms"] for each in plan["classes"]]
    slowest_ms = finish(simulate(scenario), out=None)["delay_ms"]["max"]
    assert alone["classes"][0]["bound_ms"] < slowest_ms <= min(bounds_ms)
    assert max(bounds_ms) < 1.2 * slowest_ms


def test_reports_fill_nothing_of_the_room_that_turns_have_for_bulk() -> None:
    """Each turn carries a packet and reports of a node beside it; in the same room they would need more turns."""
    stays = ("mission.survivors=9", "mission.reports_to_approach=10")
    keys = (*stays, "mission.report_interval_s=0.1", "traffic.interval_s=0.2", "traffic.sources=9")
    _, plan, feasible = planned(*NINE, *keys)
    assert feasible, plan["problems"]
    assert max(slot["used"] for slot in plan["slots"]) <= 1

"""Whole swarms in virtual time: every layer is the real one."""

import gc
import sys
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from kept_flights import FLIGHTS

from fanet_mw import wire
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Delivered, Generated, RoleChanged
from fanet_mw.units import MS, S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog

MakeScenario = Callable[..., Scenario]


def summary_of(scenario: Scenario) -> dict[str, Any]:
    return finish(simulate(scenario), out=None)


@pytest.fixture(scope="module")
def quick() -> Outcome:
    return simulate(catalog.find("quick"))


_LATER = {settings[0] for settings in FLIGHTS.values()} | {"hills", "night"}
"""The scenarios of which `test_kept_flights.py` flies variants and closes the ledgers, and two that take a second."""


@pytest.mark.parametrize("duration_s", [1.5, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name",
    [pytest.param(entry.name, marks=pytest.mark.slow if entry.name in _LATER else ()) for entry in catalog.shipped()],
)
def test_the_ledger_closes_and_copies_add_up_in_every_shipped_scenario(name: str, duration_s: float) -> None:
    summary = summary_of(catalog.find(name, [f"duration_s={duration_s}", "warmup_s=0", "drain_s=0.5"]))
    frames, copies = summary["frames"], summary["copies"]
    assert frames["sent"] > 0
    assert frames["closes"]
    assert copies["handed"] == copies["heard"]
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values()) + copies["in_flight"]
    assert copies["closes"]


def test_the_same_seed_gives_the_same_trace_and_another_seed_another() -> None:
    first, again, other = (
        summary_of(catalog.find("quick", ["duration_s=7", "drain_s=1", f"seed={seed}"])) for seed in (1, 1, 2)
    )
    assert first["trace_sha256"] == again["trace_sha256"]
    assert first["trace_sha256"] != other["trace_sha256"]


@pytest.mark.slow
def test_runs_in_threads_of_one_process_do_not_touch_each_other(make_scenario: MakeScenario) -> None:
    keys = {"duration_s": 6, "drain_s": 1, "nodes.count": 6, "traffic.interval_s": 0.1, "world.engine": "kinematic"}
    scenarios = [make_scenario(**{**keys, "seed": seed}) for seed in (1, 2, 3)]
    alone = [summary_of(scenario)["trace_sha256"] for scenario in scenarios]
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # threads take turns within the handling of one frame
    try:
        with ThreadPoolExecutor(len(scenarios)) as threads:
            beside = [summary["trace_sha256"] for summary in threads.map(summary_of, scenarios)]
    finally:
        sys.setswitchinterval(before_s)
    assert beside == alone


def test_what_a_run_has_collected_goes_with_its_outcome_and_waits_for_no_garbage_collector(
    make_scenario: MakeScenario,
) -> None:
    outcome = simulate(make_scenario())
    assert outcome.records
    kept = [weakref.ref(log) for log in (outcome.records, outcome.taps, outcome.links)]
    gc.disable()
    try:
        del outcome
        assert [log() for log in kept] == [None, None, None]
    finally:
        gc.enable()


def test_nodes_join_and_the_leader_makes_balanced_clusters(quick: Outcome) -> None:
    roles = {record.node: record for record in quick.records if isinstance(record, RoleChanged)}
    heads = {node for node, record in roles.items() if record.role == "head"}
    assert sorted(roles) == list(range(2, 10)), "all but the leader are in a cluster"
    assert len(heads) == 2
    assert all(record.head in heads for record in roles.values())


def test_every_source_reaches_every_other_node(quick: Outcome) -> None:
    traffic = {(r.node, r.seq) for r in quick.records if isinstance(r, Generated) and r.app == "traffic"}
    reached = {(r.origin, r.node) for r in quick.records if isinstance(r, Delivered) and (r.origin, r.seq) in traffic}
    assert reached == {(a, b) for a in range(1, 10) for b in range(1, 10) if a != b}


def test_nothing_is_delivered_twice_or_to_its_origin(quick: Outcome) -> None:
    deliveries = [(r.node, r.origin, r.seq) for r in quick.records if isinstance(r, Delivered)]
    assert len(deliveries) == len(set(deliveries))
    assert all(node != origin for node, origin, _ in deliveries)


def test_a_uav_approaches_only_after_reports_of_enough_different_nodes(quick: Outcome) -> None:
    approaches = [record for record in quick.records if isinstance(record, Approaching)]
    assert approaches, "the scenario has survivors in range"
    assert all(record.reporters >= 3 for record in approaches)
    reports = {(r.node, r.seq) for r in quick.records if isinstance(r, Generated) and r.app == "report"}
    for approach in approaches:
        origins = {
            r.origin
            for r in quick.records
            if isinstance(r, Delivered)
            and r.node == approach.node
            and (r.origin, r.seq) in reports
            and r.t_ns <= approach.t_ns
        }
        assert len(origins) >= 3


def test_what_the_network_delivers_changes_the_flight() -> None:
    """The same swarm on a radio that reaches nobody: survivors are detected, nobody approaches."""
    deaf = summary_of(catalog.find("quick", ["radio.range_m=1"]))
    assert deaf["mission"]["detected"] > 0
    assert deaf["mission"]["uavs_approaching"] == 0
    assert deaf["frames"]["closes"]


def test_floods_leave_their_head_only_in_its_slot(make_scenario: MakeScenario) -> None:
    from fanet_mw.bus.messages import TxRequest
    from fanet_mw.bus.topics import Topics, node_of
    from fanet_mw.hosts.virtual import VirtualHost
    from sim.run.virtual import actors_of

    scenario = catalog.find("quick", ["mission.survivors=0", "duration_s=15"])
    sent: list[tuple[int, TxRequest]] = []

    def hear(topic: str, message: object) -> None:
        if isinstance(message, TxRequest):
            sent.append((node_of(topic), message))

    actors = actors_of(scenario, "slots")
    records: list[Any] = []
    host = VirtualHost(actors, on_records=records.extend, listeners=[(Topics("slots").all_tx, hear)])
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    cluster_of = {r.node: r.cluster for r in records if isinstance(r, RoleChanged) and r.role == "head"}
    releases = 0
    seen: set[tuple[int, int]] = set()
    for node, request in sent:
        header = wire.decode_header(request.frame)
        flooded = header.flags & wire.FLAG_FLOOD and header.kind == wire.Kind.DATA
        if not flooded or (header.origin, header.seq) in seen:
            continue  # relays come after the head's own release
        seen.add((header.origin, header.seq))
        phase_ns = request.start_ns % (1 * S) - cluster_of[node] * 500 * MS
        assert 0 <= phase_ns < 500 * MS - 2 * MS
        releases += 1
    assert releases > 50


@pytest.mark.slow
def test_a_simulation_of_a_thousand_nodes_closes_its_ledger(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{
            "nodes.count": 1000, "routing.protocol": "flooding", "routing.hello_interval_s": 0, "radio.lead_ms": 0,
            "routing.hop_limit": 100, "traffic.sources": 1, "duration_s": 2, "drain_s": 0.8,
        }
    )  # fmt: skip
    summary = summary_of(scenario)
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.9


def _moving_pdr(make_scenario: MakeScenario, *, repair_s: float) -> float:
    """A thin swarm that falls into parts and meets again; packets have 30 s to arrive."""
    scenario = make_scenario(
        **{
            "nodes.count": 15, "nodes.layout": "grid", "nodes.telemetry_hz": 0, "mobility.model": "random_waypoint",
            "mobility.speed_m_s": 40, "world.area_m": 900, "clusters.count": 3, "clusters.flooding_period_s": 1,
            "clusters.repair_s": repair_s, "traffic.interval_s": 2, "traffic.payload_bytes": 200,
            "duration_s": 36, "warmup_s": 10, "drain_s": 18,
        }
    )  # fmt: skip
    return float(summary_of(scenario)["pdr"])


def test_repair_brings_what_was_missed_to_those_who_were_out_of_reach(make_scenario: MakeScenario) -> None:
    assert _moving_pdr(make_scenario, repair_s=0) < 0.75
    assert _moving_pdr(make_scenario, repair_s=25) > 0.98

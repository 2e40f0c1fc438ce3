"""Plans of claimed slots: the protocol's own claims and relays, loads that fit, and what is not promised."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.bounds import Refused
from fanet_mw.graph.topology import two_hop, within_range
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.scenario import config
from fanet_mw.units import Enu, NodeId, S
from sim.planner import ScenarioPlan, cheapest_change, describe, plan
from sim.planner.claimed_turns import converged_slots
from sim.world.environment.layout import positions


def placed(scenario) -> dict[NodeId, Enu]:
    return {NodeId(i + 1): at for i, at in enumerate(positions(scenario))}


CLAIMED = {
    "nodes.count": 45, "clusters.count": 44, "clusters.relay": "claimed", "clusters.flooding_period_s": 0.5,
    "radio.cw_min": 7, "radio.lead_ms": 0,
}  # fmt: skip


@st.composite
def swarms(draw) -> dict[NodeId, Enu]:
    count, side = draw(st.integers(2, 24)), draw(st.integers(100, 900))
    random = Random(draw(st.integers(0, 2**32)))
    return {NodeId(n): Enu(random.uniform(0, side), random.uniform(0, side), 50) for n in range(1, count + 1)}


@given(swarms())
@examples(12)
def test_the_slots_of_a_plan_never_meet_within_two_hops_and_their_length_follows_the_law(at) -> None:
    adjacency = within_range(at, range_m=250)
    turns = Turns(0, 500_000_000, 40_000_000, 1_200_000, 380)
    shares = converged_slots(config.build({"clusters": {"relay": "claimed", "count": 1}}), adjacency, turns)
    near = two_hop(adjacency)
    for node, share in shares.items():
        assert share is not None
        crowds = [1 + len(near[n]) for n in (node, *near[node])]
        assert share.length >= max(crowds)
        assert share.length & (share.length - 1) == 0
        for other in near[node]:
            assert not any(shares[other].has(turn) and share.has(turn) for turn in range(256))


def test_a_claimed_swarm_carries_what_its_plan_says_and_no_more(make_scenario) -> None:
    def judged(interval_s: float) -> ScenarioPlan:
        scenario = make_scenario(**{**CLAIMED, "traffic.interval_s": interval_s})
        return plan(scenario, placed(scenario))

    found = judged(1.0)
    assert found.feasible
    assert found.claims.hops == 12
    least_s = found.claims.least_interval_ns / S
    assert judged(least_s).bottleneck.utilization == pytest.approx(1, abs=0.01)
    over = judged(0.9 * least_s)
    assert not over.feasible
    assert over.problems[0].startswith(f"node {over.bottleneck.head}: its packets need")
    relay = next(node for node in found.claims.nodes if node.relays)
    assert relay.load == pytest.approx(45 * 0.5 + 0.25)


def test_in_claimed_slots_only_a_packet_without_queues_is_bounded_and_no_deadline_is_promised(make_scenario) -> None:
    scenario = make_scenario(**CLAIMED)
    found = plan(scenario, placed(scenario), deadline_ns=2 * S)
    assert isinstance(found.classes[0].bound, Refused)
    assert found.problems == ("application: no bound in claimed slots, so the deadline of 2000 ms cannot be promised",)
    text = describe(plan(scenario, placed(scenario)))
    assert f"within 12 hops x {found.claims.hop_ns / 1e6:.1f} ms" in text
    assert "nothing bounds" in text


@pytest.mark.parametrize(
    "keys", [{"clusters.slots": 4}, {"clusters.slots": 10, "clusters.count": 1, "clusters.flooding_period_s": 0.045}]
)
def test_nodes_that_find_no_slot_or_no_turn_in_it_are_the_one_problem(make_scenario, keys) -> None:
    scenario = make_scenario(**{**CLAIMED, **keys})
    found = plan(scenario, placed(scenario))
    (problem,) = found.problems
    assert "have no turn" in problem
    assert found.claims.lone_ns is None
    assert f"a period has {found.claims.turns.per_superframe} turns" in problem


def test_small_packets_together_are_the_cheapest_change_of_a_claimed_swarm(make_scenario) -> None:
    scenario = make_scenario(**{**CLAIMED, "traffic.payload_bytes": 64, "traffic.interval_s": 0.15})
    assert not plan(scenario, placed(scenario)).feasible
    change = cheapest_change(scenario, placed(scenario))
    assert change.plan.feasible
    assert len(change.variant.settings) == 1

"""Gossip (Haas et al. 2006) and the counter-based scheme (Ni et al. 1999): which nodes relay a flood."""

from collections.abc import Callable

import pytest
from rival_bench import Bench

from fanet_mw import wire
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S

MakeBench = Callable[..., Bench]
CROWD = [(a, b) for a in range(1, 9) for b in range(a + 1, 9)]
LINE = [(node, node + 1) for node in range(1, 8)]


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    def make(protocol: str, links: list[tuple[int, int]], **keys: object) -> Bench:
        scenario = make_scenario(
            **{"routing.protocol": protocol, "nodes.count": 8, "radio.lead_ms": 0, "traffic.arrivals": "none", **keys}
        )
        return Bench(scenario, list(range(1, 9)), links)

    return make


def relays(found: Bench, packets: int, *, destination: int = 0xFFFF) -> list[set[int]]:
    """Who relayed each of some packets of node 1."""
    senders = []
    for _ in range(packets):
        seq = found.send(1, destination)
        found.advance(1 * S)
        sent = [s.node for s in found.data(seq, 1)]
        assert len(sent) == len(set(sent)), "nobody relays twice"
        senders.append(set(sent) - {1})
    return senders


def test_gossip_relays_with_its_probability(bench: MakeBench) -> None:
    found = bench("gossip", CROWD, **{"routing.gossip_p": 0.3, "routing.gossip_k": 0})
    counts = [len(nodes) for nodes in relays(found, 200)]
    assert sum(counts) / (200 * 7) == pytest.approx(0.3, abs=0.05)
    assert len(set(counts)) > 3, "by lot, not in turns"


def test_gossip_always_relays_within_the_first_k_hops(bench: MakeBench) -> None:
    found = bench("gossip", LINE, **{"routing.gossip_p": 0, "routing.gossip_k": 3})
    assert relays(found, 5) == [{2, 3, 4}] * 5
    found = bench("gossip", LINE, **{"routing.gossip_p": 0, "routing.gossip_k": 0})
    assert relays(found, 5) == [set()] * 5


def test_gossip_with_probability_one_is_flooding(bench: MakeBench) -> None:
    found = bench("gossip", LINE, **{"routing.gossip_p": 1})
    assert relays(found, 3) == [set(range(2, 9))] * 3
    assert {node for node, *_ in found.deliveries} == set(range(2, 9))


def test_a_node_that_has_heard_enough_copies_stays_silent(bench: MakeBench) -> None:
    found = bench("counter", CROWD, **{"routing.counter": 3, "routing.assess_ms": 100})
    counts = [len(nodes) for nodes in relays(found, 50)]
    assert max(counts) <= 4, "a third copy silences all whose assessment is not over within its airtime"
    assert min(counts) >= 2, "the origin's copy and two relays make three"


@pytest.mark.parametrize(("copies", "relayed"), [(1, 1), (2, 1), (3, 0)])
def test_the_copy_that_makes_the_count_is_the_first_one_too_many(bench: MakeBench, copies: int, relayed: int) -> None:
    found = bench("counter", [], **{"routing.counter": 3})
    found.protocol(1)._random = lambda: 0.99
    for previous in range(2, 2 + copies):
        header = wire.Header(0, 1, NodeId(8), 0xFFFF, NodeId(previous), wire.Kind.DATA, 5, 1, 3, wire.FLAG_FLOOD)
        found.hear(1, header.encode() + wire.filler(20), src=previous)
    found.advance(1 * S)
    assert len(found.data(1, 8)) == relayed


def test_where_few_copies_are_heard_everyone_relays(bench: MakeBench) -> None:
    found = bench("counter", LINE, **{"routing.counter": 3})
    assert relays(found, 5) == [set(range(2, 9))] * 5


def test_a_counter_relay_waits_out_its_assessment(bench: MakeBench) -> None:
    found = bench("counter", [(1, 2)], **{"routing.assess_ms": 50})
    waits = []
    for _ in range(60):
        seq = found.send(1)
        found.advance(1 * S)
        first, second = found.data(seq, 1)
        waits.append((second.t_ns - first.t_ns - 1 * MS) / MS)
    assert 0 <= min(waits) < 10
    assert 40 < max(waits) <= 50


@pytest.mark.parametrize("protocol", ["gossip", "counter"])
def test_a_unicast_packet_floods_until_its_destination_which_does_not_relay(bench: MakeBench, protocol: str) -> None:
    found = bench(protocol, LINE, **{"routing.gossip_p": 1})
    assert relays(found, 2, destination=5) == [{2, 3, 4}] * 2
    assert {node for node, *_ in found.deliveries} == {5}


@pytest.mark.parametrize("protocol", ["gossip", "counter"])
def test_a_flood_ends_at_its_hop_limit_with_a_reason(bench: MakeBench, protocol: str) -> None:
    found = bench(protocol, LINE, **{"routing.gossip_p": 1, "routing.hop_limit": 3})
    assert relays(found, 1) == [{2, 3}]
    assert found.nodes[4].dropped["hop_limit"] == 1

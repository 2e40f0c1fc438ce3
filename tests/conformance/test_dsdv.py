"""DSDV against Perkins and Bhagwat, SIGCOMM 1994 (sections in the names): each test is a rule of the paper."""

from collections.abc import Callable

import pytest
from rival_bench import Bench

from fanet_mw.routing.dsdv.messages import FULL, INCREMENTAL, INFINITE, Advertised, Update
from fanet_mw.routing.dsdv.protocol import HOLD_NS, MAX_SETTLING_NS, PERIODIC_UPDATE_NS
from fanet_mw.routing.rival_control_messages import Family, type_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S

DUMP, NEWS = type_of(Family.DSDV, FULL), type_of(Family.DSDV, INCREMENTAL)
LINE = [(1, 2), (2, 3), (3, 4), (4, 5)]

MakeBench = Callable[..., Bench]


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    def make(nodes: int = 5, **keys: object) -> Bench:
        scenario = make_scenario(
            **{"routing.protocol": "dsdv", "nodes.count": 100, "radio.lead_ms": 0, "traffic.arrivals": "none", **keys}
        )
        return Bench(scenario, list(range(1, nodes + 1)), [link for link in LINE if max(link) <= nodes])

    return make


def tell(found: Bench, sender: int, *routes: tuple[int, int, int], kind: int = NEWS) -> None:
    """A neighbor's update: (destination, metric, number)."""
    found.say(sender, kind, Update(tuple(Advertised(*route) for route in routes)).encode(), to=1)


def told(found: Bench, number: int, *, node: int = 1, since_ns: int = 0) -> list[tuple[int, dict[int, Advertised]]]:
    """(instant, routes by destination) of the updates on the air."""
    return [
        (sent.t_ns, {route.destination: route for route in Update.decode(body).routes})
        for sent, body in found.controls(number, node=node, since_ns=since_ns)
    ]


def way(found: Bench, destination: int, node: int = 1) -> tuple[int, int, int] | None:
    """(next hop, metric, number)."""
    route = found.protocol(node)._table._routes.get(NodeId(destination))
    return None if route is None else (route.next_hop, route.metric, route.seq)


def test_a_line_of_five_converges_by_news_long_before_the_next_period_and_carries_data(bench: MakeBench) -> None:
    found = bench()
    found.advance(8 * S)
    assert way(found, 5) is not None
    assert [way(found, node)[:2] for node in (2, 3, 4, 5)] == [(2, 1), (2, 2), (2, 3), (2, 4)]  # type: ignore[index]
    seq = found.send(1, 5)
    found.advance(1 * S)
    assert found.deliveries == [(5, 1, seq, 4)]


def test_a_packet_ends_at_its_hop_limit_with_a_reason(bench: MakeBench) -> None:
    found = bench(**{"routing.hop_limit": 3})
    found.advance(60 * S)
    found.send(1, 5)
    found.advance(1 * S)
    assert not found.deliveries
    assert {node: one.dropped["hop_limit"] for node, one in found.nodes.items()} == {1: 0, 2: 0, 3: 0, 4: 1, 5: 0}


def test_control_of_another_protocol_is_malformed_whatever_it_says(bench: MakeBench) -> None:
    found = bench(2)
    tell(found, 2, (9, 1, 10), kind=type_of(Family.OLSR, INCREMENTAL))
    assert way(found, 9) is None
    assert found.nodes[1].dropped["malformed"] == 1
    tell(found, 2, (9, 1, 10))
    assert way(found, 9) is not None


def test_3_1_a_full_dump_goes_every_period_with_every_route_and_a_number_grown_by_two(bench: MakeBench) -> None:
    found = bench(3)
    found.advance(4 * PERIODIC_UPDATE_NS)
    dumps = told(found, FULL)
    assert len(dumps) == 4
    assert [routes[1].seq for _, routes in dumps] == [2, 4, 6, 8]
    assert all(set(routes) == {1, 2, 3} for _, routes in dumps[1:])
    assert dumps[1][1][1].metric == 0
    assert dumps[2][0] - dumps[1][0] == pytest.approx(PERIODIC_UPDATE_NS, abs=11 * MS)


def test_3_1_a_newer_number_wins_however_long_the_way_and_an_older_never(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 10))
    tell(found, 3, (9, 7, 12))
    assert way(found, 9) == (3, 8, 12)
    tell(found, 2, (9, 1, 10))
    assert way(found, 9) == (3, 8, 12)


def test_3_1_at_the_same_number_the_shorter_way_wins(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 3, 10))
    tell(found, 3, (9, 3, 10))
    assert way(found, 9) == (2, 4, 10)
    tell(found, 3, (9, 2, 10))
    assert way(found, 9) == (3, 3, 10)


def test_numbers_wrap(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 0xFFFF_FFFE))
    tell(found, 3, (9, 1, 0))
    assert way(found, 9) == (3, 2, 0)


def test_3_2_a_broken_link_makes_every_way_over_it_infinite_with_an_odd_number_and_is_told(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (2, 0, 20), (9, 1, 10))
    tell(found, 3, (8, 1, 10))
    found.advance(3 * S)
    broken_ns = found.now_ns
    found.send(1, 9)
    found.advance(2 * S)
    assert way(found, 9) == (2, INFINITE, 11)
    assert way(found, 2) == (2, INFINITE, 21)
    assert way(found, 8) == (3, 2, 10)
    ((t_ns, routes),) = told(found, INCREMENTAL, since_ns=broken_ns)
    assert t_ns - broken_ns < 1100 * MS
    assert routes[9] == (9, INFINITE, 11)
    assert set(routes) == {1, 2, 9}


def test_3_2_a_broken_way_is_believed_of_the_next_hop_only(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 10))
    tell(found, 3, (9, INFINITE, 11))
    assert way(found, 9) == (2, 2, 10)
    tell(found, 2, (9, INFINITE, 11))
    assert way(found, 9) == (2, INFINITE, 11)


def test_3_2_a_broken_way_is_mended_by_the_next_number_of_the_destination_only(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 10))
    tell(found, 2, (9, INFINITE, 11))
    tell(found, 3, (9, 4, 10))
    assert way(found, 9) == (2, INFINITE, 11)
    tell(found, 3, (9, 4, 12))
    assert way(found, 9) == (3, 5, 12)


def test_3_2_a_destination_called_unreachable_answers_with_a_newer_even_number_at_once(bench: MakeBench) -> None:
    found = bench(1)
    found.advance(3 * S)
    tell(found, 2, (1, INFINITE, 7))
    found.advance(1100 * MS)
    ((_, routes),) = told(found, INCREMENTAL, since_ns=3 * S)
    assert routes[1] == (1, 0, 8)


def test_a_way_that_nobody_renews_is_broken_and_later_forgotten(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 10))
    found.advance(HOLD_NS + PERIODIC_UPDATE_NS)
    assert way(found, 9) == (2, INFINITE, 11)
    found.advance(HOLD_NS + PERIODIC_UPDATE_NS)
    assert way(found, 9) is None


def test_3_3_news_is_incremental_and_a_newer_number_alone_is_none(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 1, 10), (8, 1, 10))
    found.advance(3 * S)
    tell(found, 2, (9, 1, 12))
    tell(found, 2, (7, 1, 10))
    found.advance(8 * S)
    ((_, routes),) = told(found, INCREMENTAL, since_ns=3 * S)
    assert set(routes) == {1, 7}


def test_3_4_another_metric_is_used_at_once_and_told_when_it_has_settled(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 3, 10))
    found.advance(2 * S)
    changed_ns = found.now_ns
    tell(found, 3, (9, 5, 12))
    assert way(found, 9) == (3, 6, 12)
    found.advance(100 * MS)
    tell(found, 2, (9, 3, 12))  # the better way comes a little later, as it does with every number
    assert way(found, 9) == (2, 4, 12)
    found.advance(9 * S)
    news = [routes for _, routes in told(found, INCREMENTAL, since_ns=changed_ns) if 9 in routes]
    assert not news, "the fluctuation was never told"
    found.advance(6 * S)  # beyond the full dump
    tell(found, 3, (9, 5, 14))
    settled_ns = found.now_ns
    found.advance(MAX_SETTLING_NS + 1100 * MS)
    times = [t_ns for t_ns, routes in told(found, INCREMENTAL, since_ns=settled_ns) if 9 in routes]
    assert len(times) == 1
    assert times[0] - settled_ns > 4 * S


def test_3_4_the_settling_time_learns_how_late_better_ways_come(bench: MakeBench) -> None:
    found = bench(1)
    tell(found, 2, (9, 3, 10))
    for number in range(12, 60, 2):
        tell(found, 3, (9, 5, number))
        found.advance(50 * MS)
        tell(found, 2, (9, 3, number))
    route = found.protocol(1)._table._routes[NodeId(9)]
    assert 50 * MS < route.settling_ns < 200 * MS


def test_a_packet_without_a_route_waits_at_its_origin_and_is_dropped_elsewhere(bench: MakeBench) -> None:
    found = bench(1, **{"routing.lifetime_s": 5})
    found.send(1, 9)
    found.advance(1 * S)
    found.send(1, 8)
    assert found.protocol(1).waiting() == 2
    tell(found, 2, (9, 1, 10))
    assert found.protocol(1).waiting() == 2, "one of them with the MAC now"
    found.advance(10 * S)
    assert found.nodes[1].dropped == {"retry_limit": 1, "expired": 1}


def test_a_table_larger_than_a_frame_is_told_in_several(bench: MakeBench) -> None:
    found = bench(1, **{"radio.max_frame_bytes": 256, "traffic.payload_bytes": 100})
    for sender in range(2, 90):
        tell(found, sender, (sender, 0, 10))
    found.advance(PERIODIC_UPDATE_NS + 2 * S)
    dumps = told(found, FULL, since_ns=PERIODIC_UPDATE_NS)
    assert len(dumps) > 2
    assert set().union(*(routes for _, routes in dumps)) == set(range(1, 90))

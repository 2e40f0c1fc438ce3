"""Geographic routing: greedy by position, carried while no neighbor is nearer, with a location service."""

from collections.abc import Callable

import pytest
from rival_bench import Bench

from fanet_mw import wire
from fanet_mw.routing.geographic import messages as m
from fanet_mw.routing.geographic.messages import Fix, Location, PositionBeacon, Query
from fanet_mw.routing.rival_control_messages import Family, type_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US, Enu, S

LINE = [(1, 2), (2, 3), (3, 4), (4, 5)]
"""Node n stands at east = 200 n."""

MakeBench = Callable[..., Bench]


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    def make(nodes: int = 5, links: list[tuple[int, int]] | None = None, **keys: object) -> Bench:
        scenario = make_scenario(
            **{
                "routing.protocol": "geographic", "nodes.count": 100, "radio.lead_ms": 0, "traffic.arrivals": "none",
                **keys,
            }
        )  # fmt: skip
        wanted = LINE if links is None else links
        return Bench(scenario, list(range(1, nodes + 1)), [link for link in wanted if max(link) <= nodes])

    return make


def beacon(found: Bench, node: int, east: float, *fixes: Fix) -> None:
    """A neighbor of node 1 says where it is."""
    found.say(node, type_of(Family.GEOGRAPHIC, m.BEACON), PositionBeacon(Enu(east, 0, 50), fixes).encode(), to=1)


def located(found: Bench, node: int, destination: int) -> Fix | None:
    return found.protocol(node)._locations.fix(destination)


def test_a_packet_goes_greedily_to_a_destination_that_the_location_service_finds(bench: MakeBench) -> None:
    found = bench()
    found.advance(3 * S)
    seq = found.send(1, 5)
    found.advance(2 * S)
    assert found.deliveries == [(5, 1, seq, 4)]
    assert [(sent.node, sent.dst) for sent in found.data(seq, 1)] == [(1, 2), (2, 3), (3, 4), (4, 5)]


@pytest.mark.parametrize(("nearest", "other"), [(3, 2), (2, 3)])
def test_of_several_nearer_neighbors_the_nearest_is_taken_and_none_that_is_farther(
    bench: MakeBench, nearest: int, other: int
) -> None:
    found = bench(1)
    far = Fix(9, Enu(2000, 0, 50), 0)
    found.advance(1 * S)
    beacon(found, other, 300, far._replace(t_us=1))
    beacon(found, nearest, 390)
    beacon(found, 4, -100)
    found.connect(1, nearest)
    seq = found.send(1, 9)
    found.advance(10 * MS)
    assert [sent.dst for sent in found.data(seq, 1)] == [nearest]


@pytest.mark.parametrize(("age_s", "asks"), [(9, False), (11, True)])
def test_a_location_that_is_old_is_used_and_asked_for_again(bench: MakeBench, age_s: int, asks: bool) -> None:
    found = bench(1)
    found.connect(1, 2)
    found.advance(20 * S)
    beacon(found, 2, 390, Fix(9, Enu(2000, 0, 50), (20 - age_s) * S // US))
    seq = found.send(1, 9)
    found.advance(200 * MS)
    assert [sent.dst for sent in found.data(seq, 1)] == [2]
    assert bool(found.controls(m.QUERY, node=1)) == asks


def test_where_nobody_is_nearer_the_packet_is_carried_until_somebody_comes(bench: MakeBench) -> None:
    found = bench(1)
    found.connect(1, 3)
    beacon(found, 2, 205, Fix(9, Enu(2000, 0, 50), 1))
    seq = found.send(1, 9)
    found.advance(4 * S)
    assert not found.data(seq, 1), "5 m nearer is no progress"
    assert found.protocol(1).waiting() == 1
    beacon(found, 3, 350)
    found.advance(600 * MS)
    assert [sent.dst for sent in found.data(seq, 1)] == [3]
    assert found.protocol(1).waiting() == 0


def test_a_neighbor_whose_beacons_stop_is_not_used(bench: MakeBench) -> None:
    found = bench(1)
    found.connect(1, 3)
    beacon(found, 3, 350, Fix(9, Enu(2000, 0, 50), 1))
    found.advance(2600 * MS)
    seq = found.send(1, 9)
    found.advance(1 * S)
    assert not found.data(seq, 1)


def test_a_handover_that_fails_keeps_the_packet_and_forgets_the_neighbor(bench: MakeBench) -> None:
    found = bench(1)
    found.connect(1, 2)
    beacon(found, 3, 390, Fix(9, Enu(2000, 0, 50), 1))
    beacon(found, 2, 300)
    seq = found.send(1, 9)
    found.advance(600 * MS)
    assert [sent.dst for sent in found.data(seq, 1)] == [3, 2]
    assert not found.nodes[1].dropped


def test_custody_may_come_back_but_a_packet_never_goes_back_to_whom_it_came_from(bench: MakeBench) -> None:
    found = bench(1)
    found.connect(1, 2)
    beacon(found, 2, 390, Fix(9, Enu(2000, 0, 50), 1))
    seq = found.send(1, 9)
    found.advance(1 * S)
    (sent,) = found.data(seq, 1)
    assert (sent.dst, found.protocol(1).waiting()) == (2, 0)
    beacon(found, 2, 390)
    back = wire.rewrite(sent.frame, 2, 0)
    found.hear(1, back, src=2)
    found.advance(1 * S)
    assert found.protocol(1).waiting() == 1, "neither suppressed as a duplicate nor played back"
    found.connect(1, 3)
    beacon(found, 3, 380)
    found.advance(1 * S)
    assert [s.dst for s in found.data(seq, 1)] == [2, 3]


def test_a_carried_packet_ends_with_its_lifetime(bench: MakeBench) -> None:
    found = bench(1, **{"routing.lifetime_s": 3})
    found.send(1, 9)
    found.advance(5 * S)
    assert found.nodes[1].dropped == {"expired": 1}
    assert found.protocol(1).waiting() == 0


def test_an_unknown_location_is_asked_for_now_and_then(bench: MakeBench) -> None:
    found = bench(1)
    found.send(1, 9)
    found.send(1, 9)
    found.advance(12 * S)
    asked = [Query.decode(body).wanted for _, body in found.controls(m.QUERY)]
    assert asked == [9, 9, 9]


def test_a_query_is_answered_by_whom_it_is_for_and_passed_on_by_the_others_once(bench: MakeBench) -> None:
    found = bench()
    found.send(1, 4)
    found.advance(300 * MS)
    assert sorted(sent.node for sent, _ in found.controls(m.QUERY)) == [1, 2, 3]
    answers = found.controls(m.LOCATION)
    assert {sent.header.origin for sent, _ in answers} == {4}
    assert sorted(sent.node for sent, _ in answers) == [1, 2, 3, 4, 5]
    assert Location.decode(answers[0][1]).position == Enu(800, 0, 50)


def test_a_destination_that_receives_tells_its_location_every_five_seconds(bench: MakeBench) -> None:
    found = bench(2)
    for _ in range(20):
        found.send(1, 2)
        found.advance(1 * S)
    assert len(found.controls(m.LOCATION, node=2)) in (4, 5)


def test_beacons_bring_locations_in_use_along(bench: MakeBench) -> None:
    found = bench(3, links=[(1, 2)])
    found.send(1, 2)
    found.advance(3 * S)
    assert located(found, 3, 2) is None
    found.cut(1, 2)
    found.connect(1, 3)
    found.advance(1500 * MS)
    assert located(found, 3, 2) is not None


def test_the_latest_location_is_kept_and_none_from_the_future_believed(bench: MakeBench) -> None:
    found = bench(1)
    found.advance(10 * S)
    for east, t_us in ((100, 5), (200, 7), (300, 6), (400, found.now_ns // US + 2_000_000)):
        beacon(found, 2, 0, Fix(9, Enu(east, 0, 50), t_us))
    assert located(found, 1, 9) == Fix(9, Enu(200, 0, 50), 7)

"""The timetable of collision-free floods, for all swarms: complete, causal, free of conflicts."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from fanet_mw.protocol.timetable import Geometry, Timetable, timetable
from fanet_mw.units import Enu, NodeId

Places = tuple[tuple[NodeId, Enu], ...]
COORDINATE = st.integers(0, 900).map(float)
PLACES = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=1, max_size=25).map(
    lambda at: tuple((NodeId(i + 1), Enu(east, north, 50.0)) for i, (east, north) in enumerate(at))
)
GEOMETRIES = st.builds(
    Geometry,
    link_m=st.sampled_from([250.0]),
    interference_m=st.sampled_from([250.0, 400.0, 600.0]),
    turns=st.integers(20, 900),
    hop_turns=st.integers(1, 12),
)
GRID: Places = tuple((NodeId(i + 1), Enu(200.0 * (i % 9), 200.0 * (i // 9), 50.0)) for i in range(45))


def distance(a: Enu, b: Enu) -> float:
    return math.dist(tuple(a), tuple(b))


def table_of(places: Places, geometry: Geometry, packets: int) -> Timetable | None:
    return timetable(places, tuple(node for node, _ in places for _ in range(packets)), geometry)


@settings(max_examples=150, deadline=None)
@given(PLACES, GEOMETRIES, st.integers(1, 2))
def test_nobody_who_should_hear_a_turn_is_disturbed_in_it(places: Places, geometry: Geometry, packets: int) -> None:
    table = table_of(places, geometry, packets)
    if table is None:
        return
    at = dict(places)
    by_turn: dict[int, list[NodeId]] = {}
    for turn in table.turns:
        by_turn.setdefault(turn.offset % geometry.turns, []).append(turn.node)
    for senders in by_turn.values():
        assert len(set(senders)) == len(senders), "a node sends one frame in a turn"
        for sender in senders:
            receivers = [n for n in at if n != sender and distance(at[n], at[sender]) <= geometry.link_m]
            for other in senders:
                if other != sender:
                    assert other not in receivers
                    assert all(distance(at[n], at[other]) > geometry.interference_m for n in receivers)


@settings(max_examples=150, deadline=None)
@given(PLACES, GEOMETRIES)
def test_every_flood_reaches_all_that_are_connected_and_relays_only_what_was_heard_in_time(
    places: Places, geometry: Geometry
) -> None:
    table = table_of(places, geometry, 1)
    if table is None:
        return
    at = dict(places)
    for root in at:
        turns = sorted((t for t in table.turns if t.root == root), key=lambda t: t.offset)
        assert turns[0].node == root
        heard = {root: turns[0].offset - geometry.hop_turns}
        for turn in turns:
            assert turn.offset >= heard[turn.node] + geometry.hop_turns, "it has the packet, and time to announce it"
            for node in at:
                if node not in heard and distance(at[node], at[turn.node]) <= geometry.link_m:
                    heard[node] = turn.offset
        assert set(heard) == connected(at, root, geometry.link_m)
        assert set(at) - set(heard) == set(table.uncovered[root])
        assert table.spans[root] == turns[-1].offset - turns[0].offset + 1


def connected(at: dict[NodeId, Enu], root: NodeId, link_m: float) -> set[NodeId]:
    reached, frontier = {root}, [root]
    while frontier:
        here = frontier.pop()
        near = [n for n in at if n not in reached and distance(at[n], at[here]) <= link_m]
        reached.update(near)
        frontier += near
    return reached


def test_the_table_depends_on_the_places_alone() -> None:
    geometry = Geometry(250, 250, 400, 1)
    again = timetable.__wrapped__(GRID, tuple(n for n, _ in GRID), geometry)
    assert again == table_of(GRID, geometry, 1)


def test_a_grid_of_45_needs_fewer_than_six_turns_a_packet() -> None:
    table = table_of(GRID, Geometry(250, 250, 400, 1), 1)
    assert table is not None
    assert table.used <= 6 * 45
    assert max(table.spans.values()) <= 30


def test_too_few_turns_are_no_table() -> None:
    assert table_of(GRID, Geometry(250, 250, 100, 1), 1) is None

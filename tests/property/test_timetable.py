"""The timetable of collision-free floods, for all swarms: complete, causal, free of conflicts."""

import math
from itertools import pairwise

from hypothesis import example, given
from hypothesis import strategies as st

from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort
from fanet_mw.routing.clustered.timetable.timetable import Timetable, timetable
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
    margin_m=st.just(0.0),
)
GRID: Places = tuple((NodeId(i + 1), Enu(200.0 * (i % 9), 200.0 * (i // 9), 50.0)) for i in range(45))


def distance(a: Enu, b: Enu) -> float:
    return math.dist(tuple(a), tuple(b))


def table_of(places: Places, geometry: Geometry, packets: int) -> Timetable | None:
    return timetable(places, tuple(node for node, _ in places for _ in range(packets)), geometry)


def senders_of(table: Timetable, turns: int) -> dict[int, list[NodeId]]:
    found: dict[int, list[NodeId]] = {}
    for turn in table.turns:
        found.setdefault(turn.offset % turns, []).append(turn.node)
    for node, offsets in table.spare.items():
        for offset in offsets:
            found.setdefault(offset, []).append(node)
    return found


@given(PLACES, GEOMETRIES, st.integers(1, 2), st.sampled_from([Effort(), Effort(pace=0.8, tries=3)]))
@example(GRID, Geometry(250, 250, 150, 1), 1, Effort())  # turns are scarce: as many as can share each
def test_of_those_who_share_a_turn_none_hears_another_and_who_was_deaf_is_silent_in_the_next(
    places: Places, geometry: Geometry, packets: int, effort: Effort
) -> None:
    table = timetable(places, tuple(node for node, _ in places for _ in range(packets)), geometry, (), effort)
    if table is None:
        return
    at = dict(places)
    by_turn = senders_of(table, geometry.turns)
    for turn, senders in by_turn.items():
        assert len(set(senders)) == len(senders), "a node sends one frame in a turn"
        for sender in senders:
            assert all(distance(at[sender], at[o]) > geometry.interference_m for o in senders if o != sender)
        for node in by_turn.get((turn + 1) % geometry.turns, ()):
            heard = sum(distance(at[node], at[o]) <= geometry.interference_m for o in senders if o != node)
            assert heard <= 1, "it would still wait for EIFS"


@given(PLACES, GEOMETRIES, st.sampled_from([Effort(), Effort(pace=0.8, tries=3)]), st.booleans())
@example(places=GRID, geometry=Geometry(250, 250, 150, 1), effort=Effort(), by_heads=False)
@example(places=GRID, geometry=Geometry(250, 400, 260, 2), effort=Effort(), by_heads=False)
def test_every_flood_reaches_all_that_are_connected_undisturbed_and_relays_only_what_was_heard_in_time(
    places: Places, geometry: Geometry, effort: Effort, by_heads: bool
) -> None:
    head = places[-1][0]
    heads = tuple((node, head) for node, _ in places[:-1]) if by_heads else ()
    table = timetable(places, tuple(node for node, _ in places), geometry, heads, effort)
    if table is None:
        return
    at = dict(places)
    by_turn = senders_of(table, geometry.turns)
    for root in at:
        turns = sorted((t for t in table.turns if t.root == root), key=lambda t: t.offset)
        assert turns[0].node == root
        assert len({t.node for t in turns}) == len(turns), "nobody sends a packet twice"
        heard = {root: turns[0].offset - geometry.hop_turns}
        for turn in turns:
            assert turn.offset >= heard[turn.node] + geometry.hop_turns, "it has the packet, and time to announce it"
            others = [n for n in by_turn[turn.offset % geometry.turns] if n != turn.node]
            for node in at:
                clear = node not in others and all(distance(at[node], at[o]) > geometry.interference_m for o in others)
                if node not in heard and clear and distance(at[node], at[turn.node]) <= geometry.link_m:
                    heard[node] = turn.offset
        assert set(heard) == connected(at, root, geometry.link_m)
        assert set(at) - set(heard) == set(table.uncovered[root])
        assert table.spans[root] == turns[-1].offset - turns[0].offset + 1


@given(PLACES, GEOMETRIES)
@example(GRID, Geometry(250, 250, 400, 1))
def test_in_a_turn_that_floods_leave_a_node_all_its_neighbors_hear_it(places: Places, geometry: Geometry) -> None:
    table = table_of(places, geometry, 1)
    if table is None:
        return
    at = dict(places)
    by_turn = senders_of(table, geometry.turns)
    for node, offsets in table.spare.items():
        assert table.near[node] == {o for o in at if o != node and distance(at[o], at[node]) <= geometry.link_m}
        for offset in offsets:
            others = [o for o in by_turn[offset] if o != node]
            assert not table.near[node] & set(others)
            assert all(distance(at[o], at[n]) > geometry.interference_m for o in others for n in table.near[node])


def test_floods_of_a_second_leave_each_node_of_the_grid_a_turn_every_fifteen_milliseconds() -> None:
    table = table_of(GRID, Geometry(250, 250, 375, 1), 1)
    assert table is not None
    assert min(len(offsets) for offsets in table.spare.values()) * 15 >= 375 * 1.2


def test_a_member_s_flood_goes_to_its_head_on_a_shortest_way_before_anyone_else_relays() -> None:
    corner, head = NodeId(1), NodeId(23)
    table = timetable(GRID, (corner,), Geometry(250, 250, 400, 1), ((corner, head),))
    assert table is not None
    first = [turn.node for turn in table.turns[:7]]
    assert first[0] == corner
    assert first[6] == head
    at = dict(GRID)
    assert all(distance(at[a], at[b]) <= 250 for a, b in pairwise(first))


def test_turns_of_one_root_are_evenly_spread() -> None:
    table = table_of(GRID, Geometry(250, 250, 900, 1), 2)
    assert table is not None
    for node, _ in GRID:
        first, second = (turn.offset for turn in table.roots() if turn.node == node)
        assert 430 < second - first < 470


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


def test_a_packet_on_the_grid_needs_fewer_than_three_turns_and_a_half_when_turns_are_scarce() -> None:
    assert table_of(GRID, Geometry(250, 250, 157, 1), 1) is not None


def test_where_turns_abound_a_packet_crosses_the_grid_in_little_more_than_one_turn_a_hop() -> None:
    table = table_of(GRID, Geometry(250, 250, 400, 1), 1)
    assert table is not None
    assert max(table.spans.values()) <= 16


def test_more_effort_fits_what_does_not_fit_otherwise() -> None:
    roots = tuple(node for node, _ in GRID)
    geometry = Geometry(250, 250, 122, 1)
    assert timetable(GRID, roots, geometry, (), Effort(0.9)) is None
    assert timetable(GRID, roots, geometry, (), Effort(0.8, 8)) is not None


def test_too_few_turns_are_no_table() -> None:
    assert table_of(GRID, Geometry(250, 250, 100, 1), 1) is None

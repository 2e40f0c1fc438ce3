"""Relay sets reach all nodes with fewer relays than nodes; no two copies of their schedules collide at a node."""

import pytest
from broadcast_schedule import broadcast_schedule, pipeline_spacing, shortest_relays
from dominating_sets import guha_khuller, wu_li
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.errors import LocalProtocolError
from fanet_mw.graph.connected_dominating_set import dominates
from fanet_mw.graph.multipoint_relays import WILL_ALWAYS, WILL_NEVER, multipoint_relays
from fanet_mw.graph.topology import components, levels, symmetric, two_hop, within_range
from fanet_mw.rng import stream
from fanet_mw.units import Enu, NodeId


@st.composite
def graphs(draw, most: int = 28):
    """Random disks and random graphs, ids in random order."""
    rng = stream(draw(st.integers(0, 10**6)), "graph")
    nodes = [NodeId(n) for n in rng.sample(range(1, 300), draw(st.integers(1, most)))]
    if draw(st.booleans()):
        positions = {n: Enu(rng.uniform(0, 900), rng.uniform(0, 900), 0.0) for n in nodes}
        return within_range(positions, range_m=250.0)
    share = draw(st.sampled_from([0.05, 0.15, 0.4]))
    return symmetric({a: [b for b in nodes[i + 1 :] if rng.random() < share] for i, a in enumerate(nodes)})


@given(graphs())
def test_components_cover_all_and_levels_are_hops(adjacency) -> None:
    assert sorted(n for part in components(adjacency) for n in part) == sorted(adjacency)
    for part in components(adjacency):
        hops = levels(adjacency, part[0])
        assert all(abs(hops[a] - hops[b]) <= 1 for a in part for b in adjacency[a])
        assert all(h == 0 or any(hops[b] == h - 1 for b in adjacency[a]) for a, h in hops.items())


def by_parity(adjacency):
    return wu_li(adjacency, priority={n: float(n % 7) for n in adjacency})


def induced(adjacency, nodes):
    inside = frozenset(nodes)
    return {n: tuple(m for m in adjacency[n] if m in inside) for n in sorted(inside)}


@pytest.mark.parametrize("build", [wu_li, by_parity, guha_khuller])
@given(adjacency=graphs())
def test_each_part_s_relays_are_connected_and_heard_by_all(build, adjacency) -> None:
    relays = frozenset(build(adjacency))
    assert all(n in relays or relays & set(adjacency[n]) for n in adjacency)
    assert len(components(induced(adjacency, relays))) == len(components(adjacency))


@pytest.mark.parametrize("build", [wu_li, guha_khuller])
@given(adjacency=graphs())
def test_relays_do_not_depend_on_the_order_of_the_inputs(build, adjacency) -> None:
    assert build(adjacency) == build(dict(reversed(list(adjacency.items()))))


def line(count: int):
    return symmetric({NodeId(n): [n - 1, n + 1] for n in range(1, count + 1)})


def test_of_a_line_all_but_the_ends_relay_and_of_a_full_mesh_one() -> None:
    assert wu_li(line(6)) == guha_khuller(line(6)) == (2, 3, 4, 5)
    mesh = symmetric({NodeId(n): range(1, 6) for n in range(1, 6)})
    assert len(wu_li(mesh)) == len(guha_khuller(mesh)) == 1


def test_the_stronger_of_two_equivalent_relays_is_kept() -> None:
    """1 and 4 hear everything; 2 and 3 join the ends of the square."""
    square = symmetric({1: [2, 3, 4], 2: [1, 4], 3: [1, 4], 4: [1, 2, 3]})
    assert wu_li(square) == (4,)
    assert wu_li(square, priority={NodeId(1): 1.0}) == (1,)


# --- multipoint relays ---


def beyond(node, adjacency, willing):
    return {m for n in adjacency[node] if n in willing for m in adjacency[n]} - {node, *adjacency[node]}


@given(graphs(), st.data())
def test_every_two_hop_neighbor_hears_a_multipoint_relay(adjacency, data) -> None:
    will = {n: data.draw(st.sampled_from([0, 1, 3, 3, 3, 7])) for n in adjacency}
    willing = {n for n in adjacency if will[n] != WILL_NEVER}
    for node in adjacency:
        relays = multipoint_relays(node, adjacency, willingness=will)
        assert set(relays) <= set(adjacency[node]) & willing
        assert beyond(node, adjacency, willing) <= {m for n in relays for m in adjacency[n]}
        assert all(n in relays for n in adjacency[node] if will[n] == WILL_ALWAYS)


@given(graphs())
def test_no_multipoint_relay_can_be_left_out(adjacency) -> None:
    for node in adjacency:
        relays = multipoint_relays(node, adjacency)
        far = beyond(node, adjacency, set(adjacency))
        for left_out in relays:
            assert not far <= {m for n in relays if n != left_out for m in adjacency[n]}


@given(graphs())
def test_a_node_needs_to_know_no_more_than_its_neighbors_hellos(adjacency) -> None:
    node = min(adjacency)
    known = {n: adjacency[n] for n in (node, *adjacency[node])}
    assert multipoint_relays(node, known) == multipoint_relays(node, adjacency)


@examples(25)
@given(graphs())
def test_a_flood_over_multipoint_relays_reaches_the_whole_part(adjacency) -> None:
    """A node relays if the first it heard the packet from chose it (RFC 3626, 3.4.1)."""
    chosen = {n: frozenset(multipoint_relays(n, adjacency)) for n in adjacency}
    for root in adjacency:
        heard, waiting = {root}, [root]
        while waiting:
            sender = waiting.pop(0)
            for n in adjacency[sender]:
                if n not in heard:
                    heard.add(n)
                    if n in chosen[sender]:
                        waiting.append(n)
        assert heard == set(levels(adjacency, root))


# --- schedules ---


def fly(schedule, adjacency):
    """Carry a schedule out: a node hears a sub-slot when exactly one neighbor sends and it does not send itself."""
    holding = {schedule.turns[0].node}
    sent = 0
    for subslot in range(schedule.subslots):
        senders = {turn.node for turn in schedule.turns if turn.subslot == subslot}
        assert senders <= holding, "a relay sends what it has not got"
        sent += len(senders)
        for node in adjacency:
            audible = [n for n in adjacency[node] if n in senders]
            assert len(audible) <= 1, "two copies meet"
            assert not (audible and node in senders), "a relay would defer to another"
            if audible:
                holding.add(node)
    assert sent == len(schedule.turns)
    return holding


@pytest.mark.parametrize("prune", [False, True])
@pytest.mark.parametrize("build", [lambda a, root: wu_li(a), lambda a, root: guha_khuller(a), shortest_relays])
@examples(20)
@given(adjacency=graphs(), data=st.data())
def test_a_schedule_reaches_all_of_the_root_s_part_without_collision(build, prune, adjacency, data) -> None:
    root = data.draw(st.sampled_from(sorted(adjacency)))
    schedule = broadcast_schedule(adjacency, root, build(adjacency, root), prune=prune)
    assert fly(schedule, adjacency) == set(levels(adjacency, root))


@given(graphs(), st.data())
def test_shortest_relays_keep_every_node_as_near_as_it_can_be(adjacency, data) -> None:
    root = data.draw(st.sampled_from(sorted(adjacency)))
    sending = {root, *shortest_relays(adjacency, root)}
    hops = levels(adjacency, root)
    for node, far in hops.items():
        assert far == 0 or any(hops[n] == far - 1 and n in sending for n in adjacency[node])


@given(graphs())
def test_without_pruning_every_relay_of_the_part_has_its_turn(adjacency) -> None:
    root = min(adjacency)
    part = set(levels(adjacency, root))
    everyone = broadcast_schedule(adjacency, root, tuple(adjacency), prune=False)
    assert {turn.node for turn in everyone.turns} == part
    assert all(b not in two_hop(adjacency)[a] for a, b in same_subslot(everyone))


def same_subslot(schedule):
    return [
        (a.node, b.node) for a in schedule.turns for b in schedule.turns if a.node < b.node and a.subslot == b.subslot
    ]


@examples(20)
@given(graphs(), st.data())
def test_floods_at_the_pipeline_spacing_never_meet_and_closer_ones_do(adjacency, data) -> None:
    root = data.draw(st.sampled_from(sorted(adjacency)))
    gap = data.draw(st.integers(1, 4))
    schedule = broadcast_schedule(adjacency, root, wu_li(adjacency), hop_subslots=gap)
    at = {turn.node: turn.subslot for turn in schedule.turns}
    assert all(turn.node == root or turn.subslot >= at[turn.source] + gap for turn in schedule.turns)
    spacing = pipeline_spacing(schedule, adjacency)
    assert floods_meet(schedule, adjacency, spacing) is None
    if spacing > 1:
        assert floods_meet(schedule, adjacency, spacing - 1) is not None


def floods_meet(schedule, adjacency, spacing):
    """A node that hears two floods at once, or one while it sends."""
    sending = {}
    for flood in range(schedule.subslots // spacing + 2):
        for turn in schedule.turns:
            sending.setdefault(turn.subslot + flood * spacing, []).append(turn.node)
    for senders in sending.values():
        for node in adjacency:
            if sum(1 for n in senders if n == node or n in adjacency[node]) > 1:
                return node
    return None


def test_on_a_line_relays_three_apart_share_a_sub_slot_only_when_both_have_the_packet() -> None:
    """From the middle of a line both ways run at once, after the first relays, which share a neighbor, took turns."""
    schedule = broadcast_schedule(line(7), NodeId(4), wu_li(line(7)))
    assert [(turn.subslot, turn.node) for turn in schedule.turns] == [(0, 4), (1, 3), (2, 2), (2, 5), (3, 6)]
    assert schedule.subslots == 4


def test_the_reference_grid_floods_in_fewer_sub_slots_than_nodes() -> None:
    grid = within_range(
        {NodeId(9 * y + x + 1): Enu(200.0 * x, 200.0 * y, 0) for x in range(9) for y in range(5)}, range_m=250
    )
    schedule = broadcast_schedule(grid, NodeId(23), guha_khuller(grid))
    assert fly(schedule, grid) == set(grid)
    assert len(schedule.turns) < 25
    assert schedule.subslots < 20


def test_a_root_that_is_no_node_is_our_callers_mistake() -> None:
    with pytest.raises(LocalProtocolError, match="root = 9"):
        broadcast_schedule(line(3), NodeId(9), ())


# --- each node for itself ---


def two_hops_of(node, adjacency):
    """What hellos tell: the node, its neighbors, and theirs."""
    return {n: adjacency[n] for n in (node, *adjacency[node])}


def reached(adjacency, source, relays):
    """Who hears a flood of `source` that only `relays` pass on."""
    heard, sending = {source}, [source]
    while sending:
        for n in adjacency[sending.pop()]:
            if n not in heard:
                heard.add(n)
                if n in relays:
                    sending.append(n)
    return heard


@given(graphs(), st.booleans())
def test_a_flood_reaches_everyone_over_those_who_find_that_they_dominate(adjacency, some_first) -> None:
    priority = {n: float(n % 3) for n in adjacency} if some_first else {}
    relays = {n for n in adjacency if dominates(n, two_hops_of(n, adjacency), priority=priority)}
    for part in components(adjacency):
        for source in part:
            assert reached(adjacency, source, relays) == set(part)


def test_of_a_line_all_but_the_ends_find_that_they_dominate_and_of_a_full_mesh_none() -> None:
    assert [n for n in line(6) if dominates(n, line(6))] == [2, 3, 4, 5]
    mesh = symmetric({NodeId(n): range(1, 6) for n in range(1, 6)})
    assert not any(dominates(n, mesh) for n in mesh)


def test_in_a_thin_grid_a_third_need_not_relay() -> None:
    places = {NodeId(9 * y + x + 1): Enu(200.0 * x, 200.0 * y, 0) for x in range(9) for y in range(5)}
    grid = within_range(places, range_m=250)
    assert sum(dominates(n, two_hops_of(n, grid)) for n in grid) <= 31 < len(wu_li(grid))

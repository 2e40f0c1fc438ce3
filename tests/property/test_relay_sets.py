"""Relay sets reach all nodes, whether each node decides for itself or its neighbors choose."""

from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.graph.topology import components, dominates, levels, link_sets, symmetric, within_range
from fanet_mw.rng import stream
from fanet_mw.routing.olsr.parameters import WILL_ALWAYS, WILL_NEVER
from fanet_mw.routing.olsr.protocol import multipoint_relays
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
def test_a_node_needs_to_know_no_more_than_its_neighbors_hellos(adjacency) -> None:
    node = min(adjacency)
    known = {n: adjacency[n] for n in (node, *adjacency[node])}
    assert multipoint_relays(node, known, willingness={}) == multipoint_relays(node, adjacency, willingness={})


@examples(25)
@given(graphs())
def test_a_flood_over_multipoint_relays_reaches_the_whole_part(adjacency) -> None:
    """A node relays if the first it heard the packet from chose it (RFC 3626, 3.4.1)."""
    chosen = {n: frozenset(multipoint_relays(n, adjacency, willingness={})) for n in adjacency}
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


# --- each node for itself ---


def line(count: int):
    return symmetric({NodeId(n): [n - 1, n + 1] for n in range(1, count + 1)})


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


@given(graphs())
def test_a_flood_reaches_everyone_over_those_who_find_that_they_dominate(adjacency) -> None:
    relays = {n for n in adjacency if dominates(n, link_sets(two_hops_of(n, adjacency)))}
    for part in components(adjacency):
        for source in part:
            assert reached(adjacency, source, relays) == set(part)


def test_of_a_line_all_but_the_ends_find_that_they_dominate_and_of_a_full_mesh_none() -> None:
    assert [n for n in line(6) if dominates(n, link_sets(line(6)))] == [2, 3, 4, 5]
    mesh = symmetric({NodeId(n): range(1, 6) for n in range(1, 6)})
    assert not any(dominates(n, link_sets(mesh)) for n in mesh)


def test_in_a_thin_grid_a_third_need_not_relay() -> None:
    places = {NodeId(9 * y + x + 1): Enu(200.0 * x, 200.0 * y, 0) for x in range(9) for y in range(5)}
    grid = within_range(places, range_m=250)
    assert sum(dominates(n, link_sets(two_hops_of(n, grid))) for n in grid) <= 31

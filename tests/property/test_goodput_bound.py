"""The bound on goodput: no schedule found by exhaustive search on small swarms exceeds it, nor does any timetable."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.graph.topology import components, dominates, link_sets, within_range
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.timetable import Geometry, timetable
from fanet_mw.units import Enu, NodeId, S
from sim.planner.goodput_bound import fewest_transmissions, goodput_bound


def swarm(points):
    return {NodeId(i + 1): Enu(float(x), float(y), 0.0) for i, (x, y) in enumerate(points)}


points = st.lists(st.tuples(st.integers(0, 900), st.integers(0, 600)), min_size=3, max_size=14, unique=True)


@examples(20)
@given(points, st.integers(1, 3))
def test_no_timetable_exceeds_the_bound(at, packets) -> None:
    places = swarm(at)
    adjacency = within_range(places, range_m=250)
    if len(components(adjacency)) > 1:
        return
    turns = Turns(0, S, 0, 1_000_000, 1000)
    roots = tuple(node for node in places for _ in range(packets))
    table = timetable(tuple(sorted(places.items())), roots, Geometry(250, 250, turns.per_superframe, 1))
    assert table is not None
    most = goodput_bound(adjacency, places, send_ns=turns.turn_ns, receive_ns=turns.turn_ns)
    assert len(roots) / (table.used * turns.turn_ns) * S <= most.per_second * (1 + 1e-9)


@examples(20)
@given(points)
def test_no_connected_dominating_set_is_smaller_than_the_fewest_transmissions(at) -> None:
    adjacency = within_range(swarm(at), range_m=250)
    if len(components(adjacency)) == 1:
        links = link_sets(adjacency)
        assert fewest_transmissions(adjacency) <= max(1, sum(dominates(node, links) for node in links))


def reached(line: int, senders) -> list[int | None]:
    """Whom each node of a line hears, when `senders` send in one turn: nobody, or the only neighbor that sends."""
    heard: list[int | None] = []
    for node in range(line):
        near = [n for n in (node - 1, node + 1) if n in senders]
        heard.append(near[0] if len(near) == 1 and node not in senders else None)
    return heard


@pytest.mark.parametrize("line", [3, 4])
def test_a_line_served_as_fast_as_exhaustive_search_can_is_not_above_the_bound(line) -> None:
    """One packet of each node; fewest turns until all have all, over every choice of sends."""
    start = tuple(1 << node for node in range(line))
    full = (1 << line) - 1
    layer, turns = {start}, 0
    while not any(all(have == full for have in state) for state in layer):
        turns += 1
        following = set()
        for state in layer:
            choices = [[None, *(p for p in range(line) if state[node] >> p & 1)] for node in range(line)]
            for sends in product(*choices):
                senders = {node: p for node, p in enumerate(sends) if p is not None}
                heard = reached(line, senders)
                following.add(
                    tuple(
                        have | (0 if src is None else 1 << senders[src]) for have, src in zip(state, heard, strict=True)
                    )
                )
        layer = {
            s
            for s in following
            if not any(o != s and all(a | b == b for a, b in zip(s, o, strict=True)) for o in following)
        }
    adjacency = within_range({NodeId(n + 1): Enu(200.0 * n, 0, 0) for n in range(line)}, range_m=250)
    most = goodput_bound(adjacency, list(adjacency), send_ns=1, receive_ns=1)
    assert line / turns <= most.per_second / S * (1 + 1e-9)
    assert most.per_second / S <= 2 * line / turns


def test_where_all_hear_each_other_one_frame_is_in_the_air_at_a_time() -> None:
    adjacency = within_range(swarm([(0, 0), (10, 0), (0, 10), (10, 10)]), range_m=250)
    assert goodput_bound(adjacency, list(adjacency), send_ns=100, receive_ns=100).per_second == S / 100


def test_a_swarm_in_parts_has_no_bound_on_what_reaches_everyone() -> None:
    adjacency = within_range(swarm([(0, 0), (900, 0)]), range_m=250)
    assert goodput_bound(adjacency, list(adjacency), send_ns=100, receive_ns=100) is None


@pytest.mark.parametrize(("sources", "per_second"), [((1, 2, 3, 4), 1000 / 1.75), ((2, 3), 1000 / 1.5), ((2,), 500.0)])
def test_the_end_of_a_line_is_the_bottleneck_and_needs_no_copy_of_what_its_only_neighbor_sends(
    sources: tuple[int, ...], per_second: float
) -> None:
    """L (send + (1 - s) receive) <= 1, with s the share of the packets that are the neighbor's: 1/4, 1/2 and, at the
    other end, 0 of 1.
    """
    line = within_range(swarm([(200 * node, 0) for node in range(4)]), range_m=250)
    found = goodput_bound(line, [NodeId(node) for node in sources], send_ns=1_000_000, receive_ns=1_000_000)
    assert found is not None
    assert found.per_second == pytest.approx(per_second)

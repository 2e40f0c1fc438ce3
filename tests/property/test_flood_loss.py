"""The loss stated for a timetable: exact where there is one way, never below what exact enumeration of losses gives."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.graph.topology import components, within_range
from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort
from fanet_mw.routing.clustered.timetable.timetable import timetable
from fanet_mw.units import Enu, NodeId
from sim.planner.flood_loss import loss


def swarm(points):
    return {NodeId(i + 1): Enu(float(x), float(y), 0.0) for i, (x, y) in enumerate(points)}


def planned(places, root):
    geometry = Geometry(250, 250, 100, 1)
    return timetable(tuple(sorted(places.items())), (root,), geometry), within_range(places, range_m=250)


def test_on_a_line_it_is_the_product_of_the_hops() -> None:
    table, adjacency = planned(swarm([(200 * i, 0) for i in range(4)]), NodeId(1))
    found = loss(table, adjacency, per_superframe=100, hop_turns=1, chance=lambda *_: 0.9)
    assert found.worst == pytest.approx(1 - 0.9**3)
    assert found.node == 4
    assert found.mean == pytest.approx(1 - (0.9 + 0.9**2 + 0.9**3) / 3)


points = st.lists(st.tuples(st.integers(0, 500), st.integers(0, 300)), min_size=3, max_size=5, unique=True)


@examples(20)
@given(points, st.floats(0.3, 0.99))
def test_no_node_is_missed_more_often_than_stated(at, p) -> None:
    """Every pattern of lost copies, weighted by its probability."""
    places = swarm(at)
    table, adjacency = planned(places, NodeId(1))
    if len(components(adjacency)) > 1:
        return
    found = loss(table, adjacency, per_superframe=100, hop_turns=1, chance=lambda *_: p)
    turns = sorted(table.turns)
    copies = [(turn.offset, turn.node, n) for turn in turns for n in adjacency[turn.node] if n != 1]
    if len(copies) > 9:
        return
    missed = dict.fromkeys(places, 0.0)
    for arrives in product((True, False), repeat=len(copies)):
        weight = p ** sum(arrives) * (1 - p) ** (len(copies) - sum(arrives))
        has = {NodeId(1)}
        for (_, sender, node), ok in zip(copies, arrives, strict=True):
            if ok and sender in has:
                has.add(node)
        for node in places:
            missed[node] += 0.0 if node in has else weight
    assert max(missed.values()) <= found.worst + 1e-9
    assert sum(missed.values()) / (len(places) - 1) <= found.mean + 1e-9


def test_who_sends_in_the_same_turn_counts_as_interference() -> None:
    places = swarm([(200 * i, 0) for i in range(7)])
    table = timetable(
        tuple(sorted(places.items())), (NodeId(1), NodeId(7)), Geometry(250, 250, 12, 1), (), Effort(pace=0.0)
    )
    asked = set()

    def chance(_sender, _receiver, others) -> float:
        asked.add(others)
        return 1.0

    found = loss(table, within_range(places, range_m=250), per_superframe=12, hop_turns=1, chance=chance)
    assert found.worst == 0
    assert any(others for others in asked)

"""The contract of every clustering method, over random swarms; and what tells the methods apart, by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mobic import MOBIC, aggregate_mobility_db2, by_mobility

from fanet_mw.graph.topology import symmetric, within_range
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.clustering import (
    HIGHEST_DEGREE,
    LOWEST_ID,
    AffinityPropagation,
    Balanced,
    Cluster,
    Clustering,
    Elected,
    LastingDegree,
    Maintenance,
    Swarm,
    Weights,
    by_id,
    heads_of,
    link_lifetime_s,
)
from fanet_mw.units import Enu, NodeId, S

RANGE_M = 250.0
METHODS: dict[str, Clustering] = {
    "balanced": Balanced(4),
    "lowest_id": LOWEST_ID,
    "highest_degree": HIGHEST_DEGREE,
    "wca": Elected(Weights(RANGE_M)),
    "mobic": MOBIC,
    "lasting": Elected(LastingDegree(RANGE_M)),
    "sticky": Elected(by_id, keep=3.0),
    "sticky_forever": Elected(by_mobility, keep=math.inf),
    "affinity": AffinityPropagation(RANGE_M),
    "affinity_many": AffinityPropagation(RANGE_M, preference=-0.05, damping=0.5, rounds=40),
}


def node_ids(rng, count):
    return [NodeId(n) for n in rng.sample(range(1, 200), count)]


@st.composite
def swarms(draw) -> Swarm:
    rng = stream(draw(st.integers(0, 10**6)), "swarm")
    nodes = node_ids(rng, draw(st.integers(0, 30)))
    side = draw(st.sampled_from([1.0, 300.0, 900.0, 3000.0]))
    step = draw(st.sampled_from([0.0, 100.0]))  # on a grid distances tie, and places coincide

    def coordinate() -> float:
        at = rng.uniform(0, side)
        return at // step * step if step else at

    positions = {n: Enu(coordinate(), coordinate(), rng.uniform(0, 50)) for n in nodes}
    adjacency = within_range(positions, range_m=RANGE_M)
    known = [n for n in nodes if rng.random() < 0.7]
    before = LOWEST_ID.divide(Swarm(positions, adjacency)) if draw(st.booleans()) else []
    if before and draw(st.booleans()):  # heads that stood elsewhere
        before = [Cluster(NodeId(c.head + 1), c.members) for c in before]
    return Swarm(
        positions,
        adjacency,
        energy={n: rng.random() for n in known},
        mobility={n: rng.choice([0.0, 1.0, rng.random()]) for n in known},
        velocities={n: Enu(rng.uniform(-9, 9), rng.uniform(-9, 9), 0.0) for n in known},
        previous=before,
    )


def shuffled(swarm: Swarm) -> Swarm:
    def turn(mapping):
        return dict(reversed(list(mapping.items())))

    return Swarm(*(turn(field) for field in swarm[:5]), previous=swarm.previous[::-1])


@pytest.mark.parametrize("name", METHODS)
@given(swarm=swarms())
def test_every_node_is_in_one_cluster_and_each_head_is_a_member(name: str, swarm: Swarm) -> None:
    clusters = METHODS[name].divide(swarm)
    assert sorted(n for c in clusters for n in c.members) == sorted(swarm.positions)
    assert all(c.head in c.members and list(c.members) == sorted(c.members) for c in clusters)


@pytest.mark.parametrize("name", METHODS)
@given(swarm=swarms())
def test_the_order_of_the_inputs_does_not_matter(name: str, swarm: Swarm) -> None:
    assert METHODS[name].divide(swarm) == METHODS[name].divide(shuffled(swarm))


@pytest.mark.parametrize("name", METHODS)
@given(swarm=swarms())
def test_heads_are_what_the_method_promises(name: str, swarm: Swarm) -> None:
    method = METHODS[name]
    clusters = method.divide(swarm)
    heads = set(heads_of(clusters))
    if method.promise.dominating:
        assert all(n == c.head or c.head in swarm.adjacency[n] for c in clusters for n in c.members)
    if method.promise.independent:
        assert not any(n in heads for head in heads for n in swarm.adjacency[head])


@given(swarms())
def test_heads_that_stand_and_do_not_meet_are_kept_by_infinite_hysteresis(swarm: Swarm) -> None:
    before = LOWEST_ID.divide(swarm._replace(previous=()))
    after = Elected(by_mobility, keep=math.inf).divide(swarm._replace(previous=before))
    assert after == before


# --- by hand ---


def line(count: int, *, spacing_m: float = 200.0, **fields) -> Swarm:
    positions = {NodeId(n): Enu(spacing_m * n, 0.0, 0.0) for n in range(1, count + 1)}
    return Swarm(positions, within_range(positions, range_m=RANGE_M), **fields)


def test_lowest_id_takes_every_other_node_of_a_line() -> None:
    assert heads_of(LOWEST_ID.divide(line(6))) == (1, 3, 5)


def test_highest_degree_takes_the_middle_of_a_star() -> None:
    adjacency = symmetric({1: [4], 2: [4], 3: [4], 4: [1, 2, 3]})
    swarm = Swarm(dict.fromkeys(adjacency, Enu(0, 0, 0)), adjacency)
    assert heads_of(HIGHEST_DEGREE.divide(swarm)) == (4,)
    assert heads_of(LOWEST_ID.divide(swarm)) == (1, 2, 3)


def test_mobic_takes_the_calm_and_wca_the_charged() -> None:
    assert heads_of(MOBIC.divide(line(3, mobility={1: 5.0, 2: 1.0, 3: 9.0}))) == (2,)
    weights = Weights(RANGE_M, degree=0, distance=0, mobility=0, energy=1)
    assert heads_of(Elected(weights).divide(line(3, energy={1: 0.2, 2: 0.3, 3: 0.9}))) == (1, 3)


def test_wca_s_weight_is_the_sum_of_its_four_terms() -> None:
    swarm = line(3, mobility={2: 4.0}, energy={2: 0.25})
    expected = 0.7 * abs(2 - 10) + 0.2 * 400 / 250 + 0.05 * 4.0 + 0.05 * 0.75
    assert math.isclose(Weights(RANGE_M)(NodeId(2), swarm), expected)


def test_a_head_is_kept_while_no_candidate_is_better_by_the_margin() -> None:
    before = [Cluster(NodeId(2), (NodeId(1), NodeId(2), NodeId(3)))]
    mobility = {1: 1.0, 2: 3.0, 3: 9.0}
    assert heads_of(Elected(by_mobility, keep=2.5).divide(line(3, mobility=mobility, previous=before))) == (2,)
    assert heads_of(Elected(by_mobility, keep=1.5).divide(line(3, mobility=mobility, previous=before))) == (1, 3)


def test_affinity_finds_the_middle_of_two_groups() -> None:
    """Two plus signs, far apart: each arm is nearest to its own middle."""
    arms = [(0, 0), (150, 0), (-150, 0), (0, 150), (0, -150)]
    places = [(x, y) for x, y in arms] + [(x + 2000, y) for x, y in arms]
    positions = {NodeId(n + 1): Enu(float(x), float(y), 0.0) for n, (x, y) in enumerate(places)}
    swarm = Swarm(positions, within_range(positions, range_m=RANGE_M))
    assert heads_of(AffinityPropagation(RANGE_M).divide(swarm)) == (1, 6)


def exemplars_by_matrix(swarm: Swarm, method: AffinityPropagation) -> set[int]:
    """Frey and Dueck (Science 315, 2007), equations 1 to 3, over whole matrices; beyond the range nothing is alike."""
    nodes = sorted(swarm.adjacency)
    s = np.full((len(nodes), len(nodes)), -np.inf)
    for i, node in enumerate(nodes):
        s[i, i] = method.preference * (1 + i * 1e-6)
        for k, other in enumerate(nodes):
            if other in swarm.adjacency[node]:
                s[i, k] = -(math.dist(swarm.positions[node], swarm.positions[other]) ** 2) / RANGE_M**2
    r, a = np.zeros_like(s), np.zeros_like(s)
    for _ in range(method.rounds):
        sums = a + s
        rivals = np.array([[np.delete(row, k).max() for k in range(len(nodes))] for row in sums])
        r = method.damping * r + (1 - method.damping) * np.where(np.isfinite(s), s - rivals, 0.0)
        support = np.maximum(r, 0.0)
        np.fill_diagonal(support, 0.0)
        others = support.sum(axis=0)
        fresh = np.minimum(0.0, np.diag(r) + others - support)
        np.fill_diagonal(fresh, others)
        a = method.damping * a + (1 - method.damping) * fresh
    return {nodes[k] for k in np.flatnonzero(np.diag(r) + np.diag(a) > 0)}


@pytest.mark.parametrize("seed", range(4))
def test_affinity_propagation_follows_its_equations(seed: int) -> None:
    random = stream(seed, "affinity")
    positions = {NodeId(n): Enu(random.uniform(0, 500), random.uniform(0, 500), 0.0) for n in range(1, 17)}
    swarm = Swarm(positions, within_range(positions, range_m=RANGE_M))
    method = AffinityPropagation(RANGE_M, rounds=60, settled=60)
    assert exemplars_by_matrix(swarm, method) <= set(heads_of(method.divide(swarm)))
    assert len(exemplars_by_matrix(swarm, method)) > 1


def test_two_heads_that_meet_keep_their_clusters_for_the_contention_interval() -> None:
    apart = {NodeId(1): Enu(0, 0, 0), NodeId(2): Enu(900, 0, 0), NodeId(3): Enu(100, 0, 0), NodeId(4): Enu(1000, 0, 0)}
    near = {**apart, NodeId(2): Enu(200, 0, 0), NodeId(4): Enu(300, 0, 0)}
    swarms_ = [Swarm(p, within_range(p, range_m=RANGE_M)) for p in (apart, near)]
    clusters = Maintenance(by_id, keep=math.inf, contention_ns=4 * S)
    assert heads_of(clusters.step(swarms_[0], now_ns=0)) == (1, 2)
    assert heads_of(clusters.step(swarms_[1], now_ns=1 * S)) == (1, 2)
    assert heads_of(clusters.step(swarms_[1], now_ns=4 * S)) == (1, 2)
    assert heads_of(clusters.step(swarms_[1], now_ns=5 * S)) == (1, 4)


def test_a_patient_head_stays_while_a_member_hears_no_other() -> None:
    apart = {NodeId(n): Enu(at, 0, 0) for n, at in ((1, 0.0), (2, 600.0), (3, 700.0))}
    near = {**apart, NodeId(2): Enu(200.0, 0, 0), NodeId(3): Enu(400.0, 0, 0)}
    passed = {**near, NodeId(3): Enu(100.0, 0, 0)}
    clusters = Maintenance(by_id, keep=math.inf, contention_ns=0, patient=True)
    steps = [Swarm(p, within_range(p, range_m=RANGE_M)) for p in (apart, near, passed)]
    assert [heads_of(clusters.step(s, now_ns=n * S)) for n, s in enumerate(steps)] == [(1, 2), (1, 2), (1,)]


def test_relative_mobility_is_the_mean_square_of_the_change_of_power() -> None:
    assert aggregate_mobility_db2([(-60.0, -57.0), (-70.0, -71.0)]) == 5.0
    assert aggregate_mobility_db2([]) == 0.0


def test_a_link_lasts_until_the_distance_is_the_range() -> None:
    swarm = line(2, velocities={NodeId(2): Enu(10.0, 0.0, 0.0)})
    assert math.isclose(link_lifetime_s(swarm, NodeId(1), NodeId(2), range_m=250), 5.0)
    assert math.isclose(link_lifetime_s(swarm, NodeId(2), NodeId(1), range_m=250), 5.0)
    still = line(2, velocities=dict.fromkeys([NodeId(1), NodeId(2)], Enu(7.0, 1.0, 0.0)))
    assert math.isinf(link_lifetime_s(still, NodeId(1), NodeId(2), range_m=250))

"""How the leader carries clusters on from one assignment to the next, and what joins tell it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.graph.topology import within_range
from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.clustering import Balanced, Cluster, Swarm
from fanet_mw.routing.clustered.clustering.division import Division, carried_on, cost, drift
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader_election import Authority, Lease
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates
from fanet_mw.units import Enu, NodeId, S

RANGE_M = 250.0


def swarm_of(places: dict[int, float]) -> Swarm:
    at = {NodeId(node): Enu(east, 0.0, 50.0) for node, east in places.items()}
    return Swarm(at, within_range(at, range_m=RANGE_M))


def names(*nodes: int) -> tuple[NodeId, ...]:
    return tuple(map(NodeId, nodes))


PRESENT = [Cluster(NodeId(3), names(2, 3, 4)), Cluster(NodeId(6), names(5, 6, 7))]
LINE = {node: 200.0 * node for node in range(2, 8)}


def test_what_is_good_enough_stays() -> None:
    division = Division("balanced", count=2, range_m=RANGE_M)
    assert division.renew(PRESENT, swarm_of(LINE), {}) == PRESENT


def test_clusters_that_are_as_good_as_new_ones_stay_though_new_ones_would_be_others() -> None:
    """Where everyone hears everyone, any three and three are as good as any others."""
    crowd = swarm_of({node: 10.0 * node for node in range(2, 8)})
    mixed = [Cluster(NodeId(4), names(2, 4, 6)), Cluster(NodeId(5), names(3, 5, 7))]
    assert Division("balanced", count=2, range_m=RANGE_M).renew(mixed, crowd, {}) == mixed


def test_a_member_that_is_cut_off_from_its_head_goes_to_the_cluster_that_it_hears() -> None:
    apart = LINE | {4: 950.0, 5: 1150.0, 6: 1350.0, 7: 1550.0, 2: 500.0, 3: 700.0}
    torn = [Cluster(NodeId(3), names(2, 3, 7)), Cluster(NodeId(5), names(4, 5, 6))]
    assert [cluster.members for cluster in carried_on(torn, swarm_of(apart), {})] == [names(2, 3), names(4, 5, 6, 7)]


@pytest.mark.parametrize(("moves_m", "stays"), [(610.0, True), (810.0, False)])
def test_who_hears_its_head_over_others_only_stays_unless_another_head_is_clearly_nearer(
    moves_m: float, stays: bool
) -> None:
    """2 has flown over to the members of 5: its own head is two hops away from there, or three, and 5 one."""
    torn = [Cluster(NodeId(3), names(2, 3)), Cluster(NodeId(5), names(4, 5, 6))]
    places = {3: 200.0, 4: 400.0, 5: 600.0, 6: 800.0, 2: moves_m}
    assert (2 in carried_on(torn, swarm_of(places), {})[0].members) == stays


def test_clusters_that_share_the_load_badly_are_made_anew() -> None:
    uneven = [Cluster(NodeId(3), names(2, 3, 4, 5)), Cluster(NodeId(6), names(6, 7))]
    clusters = Division("balanced", count=2, range_m=RANGE_M).renew(uneven, swarm_of(LINE), {})
    assert [len(cluster.members) for cluster in clusters] == [3, 3]


def test_a_head_that_is_gone_is_followed_by_who_stands_in_for_it() -> None:
    places = {node: east for node, east in LINE.items() if node != 3}
    assert carried_on(PRESENT, swarm_of(places), {NodeId(3): NodeId(4)})[0] == Cluster(NodeId(4), names(2, 4))


def test_a_newcomer_goes_to_the_nearest_head() -> None:
    kept = carried_on(PRESENT, swarm_of({**LINE, 8: 1300.0}), {})
    assert kept[1].members == names(5, 6, 7, 8)


def test_clusters_that_have_mixed_are_made_anew_and_heads_keep_their_slots() -> None:
    swarm = swarm_of({**LINE, 2: LINE[7], 7: LINE[2]})
    clusters = Division("balanced", count=2, range_m=RANGE_M).renew(PRESENT, swarm, {})
    assert [cluster.head for cluster in clusters] == [3, 6]
    assert [cluster.members for cluster in clusters] == [names(3, 4, 7), names(2, 5, 6)]


@given(
    st.dictionaries(st.integers(2, 20), st.floats(0, 2000), min_size=1),
    st.dictionaries(st.integers(2, 20), st.floats(0, 2000), min_size=1),
)
def test_everyone_is_in_one_cluster_whatever_came_before(before: dict[int, float], after: dict[int, float]) -> None:
    division = Division("balanced", count=3, range_m=RANGE_M)
    first = division.renew([], swarm_of(before), {})
    second = division.renew(first, swarm_of(after), {})
    assert sorted(node for cluster in second for node in cluster.members) == sorted(after)
    assert all(cluster.head in cluster.members for cluster in second)
    assert len({cluster.head for cluster in second}) == len(second)
    assert len(second) == min(3, len(after))


def test_a_member_without_a_way_costs_as_much_as_there_are_nodes() -> None:
    swarm = swarm_of({2: 0.0, 3: 200.0, 4: 5000.0})
    assert cost([Cluster(NodeId(2), names(2, 3, 4))], swarm.adjacency, fair=3) == 1 + 3


def test_a_swarm_that_moves_as_one_does_not_drift() -> None:
    moved = {node: east + 999 for node, east in LINE.items()}
    assert drift(swarm_of(LINE).adjacency, swarm_of(moved).adjacency) == 0
    assert drift(swarm_of(LINE).adjacency, swarm_of({**LINE, 7: 5000.0}).adjacency) == 1 / 5


# --- telling ------------------------------------------------------------------------------------------------------


def test_who_flies_on_straight_tells_nothing_and_who_turns_does_once_it_is_off() -> None:
    told = PositionUpdates(range_m=250)
    told.on_update(Motion(Enu(0, 0, 0), Enu(10, 0, 0), 0))
    told.on_flooding(10 * S)
    assert not told.outdated(Enu(100, 0, 0), now_ns=10 * S)
    assert not told.outdated(Enu(100, 25, 0), now_ns=10 * S)
    assert told.outdated(Enu(100, 26, 0), now_ns=10 * S)
    assert not told.outdated(Enu(0, 99, 0), now_ns=4 * S), "at most every 5 s"


def test_who_is_quiet_shows_that_it_lives() -> None:
    told = PositionUpdates(range_m=250)
    told.on_update(Motion(Enu(0, 0, 0), Enu(0, 0, 0), 0))
    assert not told.outdated(Enu(0, 0, 0), now_ns=20 * S)
    assert told.outdated(Enu(0, 0, 0), now_ns=20 * S + 1)


# --- whom to obey -------------------------------------------------------------------------------------------------

authorities = st.builds(Authority, st.integers(0, 5), st.integers(1, 5))


@given(st.lists(st.tuples(authorities, st.integers(0, 3)), min_size=1))
def test_while_all_are_heard_the_senior_of_them_is_obeyed(heard: list[tuple[Authority, int]]) -> None:
    lease = Lease(NodeId(9), period_ns=S, liveness=Liveness())
    for authority, delay_s in heard:
        lease.accept(authority, born_ns=10 * S - delay_s * S, now_ns=10 * S)
    assert lease.authority == min(authority for authority, _ in heard)


def test_old_news_of_a_leader_keep_nobody_obedient() -> None:
    lease = Lease(NodeId(9), period_ns=S, liveness=Liveness())
    assert lease.accept(Authority(0, 1), born_ns=10 * S, now_ns=10 * S)
    assert not lease.accept(Authority(3, 2), born_ns=14 * S, now_ns=14 * S)
    assert not lease.accept(Authority(0, 1), born_ns=9 * S, now_ns=15 * S)
    assert lease.accept(Authority(3, 2), born_ns=15 * S, now_ns=15 * S)


@pytest.mark.parametrize(("link_m", "range_m"), [(120.0, 120.0), (0.0, 250.0)])
def test_a_method_of_another_package_is_told_how_long_the_links_of_the_clusters_are(
    make_scenario, monkeypatch: pytest.MonkeyPatch, link_m: float, range_m: float
) -> None:
    told: list[float] = []

    def make(_key: str, _name: str, *, range_m: float, **_: object) -> Balanced:
        told.append(range_m)
        return Balanced(2)

    monkeypatch.setattr("fanet_mw.routing.clustered.clustering.division.make", make)
    scenario = make_scenario(**{"clusters.link_m": link_m, "radio.range_m": 250.0})
    clusters = scenario.clusters.model_copy(update={"method": "another"})
    Division.of(scenario.model_copy(update={"clusters": clusters}))
    assert told == [range_m]

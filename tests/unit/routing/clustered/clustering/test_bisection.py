"""Balanced clusters by position."""

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.graph.topology import components, levels, within_range
from fanet_mw.routing.clustered.clustering import balanced
from fanet_mw.routing.clustered.clustering.bisection import among
from fanet_mw.units import Enu, NodeId

places = st.builds(Enu, *[st.floats(-5000, 5000, allow_nan=False)] * 3)


@given(positions=st.dictionaries(st.integers(1, 500).map(NodeId), places, max_size=60), count=st.integers(1, 70))
def test_every_node_is_in_exactly_one_cluster_and_sizes_differ_by_at_most_one(
    positions: dict[NodeId, Enu], count: int
) -> None:
    links = within_range(positions, range_m=250)
    clusters = balanced(positions, links, count=count)
    members = [node for cluster in clusters for node in cluster.members]
    assert sorted(members) == sorted(positions)
    assert len(clusters) == min(count, len(positions))
    assert all(cluster.head in cluster.members for cluster in clusters)
    if clusters and len(components(links)) > 1:
        sizes = [len(cluster.members) for cluster in clusters]
        assert max(sizes) - min(sizes) <= 1
    if len(components(links)) == 1:
        assert all(len(components(among(cluster.members, links))) == 1 for cluster in clusters)


@given(
    places=st.lists(st.tuples(st.floats(0, 900), st.floats(0, 900)), min_size=8, max_size=45, unique=True),
    count=st.integers(1, 8),
)
def test_clusters_of_a_connected_swarm_are_connected(places: list[tuple[float, float]], count: int) -> None:
    positions = {NodeId(n): Enu(east, north, 0) for n, (east, north) in enumerate(places, 1)}
    links = within_range(positions, range_m=300)
    if len(components(links)) == 1:
        clusters = balanced(positions, links, count=count)
        assert [len(components(among(cluster.members, links))) for cluster in clusters] == [1] * count


def test_two_lines_and_a_chain_are_cut_along_the_links() -> None:
    """A cut by position would put the west ends of both lines, 1.6 km apart by radio, into one cluster."""
    places = [(200 * k, 0) for k in range(-4, 5)] + [(200 * k, 600) for k in range(-4, 5)] + [(0, 200), (0, 400)]
    positions = {NodeId(n): Enu(east, north, 50) for n, (east, north) in enumerate(places, 1)}
    links = within_range(positions, range_m=250)
    clusters = balanced(positions, links, count=4)
    assert [len(components(among(cluster.members, links))) for cluster in clusters] == [1, 1, 1, 1]
    assert sorted(len(cluster.members) for cluster in clusters) == [4, 4, 6, 6]
    for cluster in clusters:
        hops = levels(among(cluster.members, links), cluster.head)
        assert max(hops.values()) <= 3


def test_a_line_of_six_in_two_clusters_is_cut_in_the_middle() -> None:
    positions = {NodeId(n): Enu(100.0 * n, 0, 0) for n in range(1, 7)}
    west, east = balanced(positions, within_range(positions, range_m=250), count=2)
    assert (west.members, west.head) == ((1, 2, 3), 2)
    assert (east.members, east.head) == ((4, 5, 6), 5)


def test_the_head_of_a_bent_cluster_is_near_all_by_hops_and_not_by_place() -> None:
    places = [(0, 400), (0, 200), (0, 0), (200, 0), (400, 0), (400, 200), (250, 230)]
    positions = {NodeId(n): Enu(east, north, 50) for n, (east, north) in enumerate(places, 1)}
    (cluster,) = balanced(positions, within_range(positions, range_m=210), count=1)
    assert cluster.head == 4, "7 is nearest to the middle, and six hops from 1"

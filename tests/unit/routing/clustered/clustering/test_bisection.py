"""Balanced clusters by position."""

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.routing.clustered.clustering import balanced
from fanet_mw.units import Enu, NodeId

places = st.builds(Enu, *[st.floats(-5000, 5000, allow_nan=False)] * 3)


@given(positions=st.dictionaries(st.integers(1, 500).map(NodeId), places, max_size=60), count=st.integers(1, 70))
def test_every_node_is_in_exactly_one_cluster_and_sizes_differ_by_at_most_one(
    positions: dict[NodeId, Enu], count: int
) -> None:
    clusters = balanced(positions, count=count)
    members = [node for cluster in clusters for node in cluster.members]
    assert sorted(members) == sorted(positions)
    assert len(clusters) == min(count, len(positions))
    assert all(cluster.head in cluster.members for cluster in clusters)
    if clusters:
        sizes = [len(cluster.members) for cluster in clusters]
        assert max(sizes) - min(sizes) <= 1


def test_a_line_of_six_in_two_clusters_is_cut_in_the_middle() -> None:
    positions = {NodeId(n): Enu(100.0 * n, 0, 0) for n in range(1, 7)}
    west, east = balanced(positions, count=2)
    assert (west.members, west.head) == ((1, 2, 3), 2)
    assert (east.members, east.head) == ((4, 5, 6), 5)

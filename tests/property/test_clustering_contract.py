"""The contract of clustering methods, over random swarms, for the one of this package."""

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.graph.topology import within_range
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.clustering import Balanced, Cluster, Swarm
from fanet_mw.units import Enu, NodeId

METHOD = Balanced(4)


@st.composite
def swarms(draw) -> Swarm:
    rng = stream(draw(st.integers(0, 10**6)), "swarm")
    nodes = [NodeId(n) for n in rng.sample(range(1, 200), draw(st.integers(0, 30)))]
    side = draw(st.sampled_from([1.0, 300.0, 900.0, 3000.0]))
    step = draw(st.sampled_from([0.0, 100.0]))  # on a grid distances tie, and places coincide

    def coordinate() -> float:
        at = rng.uniform(0, side)
        return at // step * step if step else at

    positions = {n: Enu(coordinate(), coordinate(), rng.uniform(0, 50)) for n in nodes}
    previous = [Cluster(NodeId(n + 1), (n,)) for n in nodes[:3]]  # heads that stood elsewhere
    return Swarm(positions, within_range(positions, range_m=250.0), previous=previous)


@given(swarm=swarms())
def test_every_node_is_in_one_cluster_and_each_head_is_a_member(swarm: Swarm) -> None:
    clusters = METHOD.divide(swarm)
    assert sorted(n for c in clusters for n in c.members) == sorted(swarm.positions)
    assert all(c.head in c.members and list(c.members) == sorted(c.members) for c in clusters)


@given(swarm=swarms())
def test_the_order_of_the_inputs_does_not_matter(swarm: Swarm) -> None:
    positions, adjacency = (dict(reversed(list(each.items()))) for each in swarm[:2])
    assert METHOD.divide(swarm) == METHOD.divide(Swarm(positions, adjacency, previous=swarm.previous[::-1]))

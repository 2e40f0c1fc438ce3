"""Time synchronization: all nodes that hear the reference get its time, with an error within what they state."""

from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.scenario import Clock
from fanet_mw.units import MS
from tests.property.time_network import Network, connected, depth

clocks = st.builds(
    Clock,
    sync=st.just("beacons"),
    offset_ms=st.sampled_from([0.0, 50.0, 1000.0]),
    drift_ppm=st.sampled_from([1.0, 20.0, 50.0]),
    wander_ppm=st.sampled_from([0.0, 0.02]),
)


@examples(20)
@given(clocks, st.integers(2, 14), st.integers(0, 10), st.integers(0, 10**6), st.sampled_from([0.0, 0.1, 0.3]))
def test_on_any_connected_graph_all_are_within_the_bound_they_state(
    clock: Clock, count: int, extra: int, seed: int, loss: float
) -> None:
    """With up to 3 of 10 hellos lost on every link, from 20 s and some seconds a hop on."""
    links = connected(count, extra, seed)
    network = Network(links, clock, seed=seed, loss=loss)
    begin = 20 + int((6 + 3 * depth(links)) / (1 - loss))
    for second in range(begin, begin + 30, 5):
        network.run(second)
        followed = {node: m.sync.reference for node, m in network.members.items()}
        assert set(followed.values()) == {1}
        for error_ns, bound_ns in network.errors().values():
            assert bound_ns is not None
            assert error_ns <= bound_ns < 50 * MS


@examples(10)
@given(clocks, st.integers(0, 10**6))
def test_the_same_seed_gives_the_same_times(clock: Clock, seed: int) -> None:
    links = connected(6, 3, seed)
    first, second = (Network(links, clock, seed=seed, loss=0.2) for _ in range(2))
    first.run(30)
    second.run(30)
    assert first.errors() == second.errors()

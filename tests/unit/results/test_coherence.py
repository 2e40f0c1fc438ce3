"""How well a swarm hangs together, against networkx-free brute force on small random graphs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sim.results.coherence import Coherence, Flags, coherence


def pieces(near: Flags) -> int:
    left, found = set(range(len(near))), 0
    while left:
        found, waiting = found + 1, [left.pop()]
        while waiting:
            others = left & set(np.flatnonzero(near[waiting.pop()]).tolist())
            left -= others
            waiting += others
    return found


graphs = st.builds(
    lambda count, share, seed: _symmetric(np.random.default_rng(seed).random((count, count)) < share),
    st.integers(0, 12), st.floats(0, 0.6), st.integers(0, 2**32),
)  # fmt: skip


def _symmetric(near: Flags) -> Flags:
    upper = np.triu(near, 1)
    return np.asarray(upper | upper.T | np.eye(len(near), dtype=bool))


@given(graphs)
def test_it_is_what_removing_each_and_counting_hops_gives(near: Flags) -> None:
    count, whole = len(near), pieces(near)
    others = [np.delete(np.arange(count), node) for node in range(count)]
    cuts = sum(pieces(near[np.ix_(rest, rest)]) > whole - (near[node].sum() == 1) for node, rest in enumerate(others))
    hops = np.where(near, 1.0, np.inf)
    np.fill_diagonal(hops, 0)
    for between in range(count):
        hops = np.minimum(hops, hops[:, between, None] + hops[None, between])
    diameter = int(hops[np.isfinite(hops)].max()) if count else 0
    assert coherence(near) == Coherence(whole <= 1, diameter, cuts)


def test_a_row_hangs_by_all_but_its_ends_and_a_ring_by_nobody() -> None:
    row = np.abs(np.subtract.outer(np.arange(9), np.arange(9))) <= 1
    ring = row.copy()
    ring[0, 8] = ring[8, 0] = True
    assert coherence(row) == Coherence(connected=True, diameter=8, cut_vertices=7)
    assert not coherence(row).biconnected
    assert coherence(ring) == Coherence(connected=True, diameter=4, cut_vertices=0)
    assert coherence(ring).biconnected

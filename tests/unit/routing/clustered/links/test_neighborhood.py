"""What hellos say of two hops: links that both ends confirm, and neighbors as long as they speak."""

import pytest

from fanet_mw.routing.clustered.links.neighborhood import Neighborhood
from fanet_mw.units import NodeId, S
from fanet_mw.wire.hello.claims import Claims, HeardNeighbor, SlotStatus

US, LIFETIME_NS = NodeId(1), 3 * S
NO_SLOT = SlotStatus()


def hello(node: int, *neighbors: int) -> Claims:
    return Claims(NodeId(node), NO_SLOT, tuple(HeardNeighbor(NodeId(n), NO_SLOT, hears_us=True) for n in neighbors))


@pytest.fixture
def near() -> Neighborhood:
    return Neighborhood(US, lifetime_ns=LIFETIME_NS)


def test_a_link_counts_when_both_ends_say_so(near: Neighborhood) -> None:
    near.on_claims(hello(2, 1, 3), now_ns=0)
    near.on_claims(hello(4, 5), now_ns=0)
    assert near.adjacency(now_ns=0) == {1: (2,), 2: (1, 3)}, "node 4 does not hear us"
    assert [(h.node, h.hears_us) for h in near.heard(now_ns=0)] == [(2, True), (4, False)]


def test_a_neighbor_is_one_as_long_as_it_speaks(near: Neighborhood) -> None:
    near.on_claims(hello(2, 1), now_ns=0)
    near.on_claims(hello(3, 1), now_ns=2 * S)
    assert [claims.node for claims in near.alive(now_ns=LIFETIME_NS)] == [2, 3]
    assert [claims.node for claims in near.alive(now_ns=LIFETIME_NS + 1)] == [3]
    assert near.adjacency(now_ns=LIFETIME_NS + 1) == {1: (3,), 3: (1,)}

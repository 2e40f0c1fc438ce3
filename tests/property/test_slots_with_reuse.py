"""Slots are free of clashes within two hops: by coloring at once, by claims within the stated number of superframes."""

import pytest
from coloring import clashes, dsatur, welsh_powell
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.errors import LocalProtocolError
from fanet_mw.graph.topology import components, levels, symmetric, two_hop, within_range
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.claimed.slot_claims import SlotClaim, SlotClaims, SlotHello
from fanet_mw.units import Enu, NodeId, S

LISTEN = 2


@st.composite
def graphs(draw, most: int = 28):
    """Random disks and random graphs, ids in random order."""
    rng = stream(draw(st.integers(0, 10**6)), "graph")
    nodes = [NodeId(n) for n in rng.sample(range(1, 300), draw(st.integers(1, most)))]
    if draw(st.booleans()):
        positions = {n: Enu(rng.uniform(0, 900), rng.uniform(0, 900), 0.0) for n in nodes}
        return within_range(positions, range_m=250.0)
    share = draw(st.sampled_from([0.05, 0.15, 0.4]))
    return symmetric(links(nodes, lambda: rng.random() < share))


def links(nodes, there):
    heard = {n: [] for n in nodes}
    for i, a in enumerate(nodes):
        for b in nodes[i + 1 :]:
            if there():
                heard[a].append(b)
                heard[b].append(a)
    return heard


@pytest.mark.parametrize("color", [dsatur, welsh_powell])
@given(adjacency=graphs())
def test_coloring_has_no_clash_and_needs_no_more_than_conflicts_plus_one(color, adjacency) -> None:
    slots = color(adjacency)
    assert sorted(slots) == sorted(adjacency)
    assert not clashes(slots, adjacency)
    assert max(slots.values()) <= max(len(rivals) for rivals in two_hop(adjacency).values())
    assert color(dict(reversed(list(adjacency.items())))) == slots


@given(graphs())
def test_clashes_are_found_at_a_common_neighbor_and_nowhere_else(adjacency) -> None:
    same = dict.fromkeys(adjacency, 0)
    expected = {
        (a, b)
        for a in adjacency
        for b in adjacency
        if a < b and (b in adjacency[a] or set(adjacency[a]) & set(adjacency[b]))
    }
    assert set(clashes(same, adjacency)) == expected


def test_dsatur_colors_a_plus_grid_near_the_optimum_of_five() -> None:
    grid = within_range(
        {NodeId(9 * y + x + 1): Enu(200.0 * x, 200.0 * y, 0) for x in range(9) for y in range(5)}, range_m=250
    )
    assert max(len(n) for n in grid.values()) == 4
    assert 5 <= max(dsatur(grid).values()) + 1 <= 8


# --- claims over the air ---


class Air:
    """Superframes of all nodes: each steps once per superframe, in random order; hellos are lost at random."""

    def __init__(
        self, adjacency, seed: int, *, loss: float = 0.0, slots: int | None = None, sized_to: int | None = None
    ) -> None:
        self.adjacency = adjacency
        self.superframe = 0
        self._loss = loss
        self._slots = slots
        self._sized_to = sized_to
        self._rng = stream(seed, "air")
        self.nodes: dict[NodeId, SlotClaims] = {}
        self.join(adjacency)

    def join(self, adjacency, priority: int = 0) -> None:
        self.adjacency = adjacency
        self.nodes = {n: c for n, c in self.nodes.items() if n in adjacency}
        for node in sorted(adjacency):
            if node not in self.nodes:
                self.nodes[node] = SlotClaims(
                    node, now_ns=self.superframe * S, listen_ns=LISTEN * S, lifetime_ns=int(3.5 * S),
                    slots=self._slots, sized_to=self._sized_to, priority=priority,
                )  # fmt: skip

    def run(self, superframes: int) -> None:
        for _ in range(superframes):
            now_ns = self.superframe * S
            order = self._rng.sample(sorted(self.nodes), len(self.nodes))
            for node in order:
                hello = self.nodes[node].step(now_ns)
                for neighbor in self.adjacency[node]:
                    if self._rng.random() >= self._loss:
                        self.nodes[neighbor].on_hello(hello, now_ns=now_ns)
            self.superframe += 1

    @property
    def slots(self):
        return {n: c.slot for n, c in self.nodes.items()}

    @property
    def settled(self) -> bool:
        return None not in self.slots.values() and not self.meetings()

    def meetings(self):
        """Pairs within two hops that would send in one turn, whatever the lengths of their superframes."""
        own = {n: c.own for n, c in self.nodes.items()}
        rivals = two_hop(self.adjacency)
        return [(a, b) for a in sorted(rivals) for b in rivals[a] if a < b and own[a].meets(own[b])]


def longest_chain(adjacency) -> int:
    """d: the longest path of ever higher ids over the conflicts."""
    rivals = two_hop(adjacency)
    depth = {}
    for node in sorted(rivals):
        depth[node] = 1 + max((depth[r] for r in rivals[node] if r < node), default=0)
    return max(depth.values())


@given(graphs(), st.integers(0, 10**6))
def test_claims_are_free_of_clashes_within_the_stated_superframes_and_then_stay(adjacency, seed) -> None:
    air = Air(adjacency, seed)
    air.run(LISTEN + 2 * longest_chain(adjacency) + 1)
    assert air.settled
    before = air.slots
    air.run(6)
    assert air.slots == before


@examples(20)
@given(graphs(), graphs(most=10), st.integers(0, 10**6))
def test_after_leaves_joins_and_moves_they_are_again(adjacency, others, seed) -> None:
    """The second graph has other nodes, some the same, with other links. What died stays known for its lifetime."""
    air = Air(adjacency, seed)
    air.run(20)
    air.join(others)
    air.run(4 + LISTEN + 2 * longest_chain(others) + 1)
    assert air.settled


@examples(20)
@given(graphs(), st.integers(0, 10**6))
def test_a_joiner_between_two_owners_of_one_slot_makes_one_of_them_yield(adjacency, seed) -> None:
    rng = stream(seed, "joiner")
    air = Air(adjacency, seed)
    air.run(LISTEN + 2 * longest_chain(adjacency) + 1)
    joiner = NodeId(1000)
    friends = set(rng.sample(sorted(adjacency), min(4, len(adjacency))))
    wider = {n: (*nbrs, joiner) if n in friends else nbrs for n, nbrs in adjacency.items()}
    wider[joiner] = tuple(sorted(friends))
    air.join(wider)
    air.run(LISTEN + 2 * longest_chain(wider) + 1)
    assert air.settled


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_with_losses_claims_still_settle(loss: float) -> None:
    """40 disks of 30 nodes: all settle; how fast is measured by tests/benchmarks/slot_reuse.py."""
    for seed in range(40):
        rng = stream(seed, "disk")
        positions = {NodeId(n): Enu(rng.uniform(0, 900), rng.uniform(0, 900), 0.0) for n in range(1, 31)}
        air = Air(within_range(positions, range_m=250.0), seed, loss=loss)
        for _ in range(100):
            air.run(1)
            if air.settled:
                break
        assert air.settled


# --- superframes as long as the neighborhood is crowded ---


@examples(25)
@given(graphs(), st.integers(0, 10**6))
def test_sized_superframes_are_free_of_clashes_within_the_stated_superframes(adjacency, seed) -> None:
    air = Air(adjacency, seed, sized_to=128)
    air.run(LISTEN + 2 * longest_chain(adjacency) + 1 + 4)
    assert air.settled
    air.run(30)
    assert air.settled
    crowds = {n: 1 + len(rivals) for n, rivals in two_hop(adjacency).items()}
    for node, claims in air.nodes.items():
        least = max([crowds[node], *(crowds[r] for r in two_hop(adjacency)[node])])
        assert claims.own.crowd == crowds[node]
        assert least <= claims.own.length < 2 * least, "the next power of two, no longer"


@examples(20)
@given(graphs(), graphs(most=10), st.integers(0, 10**6))
def test_sized_superframes_follow_leaves_joins_and_moves(adjacency, others, seed) -> None:
    air = Air(adjacency, seed, sized_to=128)
    air.run(20)
    air.join(others)
    air.run(4 + LISTEN + 2 * longest_chain(others) + 1 + 4)
    assert air.settled


def test_a_node_that_lengthens_its_superframe_keeps_a_part_of_its_turns() -> None:
    node = SlotClaims(NodeId(3), now_ns=0, listen_ns=0, lifetime_ns=100 * S, sized_to=64)
    before = node.step(0).own
    for n in range(10, 20):
        node.on_hello(SlotHello(SlotClaim(NodeId(n), None), ()), now_ns=0)
    after = node.step(S).own
    assert (before.length, after.length) == (1, 16)
    assert after.slot is not None
    assert before.slot == after.slot % before.length


def test_two_claims_of_different_lengths_meet_where_the_shorter_repeats() -> None:
    assert SlotClaim(NodeId(1), 1, length=4).meets(SlotClaim(NodeId(2), 13, length=16))
    assert not SlotClaim(NodeId(1), 1, length=4).meets(SlotClaim(NodeId(2), 14, length=16))
    assert not SlotClaim(NodeId(1), None, length=4).meets(SlotClaim(NodeId(2), 14, length=16))


@pytest.mark.parametrize("keys", [{"sized_to": 12}, {"sized_to": 0}, {"sized_to": 8, "slots": 8}], ids=str)
def test_a_longest_superframe_that_is_no_power_of_two_is_our_callers_mistake(keys) -> None:
    with pytest.raises(LocalProtocolError, match="sized_to"):
        SlotClaims(NodeId(1), now_ns=0, listen_ns=0, lifetime_ns=1, **keys)


def test_of_two_rivals_the_lower_id_keeps_the_slot_unless_priority_says_otherwise() -> None:
    def settle(strong: int) -> tuple[int | None, int | None]:
        one, two = (
            SlotClaims(NodeId(n), now_ns=0, listen_ns=0, lifetime_ns=4 * S, priority=0 if n == strong else 1)
            for n in (1, 2)
        )
        hellos = one.step(0), two.step(0)  # both claim slot 0 before they hear each other
        one.on_hello(hellos[1], now_ns=0)
        two.on_hello(hellos[0], now_ns=0)
        one.step(S)
        two.step(S)
        return one.slot, two.slot

    assert settle(strong=1) == (0, 1)
    assert settle(strong=2) == (1, 0)


def test_a_node_that_finds_no_slot_free_stays_silent_until_one_is() -> None:
    third = SlotClaims(NodeId(3), now_ns=0, listen_ns=0, lifetime_ns=4 * S, slots=2)
    for n in (1, 2):
        third.on_hello(SlotHello(SlotClaim(NodeId(n), n - 1), ()), now_ns=0)
    assert third.step(0).own.slot is None
    third.on_hello(SlotHello(SlotClaim(NodeId(2), 1), ()), now_ns=3 * S)
    assert third.step(5 * S).own.slot == 0


def test_a_joiner_listens_before_it_claims() -> None:
    joiner = SlotClaims(NodeId(1), now_ns=0, listen_ns=2 * S, lifetime_ns=4 * S)
    assert [joiner.step(t * S).own.slot for t in range(3)] == [None, None, 0]


@given(
    st.lists(
        st.builds(SlotClaim, st.integers(0, 5).map(NodeId), st.none() | st.integers(-3, 9)), min_size=1, max_size=6
    )
)
def test_whatever_comes_off_the_air_raises_nothing(claims) -> None:
    node = SlotClaims(NodeId(1), now_ns=0, listen_ns=0, lifetime_ns=4 * S)
    for at, claim in enumerate(claims):
        node.on_hello(SlotHello(claim, tuple(claims)), now_ns=at)
        slot = node.step(at).own.slot
        assert slot is None or slot >= 0


def test_no_slots_at_all_is_our_callers_mistake() -> None:
    with pytest.raises(LocalProtocolError, match="slots = 0"):
        SlotClaims(NodeId(1), now_ns=0, listen_ns=0, lifetime_ns=1, slots=0)


# --- topology ---


@given(graphs())
def test_components_cover_all_and_levels_are_hops(adjacency) -> None:
    assert sorted(n for part in components(adjacency) for n in part) == sorted(adjacency)
    for part in components(adjacency):
        hops = levels(adjacency, part[0])
        assert all(abs(hops[a] - hops[b]) <= 1 for a in part for b in adjacency[a])
        assert all(h == 0 or any(hops[b] == h - 1 for b in adjacency[a]) for a, h in hops.items())

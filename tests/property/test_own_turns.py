"""Turns by claim and by lot: of two within two hops never both have a turn, and no turn that is wanted stays free."""

from coloring import dsatur
from hypothesis import given
from hypothesis import strategies as st
from test_slots_with_reuse import graphs

from fanet_mw.graph.topology import two_hop
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns, Share, draws
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import MS, NodeId

TURNS = Turns(origin_ns=0, period_ns=500 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=230)
LENGTH = 32


def own_turns(adjacency, lots):
    """Everyone with a colored claim in a superframe of 32, and what two hops of hellos say."""
    rivals = two_hop(adjacency)
    shares = {n: Share(slot, LENGTH) for n, slot in dsatur(adjacency).items()}
    found = {}
    for node in adjacency:
        own = OwnTurns(TURNS)
        own.share = shares[node]
        around = rivals[node]
        own.draws = draws(node, lots[node], [(n, shares[n]) for n in around], [(n, lots[n]) for n in around])
        found[node] = own
    return found


def turns_of(own: OwnTurns, periods: int = 2) -> list[int]:
    starts, at_ns = [], 0
    while (start_ns := own.next_start_ns(not_before_ns=at_ns)) is not None and start_ns < periods * TURNS.period_ns:
        starts.append(start_ns)
        at_ns = start_ns + 1
    return starts


@given(graphs(most=20), st.integers(0, 10**6))
def test_no_two_within_two_hops_have_a_turn_in_common(adjacency, seed) -> None:
    rng = stream(seed, "lots")
    lots = {n: rng.randint(0, 3) for n in adjacency}
    turns = {n: set(turns_of(own)) for n, own in own_turns(adjacency, lots).items()}
    rivals = two_hop(adjacency)
    assert not any(turns[a] & turns[b] for a in rivals for b in rivals[a])
    for node, share in dsatur(adjacency).items():
        claimed = {TURNS.start_ns(t, superframe_start_ns=0) for t in range(share, TURNS.per_superframe, LENGTH)}
        assert claimed <= turns[node]


def test_where_everyone_hears_everyone_no_turn_is_left_and_who_has_more_lots_wins_more() -> None:
    mesh = {NodeId(n): tuple(NodeId(m) for m in range(1, 5) if m != n) for n in range(1, 5)}
    turns = {n: turns_of(own) for n, own in own_turns(mesh, {1: 0, 2: 1, 3: 1, 4: 3}).items()}
    assert sum(map(len, turns.values())) == 2 * TURNS.per_superframe
    assert len(turns[NodeId(1)]) == 2 * len(range(0, 230, LENGTH)), "no lots, no more than its claim"
    assert len(turns[NodeId(4)]) > 1.5 * len(turns[NodeId(3)])


@given(st.integers(0, 31), st.integers(0, 2000))
def test_a_turn_kept_for_a_hello_is_not_given_away_and_the_next_one_is(slot: int, at_ms: int) -> None:
    own = OwnTurns(TURNS)
    own.share = Share(slot, LENGTH)
    first, second = turns_of(own)[:2]
    assert own.reserve(not_before_ns=0) == first
    assert own.next_start_ns(not_before_ns=0) == second
    later = own.next_start_ns(not_before_ns=at_ms * MS)
    assert later is not None
    assert later >= at_ms * MS
    assert own.reserve(not_before_ns=later) == later


def test_without_a_claim_there_are_no_turns() -> None:
    own = OwnTurns(TURNS)
    assert own.next_start_ns(not_before_ns=0) is None
    assert own.reserve(not_before_ns=0) is None
    assert own.claimed() == ()
    own.share = Share(240, 256)
    assert own.next_start_ns(not_before_ns=0) is None, "the period ends before the slot comes"

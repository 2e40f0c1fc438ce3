"""Laws of rounds: turns never overlap, bulk ends in its window, messages survive the air, links need both ends."""

import contextlib
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.rounds.bulk_slots import BulkSlots
from fanet_mw.routing.rounds.counted_links import InStep
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire import Header, Kind
from fanet_mw.wire.rounds import (
    HeardNodes,
    HeldPacket,
    decode_heard,
    decode_held,
    encode_heard,
    encode_held,
)
from sim.scenarios import catalog

INSTANTS = st.integers(0, 10**13)


@st.composite
def timings(draw: st.DrawFn) -> RoundTiming:
    return RoundTiming.of(
        config.build(
            {
                "nodes": {"count": draw(st.integers(2, 200))},
                "routing": {"protocol": "rounds"},
                "traffic": {"payload_bytes": 300},
                "radio": {"rate_mbps": draw(st.sampled_from([1, 11, 54])), "standard": "g"},
                "rounds": {
                    "turn_bytes": draw(st.integers(400, 1400)),
                    "bulk_share": draw(st.sampled_from([0.0, 0.1, 0.7, 0.95])),
                    "least_period_ms": draw(st.sampled_from([0, 50, 5000])),
                },
            }
        )
    )


@pytest.mark.parametrize(("bulk_share", "slots"), [(0.0, 0), (0.0001, 4), (0.1, 4)])
def test_however_small_the_share_of_bulk_a_round_has_four_slots_for_it(bulk_share: float, slots: int) -> None:
    timing = RoundTiming.of(config.build({"nodes": {"count": 6}, "rounds": {"bulk_share": bulk_share}}))
    assert timing.slots == slots
    assert timing.period_ns >= timing.nodes * timing.turn_ns + slots * timing.slot_ns


@pytest.mark.parametrize(("most", "together"), [(500, 1), (1200, 2), (1500, 2)])
def test_a_frame_of_bulk_holds_two_packets_where_the_radio_sends_frames_so_long(most: int, together: int) -> None:
    radio, traffic = {"max_frame_bytes": most}, {"payload_bytes": 300, "priority": "bulk"}
    scenario = config.build({"nodes": {"count": 6}, "radio": radio, "traffic": traffic, "rounds": {"turn_bytes": 400}})
    slot_bytes = RoundTiming.of(scenario).slot_bytes
    assert slot_bytes // scenario.longest_bulk_bytes == together
    assert slot_bytes <= most


@given(timings(), INSTANTS, st.data())
def test_turns_of_two_nodes_never_overlap(timing: RoundTiming, from_ns: int, data: st.DataObject) -> None:
    one, other = data.draw(st.permutations(range(1, timing.nodes + 1)))[:2]
    start_ns = timing.turn_start_ns(one, from_ns=from_ns)
    assert from_ns <= start_ns < from_ns + timing.period_ns
    around = (
        timing.turn_start_ns(other, from_ns=start_ns),
        timing.turn_start_ns(other, from_ns=start_ns - timing.period_ns),
    )
    assert all(abs(turn_ns - start_ns) >= timing.turn_ns for turn_ns in around)


def turns_and_slots(timing: RoundTiming) -> list[tuple[int, int]]:
    """Start and end of every turn and slot of the first round, in their order."""
    turns = (timing.turn_start_ns(node, from_ns=0) for node in range(1, timing.nodes + 1))
    slots = map(timing.slot_start_ns, range(timing.slots))
    return sorted(
        [(at_ns, at_ns + timing.turn_ns) for at_ns in turns] + [(at_ns, at_ns + timing.slot_ns) for at_ns in slots]
    )


@given(timings())
def test_a_round_has_a_turn_of_each_node_and_all_slots_and_none_of_them_overlap(timing: RoundTiming) -> None:
    spans = turns_and_slots(timing)
    assert len(spans) == timing.nodes + timing.slots
    assert spans[0][0] == 0
    assert all(start_ns == end_ns for (_, end_ns), (start_ns, _) in pairwise(spans)), "nothing is left between them"
    assert spans[-1][1] <= timing.period_ns


@given(timings())
def test_blocks_cover_the_round_in_equal_parts(timing: RoundTiming) -> None:
    blocks = timing.blocks
    assert [block.end_ns for block in blocks] == [*(block.start_ns for block in blocks[1:]), timing.period_ns]
    turns = [(block.slots_start_ns - block.start_ns) // timing.turn_ns for block in blocks]
    for parts, whole in (turns, timing.nodes), ([block.slots for block in blocks], timing.slots):
        assert sum(parts) == whole
        assert max(parts) - min(parts) <= 1
    if len(blocks) > 1:
        assert min(turns) >= 1
        assert min(block.slots for block in blocks) >= 4


@given(timings(), INSTANTS, st.data())
def test_a_frame_belongs_to_the_node_in_whose_turn_it_ended(
    timing: RoundTiming, from_ns: int, data: st.DataObject
) -> None:
    node = data.draw(st.integers(1, timing.nodes))
    start_ns = timing.turn_start_ns(node, from_ns=from_ns)
    assert timing.owner(start_ns + data.draw(st.integers(1, timing.turn_ns))) == node
    if timing.slots:
        slot_ns = timing.slot_start_ns(timing.slot_from(from_ns))
        assert timing.owner(slot_ns + data.draw(st.integers(1, timing.slot_ns))) is None


@given(timings().filter(lambda timing: timing.slots > 0), INSTANTS)
def test_the_next_slot_is_the_first_that_starts_from_an_instant_on(timing: RoundTiming, from_ns: int) -> None:
    slot = timing.slot_from(from_ns)
    assert timing.slot_start_ns(slot - 1) < from_ns <= timing.slot_start_ns(slot)


@given(timings().filter(lambda timing: timing.slots > 0), INSTANTS)
def test_what_is_sent_at_once_starts_between_turns_and_ends_before_the_next(timing: RoundTiming, from_ns: int) -> None:
    start_ns = timing.between_turns_ns(from_ns)
    assert from_ns <= start_ns < from_ns + timing.period_ns
    assert timing.owner(start_ns + 1) is None
    next_ns = min(timing.turn_start_ns(node, from_ns=start_ns) for node in range(1, timing.nodes + 1))
    assert next_ns - start_ns >= 2 * timing.slot_ns
    assert timing.between_turns_ns(start_ns) == start_ns


@pytest.mark.parametrize("nodes", [9, 45, 200])
def test_what_goes_to_a_neighbor_at_once_never_waits_longer_than_18_ms(nodes: int) -> None:
    timing = RoundTiming.of(config.build({"nodes": {"count": nodes}, "routing": {"protocol": "rounds"}}))
    at_ns = range(0, timing.period_ns, MS // 10)
    assert max(timing.between_turns_ns(from_ns) - from_ns for from_ns in at_ns) <= 18 * MS


@pytest.mark.parametrize("nodes", [9, 45, 200])
def test_in_the_last_two_slots_of_each_block_nothing_begins_at_once(nodes: int) -> None:
    timing = RoundTiming.of(config.build({"nodes": {"count": nodes}, "routing": {"protocol": "rounds"}}))
    assert len(timing.blocks) > 1
    again_ns = timing.period_ns + timing.blocks[0].slots_start_ns
    following_ns = [*(block.slots_start_ns for block in timing.blocks[1:]), again_ns]
    for block, next_ns in zip(timing.blocks, following_ns, strict=True):
        late_ns = block.slots_start_ns + (block.slots - 2) * timing.slot_ns
        assert timing.between_turns_ns(late_ns - 1) == late_ns - 1
        assert timing.between_turns_ns(late_ns) == next_ns


@given(timings().filter(lambda timing: timing.slots > 0), INSTANTS, st.data())
def test_of_nodes_within_two_hops_one_owns_a_bulk_slot(timing: RoundTiming, from_ns: int, data: st.DataObject) -> None:
    nodes = data.draw(st.lists(st.integers(1, 488), min_size=2, max_size=12, unique=True))
    often = {node: data.draw(st.booleans()) for node in nodes}
    owned = [
        BulkSlots(node, timing).next_ns(
            from_ns, in_each_slot=often[node], rivals=[(other, often[other]) for other in nodes if other != node]
        )
        for node in nodes
    ]
    assert len(set(owned)) == len(nodes)


@given(st.integers(0, 10**6), st.booleans(), st.lists(st.tuples(st.integers(2, 488), st.booleans()), max_size=6))
def test_a_node_misses_none_of_its_own_slots_from_wherever_it_looks(
    first: int, often: bool, rivals: list[tuple[int, bool]]
) -> None:
    timing = RoundTiming.of(config.build({"nodes": {"count": 10}, "routing": {"protocol": "rounds"}}))
    slots, starts = BulkSlots(1, timing), [timing.slot_start_ns(first + at) for at in range(150)]
    found = [slots.next_ns(start, in_each_slot=often, rivals=rivals) for start in starts]
    for start, own, after in zip(starts, found, found[1:], strict=False):
        assert own in (start, after)


def test_a_node_with_little_to_send_owns_few_slots_and_leaves_the_others_alone() -> None:
    timing = RoundTiming.of(config.build({"nodes": {"count": 10}, "routing": {"protocol": "rounds"}}))

    def owned(rivals: list[tuple[int, bool]], *, often: bool = True) -> set[int]:
        found, at_ns = set[int](), 0
        slots = BulkSlots(1, timing)
        while (at_ns := slots.next_ns(at_ns, in_each_slot=often, rivals=rivals)) < 100 * timing.period_ns:
            found.add(at_ns)
            at_ns += 1
        return found

    every = 100 * timing.slots
    assert len(owned([])) == every
    assert len(owned([], often=False)) == pytest.approx(every / 8, rel=0.15)
    assert len(owned([(node, False) for node in range(2, 6)])) > 0.7 * every
    assert len(owned([(node, True) for node in range(2, 6)])) == pytest.approx(every / 5, rel=0.15)


def on_air(inner: bytes) -> bytes:
    header = Header(0, 1, NodeId(3), BROADCAST, NodeId(3), Kind.ROUND, 1, 0, wire.PRIORITY_CONTROL, wire.FLAG_FLOOD)
    return header.encode() + inner


@given(st.integers(1, 488), st.data())
def test_links_survive_the_air(count: int, data: st.DataObject) -> None:
    entry = st.builds(
        HeardNodes, st.integers(1, count), st.integers(0, 255), st.integers(0, 2**count - 1), st.booleans()
    )
    entries = data.draw(st.lists(entry, min_size=1, max_size=40))
    assert decode_heard(on_air(encode_heard(entries, 3, count=count))) == entries


@given(st.lists(st.builds(HeldPacket, st.integers(0, 2**32 - 1), st.integers(1, 65534)), max_size=40))
def test_held_packets_survive_the_air(packets: list[HeldPacket]) -> None:
    assert decode_held(on_air(encode_held(packets, 3))) == packets


@given(st.binary(max_size=90), st.sampled_from([wire.HEARD, wire.HELD]))
def test_any_bytes_decode_to_values_or_are_malformed(noise: bytes, spec: wire.Spec) -> None:
    frame = on_air(wire.encode_inner(spec, noise.ljust(spec.layout.size, b"\x01")[: spec.layout.size], node=3))
    for decode in (decode_heard, decode_held):
        with contextlib.suppress(MalformedFrameError):
            decode(frame)


def told_by(nodes: dict[int, set[int]], *, epoch: int) -> list[HeardNodes]:
    return [HeardNodes(n, epoch % 256, sum(1 << (m - 1) for m in heard)) for n, heard in nodes.items()]


@given(st.sets(st.tuples(st.integers(1, 12), st.integers(1, 12)), max_size=50), st.integers(2, 10_000))
def test_a_link_counts_if_both_its_ends_state_it(heard: set[tuple[int, int]], epoch: int) -> None:
    topology = Topology(NodeId(1), count=12, epoch_ns=250 * MS, lifetime_ns=10 * S)
    now_ns = epoch * 250 * MS + 1
    states = {n: {b for a, b in heard if a == n and b != n} for n in range(1, 13)}
    topology.state(sum(1 << (n - 1) for n in states[1]), often=True, now_ns=now_ns)
    topology.hear(told_by(states, epoch=epoch), now_ns=now_ns)
    hops = topology.hops(now_ns)
    reached, ring, far = {1: 0}, [1], 0
    while ring:
        far += 1
        ring = sorted({m for n in ring for m in states[n] if n in states[m]} - set(reached))
        reached.update(dict.fromkeys(ring, far))
    assert hops == reached


def test_who_is_beyond_a_lost_node_is_parted_before_the_links_of_that_one_are_taken_back() -> None:
    topology = Topology(NodeId(1), count=6, epoch_ns=250 * MS, lifetime_ns=10 * S)
    topology.state(0b10, often=True, now_ns=S)
    topology.hear(told_by({2: {1, 3}, 3: {2, 4}, 4: {3, 5}, 5: {4}}, epoch=4), now_ns=S)
    assert topology.parted(S) == ()
    assert topology.parted(S, without=[3]) == (3, 4, 5), "6 was never there"
    assert topology.parted(S, without=[5]) == (5,)
    assert topology.parted(S) == ()


@given(st.dictionaries(st.integers(2, 12), st.sets(st.integers(1, 12)), max_size=11), st.integers(1, 10))
def test_who_is_of_another_part_is_told_ahead_of_the_turn_what_all_have_stated(
    states: dict[int, set[int]], frames: int
) -> None:
    topology = Topology(NodeId(1), count=12, epoch_ns=250 * MS, lifetime_ns=10 * S)
    told = told_by(states, epoch=4)
    topology.hear(told, now_ns=S)
    topology.state(0b10, often=True, now_ns=S)
    topology.take_news(12)
    assert not topology.has_changes, "all is known here, and told"
    topology.on_other_part(S)
    ahead = [one for _ in range(frames) for one in topology.take_news(-(-12 // frames), ahead=True)]
    assert sorted(ahead) == sorted([*told, HeardNodes(1, 4, 0b10, often=True)])
    assert not topology.has_changes
    assert sorted(topology.take_news(12)) == sorted(ahead), "a frame ahead of the turn may be destroyed"


def test_a_change_that_waited_until_its_statement_expired_is_not_told() -> None:
    topology = Topology(NodeId(1), count=3, epoch_ns=250 * MS, lifetime_ns=2 * S)
    topology.hear(told_by({2: {3}}, epoch=4), now_ns=S)
    assert topology.has_changes
    topology.state(0, often=False, now_ns=4 * S)
    assert not topology.has_changes
    assert topology.take_news(3, ahead=True) == []
    assert topology.take_news(3) == []


@given(st.integers(0, 255), st.integers(300, 10_000))
def test_a_statement_from_the_future_or_too_old_is_not_believed(short: int, epoch: int) -> None:
    topology = Topology(NodeId(1), count=3, epoch_ns=250 * MS, lifetime_ns=2 * S)
    now_ns = epoch * 250 * MS
    topology.state(0b10, often=True, now_ns=now_ns)
    topology.hear([HeardNodes(2, short, 0b1)], now_ns=now_ns)
    age = (epoch + 1 - short) % 256 - 1
    assert (NodeId(2) in topology.hops(now_ns)) is (age <= 8)


def test_a_frame_in_its_senders_turn_shows_that_both_keep_the_same_rounds() -> None:
    scenario = catalog.find("rescue", ["clock.sync=beacons"])
    timing = RoundTiming.of(scenario)
    known = InStep(timing, certain=False)
    begins_ns = timing.turn_start_ns(7, from_ns=S)
    ends_ns = begins_ns + timing.turn_ns // 2
    seven = 1 << 6
    assert not known.among(-1), "nobody, before a frame was heard"
    known.hear(7, ends_ns)
    assert known.among(-1) == seven
    known.hear(7, timing.slot_start_ns(timing.slot_from(begins_ns)) + timing.turn_ns)
    assert known.among(-1) == seven, "among the slots a frame shows nothing"
    known.hear(7, ends_ns - timing.turn_ns)
    assert not known.among(-1), "its clock is behind by a turn"
    for node in (3, 5, 6):
        known.hear(node, timing.turn_start_ns(node, from_ns=2 * S) + timing.turn_ns // 2)
    three, five, six = 1 << 2, 1 << 4, 1 << 5
    assert known.among(three | five | six) == three | five | six, "the other one is away"
    assert known.among(three | five | six | seven) == three, "it destroys what comes in the turn of 6, or just before"
    assert InStep(timing, certain=True).among(seven) == seven


def test_nobody_counts_as_absent_while_news_of_ever_farther_nodes_come() -> None:
    topology = Topology(NodeId(1), count=5, epoch_ns=250 * MS, lifetime_ns=10 * S)

    def known(t_s: float) -> object:
        return topology.absent(round(t_s * S), doubt_ns=2 * S)

    topology.state(0b10, often=False, now_ns=0)
    for hop, heard in enumerate((0b101, 0b1010, 0b100), start=1):  # of 2, 3, 4: 5 is not there
        topology.hear([HeardNodes(NodeId(hop + 1), 0, heard, often=False)], now_ns=hop * 1500 * MS)
        assert known(hop * 1.5) is None
        assert known(hop * 1.5 + 1.4) is None
    assert known(6.4) is None
    assert known(6.5) == (5,)
    topology.hear([HeardNodes(NodeId(3), 28, 0b10, often=False)], now_ns=7 * S)
    assert known(7) == (4, 5), "there was a way to 4, so that nothing of it is still to come"

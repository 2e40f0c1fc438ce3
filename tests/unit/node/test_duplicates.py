"""Duplicate suppression memory."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fanet_mw.node import duplicates

packets = st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF_FFFF))


def test_phases_of_one_packet_are_remembered_apart() -> None:
    memory = duplicates.DuplicateSet()
    key = duplicates.key_of(origin=3, seq=9)
    memory.mark(key, duplicates.CARRIED)
    assert memory.bits(key) & duplicates.CARRIED
    assert not memory.bits(key) & duplicates.FLOODED
    memory.mark(key, duplicates.FLOODED)
    assert memory.bits(key) == duplicates.CARRIED | duplicates.FLOODED


def test_the_last_capacity_packets_are_known_and_memory_stays_bounded() -> None:
    memory = duplicates.DuplicateSet(capacity=100)
    for seq in range(10_000):
        memory.mark(duplicates.key_of(origin=1, seq=seq), duplicates.DELIVERED)
    assert all(memory.bits(duplicates.key_of(origin=1, seq=seq)) for seq in range(9_900, 10_000))
    assert memory.bits(duplicates.key_of(origin=1, seq=0)) == 0
    assert len(memory.young) + len(memory.old) <= 200


@pytest.mark.parametrize("name", ["mark", "put"])
def test_a_packet_is_known_for_as_many_newer_ones_as_there_is_room_for(name: str) -> None:
    """At every moment, and not only where a generation is just full."""
    memory = duplicates.DuplicateSet(capacity=10)
    for seq in range(55):
        getattr(memory, name)(duplicates.key_of(origin=1, seq=seq), duplicates.FLOODED)
        assert all(memory.bits(duplicates.key_of(origin=1, seq=known)) for known in range(max(0, seq - 10), seq + 1))


def test_what_the_older_generation_knows_is_kept_when_more_becomes_known() -> None:
    memory = duplicates.DuplicateSet(capacity=4)
    first = duplicates.key_of(origin=1, seq=0)
    memory.mark(first, duplicates.CARRIED)
    for seq in range(1, 5):
        memory.mark(duplicates.key_of(origin=1, seq=seq), duplicates.CARRIED)
    assert first in memory.old
    memory.mark(first, duplicates.FLOODED)
    assert memory.bits(first) == duplicates.CARRIED | duplicates.FLOODED
    memory.forget(first)
    assert memory.bits(first) == 0, "in either generation"


def test_origins_do_not_share_sequences() -> None:
    memory = duplicates.DuplicateSet()
    memory.mark(duplicates.key_of(origin=1, seq=5), duplicates.DELIVERED)
    assert memory.bits(duplicates.key_of(origin=2, seq=5)) == 0


@given(one=packets, other=packets)
@example(one=(1, 0xFFFF_FFFF), other=(2, 0))
def test_no_two_packets_have_the_same_key(one: tuple[int, int], other: tuple[int, int]) -> None:
    assert (duplicates.key_of(*one) == duplicates.key_of(*other)) == (one == other)


def test_packets_of_all_origins_at_about_the_same_time_spread_over_a_dict() -> None:
    slots = {duplicates.key_of(origin, seq) % 4096 for origin in range(1, 46) for seq in range(1000, 1010)}
    assert len(slots) > 400, "450 keys; a dict looks for a number by its low bits"


@given(packets)
def test_the_key_of_a_packet_names_it(packet: tuple[int, int]) -> None:
    assert duplicates.origin_and_seq(duplicates.key_of(*packet)) == packet

"""The digest of a hello: what is held, what is missing, on the wire and back, for all sequence numbers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire import DIGEST, HEADER_BYTES, encode_inner
from fanet_mw.wire.hello.digest import CAPACITY, WINDOW, Digest, Holding

U32 = 0xFFFF_FFFF
HOLDINGS = st.builds(Holding, st.integers(1, 65534), st.integers(0, U32), st.integers(0, U32))
HEADER = b"\x00" * HEADER_BYTES


def holding_of(base: int, held: list[int]) -> Holding:
    """Take in packets in the order given, numbered from `base` on, around the end of the number range."""
    first, *rest = held
    holding = Holding(7, (base + first) & U32, 0)
    for number in rest:
        holding = holding.with_((base + number) & U32)
    return holding


@given(st.integers(0, U32), st.permutations(range(WINDOW)), st.integers(1, WINDOW), st.integers(1, WINDOW))
def test_what_one_holds_beyond_the_other_is_the_difference_of_the_sets(
    base: int, order: list[int], mine: int, theirs: int
) -> None:
    ours, others = order[:mine], order[-theirs:]
    beyond = holding_of(base, ours).beyond(holding_of(base, others))
    assert sorted((seq - base) & U32 for seq in beyond) == sorted(set(ours) - set(others))


@given(st.integers(0, U32), st.permutations(range(WINDOW)), st.integers(1, WINDOW))
def test_of_an_unknown_origin_everything_is_missing(base: int, order: list[int], count: int) -> None:
    beyond = holding_of(base, order[:count]).beyond(None)
    assert sorted((seq - base) & U32 for seq in beyond) == sorted(order[:count])


@given(st.integers(0, U32), st.integers(WINDOW, 1000))
def test_what_lies_before_the_window_is_neither_held_nor_asked_for(newest: int, behind: int) -> None:
    holding = Holding(7, newest, 0)
    assert holding.with_((newest - behind) & U32) == holding
    old = Holding(7, (newest - behind) & U32, U32)
    assert old.beyond(holding) == []
    assert len(holding.beyond(old)) == 1


@given(st.lists(HOLDINGS, max_size=3 * CAPACITY), st.booleans())
def test_a_digest_comes_back_as_it_was_sent(holdings: list[Holding], complete: bool) -> None:
    digest = Digest(tuple(holdings), complete)
    assert Digest.decode_frames(HEADER + digest.encode_frames(3)) == digest


def test_a_hello_without_a_digest_has_none() -> None:
    assert Digest.decode_frames(HEADER) is None


@pytest.mark.parametrize(("count", "complete", "version"), [(25, 1, 1), (1, 2, 1), (1, 1, 9)])
def test_a_digest_that_says_the_impossible_is_malformed(count: int, complete: int, version: int) -> None:
    payload = DIGEST.layout.pack(*[1] * (3 * CAPACITY), count, complete, version)
    with pytest.raises(MalformedFrameError):
        Digest.decode_frames(HEADER + encode_inner(DIGEST, payload, node=1))


def test_pymavlink_reads_the_same_digest() -> None:
    frame = Digest((Holding(9, 107, 0b0101),), complete=True).encode_frames(3)
    message = fanet.MAVLink(None).decode(bytearray(frame))
    assert (message.origins[0], message.newest[0], message.held[0], message.count, message.complete) == (
        9,
        107,
        5,
        1,
        1,
    )

"""The neighbors that a hello names: what goes in comes out, pymavlink agrees, and garbage is one error."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire import HEADER_BYTES, NEIGHBORS, encode_inner
from fanet_mw.wire.hello.neighbors import CAPACITY, HeardNeighbor, NeighborList

HEADER = b"\x00" * HEADER_BYTES
IDS = st.integers(1, 65534)
HEARD = st.builds(HeardNeighbor, IDS, st.booleans(), st.booleans())
LISTS = st.builds(NeighborList, IDS, st.lists(HEARD, max_size=3 * CAPACITY).map(tuple))


@given(LISTS)
def test_neighbors_are_decoded_as_they_were_encoded(near: NeighborList) -> None:
    frames = near.encode_frames()
    assert len(frames) == 64 * max(1, -(-len(near.heard) // CAPACITY))
    assert NeighborList.decode_frames(HEADER + frames) == near


@given(LISTS)
def test_pymavlink_reads_the_same(near: NeighborList) -> None:
    messages = fanet.MAVLink(None).parse_buffer(bytearray(near.encode_frames()))
    assert {m.node for m in messages} == {near.node}
    assert [n for m in messages for n in m.nodes[: m.count]] == [h.node for h in near.heard]


@given(st.binary(min_size=51, max_size=51))
def test_a_right_crc_around_any_payload_gives_neighbors_that_can_be_encoded_or_one_error(payload: bytes) -> None:
    with suppress(MalformedFrameError):
        near = NeighborList.decode_frames(HEADER + encode_inner(NEIGHBORS, payload + b"\x01", node=1))
        assert near is not None
        assert NeighborList.decode_frames(HEADER + near.encode_frames()) == near


def payload(**keys: int) -> bytes:
    fields = {"node": 3, "neighbor": 4, "facts": 0, "count": 1, "version": 1} | keys
    unused = (0,) * (CAPACITY - 1)
    body = NEIGHBORS.layout.pack(
        fields["node"], fields["neighbor"], *unused, fields["facts"], *unused, fields["count"], fields["version"]
    )
    return HEADER + encode_inner(NEIGHBORS, body, node=3)


@pytest.mark.parametrize(
    "change",
    [{"facts": 4}, {"neighbor": 0}, {"neighbor": 0xFFFF}, {"node": 0}, {"count": 17}, {"version": 2}],
    ids=str,
)
def test_neighbors_with_an_impossible_value_are_malformed(change: dict[str, int]) -> None:
    assert NeighborList.decode_frames(payload()) is not None
    with pytest.raises(MalformedFrameError):
        NeighborList.decode_frames(payload(**change))


def test_a_hello_without_neighbors_says_nothing_of_them() -> None:
    assert NeighborList.decode_frames(HEADER) is None

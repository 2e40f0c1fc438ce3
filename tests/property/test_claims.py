"""The claims in a hello: what goes in comes out, pymavlink agrees, and garbage is one error."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire import CLAIMS, HEADER_BYTES, encode_inner
from fanet_mw.wire.hello.claims import CAPACITY, NO_SLOT, Claims, HeardNeighbor, SlotStatus

HEADER = b"\x00" * HEADER_BYTES
IDS = st.integers(1, 65534)


@st.composite
def slot_statuses(draw: st.DrawFn) -> SlotStatus:
    length = draw(st.integers(0, 255))
    slot = draw(st.none() | st.integers(0, min(length, 255) - 1)) if length else None
    return SlotStatus(slot, length, draw(st.integers(0, 255)), draw(st.integers(0, 3)))


HEARD = st.builds(HeardNeighbor, IDS, slot_statuses(), st.booleans(), st.booleans())
CLAIMS_OF = st.builds(Claims, IDS, slot_statuses(), st.lists(HEARD, max_size=3 * CAPACITY).map(tuple))


@given(CLAIMS_OF)
def test_claims_are_decoded_as_they_were_encoded(claims: Claims) -> None:
    frames = claims.encode_frames()
    assert len(frames) == 116 * max(1, -(-len(claims.heard) // CAPACITY))
    assert Claims.decode_frames(HEADER + frames) == claims


@given(CLAIMS_OF)
def test_pymavlink_reads_the_same(claims: Claims) -> None:
    messages = fanet.MAVLink(None).parse_buffer(bytearray(claims.encode_frames()))
    assert {m.node for m in messages} == {claims.node}
    assert {NO_SLOT if claims.own.slot is None else claims.own.slot} == {m.slot for m in messages}
    assert [n for m in messages for n in m.nodes[: m.count]] == [h.node for h in claims.heard]


@given(st.binary(min_size=103, max_size=103))
def test_a_right_crc_around_any_payload_gives_claims_that_can_be_encoded_or_one_error(payload: bytes) -> None:
    with suppress(MalformedFrameError):
        claims = Claims.decode_frames(HEADER + encode_inner(CLAIMS, payload + b"\x01", node=1))
        assert claims is not None
        assert Claims.decode_frames(HEADER + claims.encode_frames()) == claims


def payload(**keys: int) -> bytes:
    fields = {"node": 3, "neighbor": 4, "slot": 1, "length": 8, "facts": 0, "own": 2, "lots": 0, "count": 1} | keys
    unused = (0,) * (CAPACITY - 1)
    body = CLAIMS.layout.pack(
        fields["node"], fields["neighbor"], *unused, fields["slot"], *unused, fields["length"], *unused, 5, *unused,
        fields["facts"], *unused, fields["own"], 8, 5, fields["lots"], fields["count"], fields.get("version", 1),
    )  # fmt: skip
    return HEADER + encode_inner(CLAIMS, body, node=3)


@pytest.mark.parametrize(
    "change",
    [
        {"slot": 8}, {"length": 1}, {"own": 8}, {"lots": 4}, {"facts": 16}, {"neighbor": 0}, {"neighbor": 0xFFFF},
        {"node": 0}, {"count": 17}, {"version": 2},
    ],
    ids=str,
)  # fmt: skip
def test_claims_with_an_impossible_value_are_malformed(change: dict[str, int]) -> None:
    assert Claims.decode_frames(payload()) is not None
    with pytest.raises(MalformedFrameError):
        Claims.decode_frames(payload(**change))


def test_a_hello_without_claims_says_nothing_of_them() -> None:
    assert Claims.decode_frames(HEADER) is None

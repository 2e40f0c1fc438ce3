"""Control messages of rival protocols on the air: what goes in comes out, garbage is one error."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import wire
from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.aodv import messages as aodv
from fanet_mw.routing.olsr import messages as olsr

HEADER = wire.Header(12, 1, 3, 0xFFFF, 3, wire.Kind.ROUTING, 1, 0, 0, 0).encode()
BODY = bytes(range(256)) + bytes(44)


@given(st.integers(0, 255), st.binary(max_size=2000), st.integers(1, 0xFFFE))
def test_a_control_message_is_decoded_as_it_was_encoded(kind: int, body: bytes, node: int) -> None:
    assert control.decode(HEADER + control.encode(kind, body, node=node)) == (kind, body)


@given(st.binary(max_size=239))
def test_pymavlink_reads_a_piece_and_its_length_on_the_air_is_known(body: bytes) -> None:
    inner = control.encode(0x12, body, node=3)
    assert len(inner) == 17 + len(body)
    (theirs,) = fanet.MAVLink(None).parse_buffer(bytearray(inner))
    assert (theirs.length, theirs.type, theirs.part, theirs.parts) == (len(body), 0x12, 0, 1)
    assert bytes(theirs.data[: len(body) + 1]) == body + b"\x01"


def test_messages_have_the_numbers_of_their_standards() -> None:
    """RFC 3561, 5.1 to 5.3, and RFC 3626, 18.4: the low half of the type on the air, the protocol is the high one."""
    assert [control.type_of(control.Family.AODV, n) for n in (aodv.RREQ, aodv.RREP, aodv.RERR)] == [0x11, 0x12, 0x13]
    assert [control.type_of(control.Family.OLSR, n) for n in (olsr.HELLO, olsr.TC)] == [0x21, 0x22]


@pytest.mark.parametrize("capacity", [*range(7, 40), 1400, 1537, 3000])
def test_an_error_names_as_many_destinations_as_fit(capacity: int) -> None:
    """And no more than its count can say, 255 (RFC 3561, 5.3)."""
    most = aodv.most_unreachable(capacity)

    def size(count: int) -> int:
        return len(aodv.RouteError(tuple(aodv.Unreachable(n + 1, 7) for n in range(count))).encode())

    assert size(most) <= capacity
    assert most == 255 or size(most + 1) > capacity


@pytest.mark.parametrize("bound", [64, 300, 2304])
def test_the_capacity_of_a_frame_is_what_just_fits(bound: int) -> None:
    most = control.capacity(bound)
    assert wire.HEADER_BYTES + len(control.encode(1, bytes(most), node=1)) <= bound
    assert wire.HEADER_BYTES + len(control.encode(1, bytes(most + 1), node=1)) > bound


@given(st.binary(max_size=100))
def test_garbage_is_one_error(data: bytes) -> None:
    with suppress(MalformedFrameError):
        control.decode(HEADER + data)


def test_pieces_that_are_missing_repeated_or_of_two_types_are_malformed() -> None:
    first, second = wire.frames(control.encode(5, BODY, node=1))
    other = list(wire.frames(control.encode(6, BODY, node=1)))[1]
    assert control.decode(HEADER + first + second) == (5, BODY)
    for pieces in ((), (first,), (second,), (second, first), (first, first), (first, other), (first, second, second)):
        with pytest.raises(MalformedFrameError):
            control.decode(HEADER + b"".join(pieces))


def test_a_reader_never_gives_bytes_that_are_not_there() -> None:
    pair, single = struct.Struct("<HH"), struct.Struct("<H")
    assert list(control.BodyReader(b"\x01\x00\x02\x00").rest(single)) == [(1,), (2,)]
    with pytest.raises(MalformedFrameError):
        control.BodyReader(b"\x01\x00\x02").take(pair)
    with pytest.raises(MalformedFrameError):
        list(control.BodyReader(b"\x01\x00\x02").rest(single))
    for body in (b"\x01", b"\x01\x00\x02"):
        with pytest.raises(MalformedFrameError):
            control.unpack(single, body)

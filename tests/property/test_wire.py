"""The air format: what goes in comes out, pymavlink agrees, and garbage never gets further than one error."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import wire
from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import Enu
from fanet_mw.wire import Beacon, Header, Join, Member, Role, Schedule, Survivor, TimeBeacon

u8, u16, u32, u64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))
ids = st.integers(1, 0xFFFE)
singles = st.floats(allow_nan=False, allow_infinity=False, width=32)
positions = st.builds(Enu, singles, singles, singles)

headers = st.builds(
    Header,
    origin_us=u64, seq=u32, origin=ids, destination=u16, prev_hop=ids, kind=st.sampled_from(wire.Kind).map(int),
    hop_limit=u8, hops=u8, priority=u8, flags=u8,
)  # fmt: skip
beacons = st.builds(Beacon, ids, u16, u16, u16, u16, u16, st.sampled_from(Role).map(int), u8)
members = st.builds(Member, ids, st.integers(0, 0x7FFF), st.booleans())


@st.composite
def schedules(draw: st.DrawFn) -> Schedule:
    period_us = draw(st.integers(1, 2**32 - 1))
    parts = draw(st.integers(1, 255))
    return Schedule(
        draw(u64), period_us, draw(st.integers(1, period_us)), draw(st.integers(1, 0xFFFF)), draw(ids), draw(u16),
        draw(st.integers(0, parts - 1)), parts, tuple(draw(st.lists(members, max_size=wire.CAPACITY))),
    )  # fmt: skip


joins = st.builds(Join, ids, positions)
survivors = st.builds(Survivor, u64, u32, ids, positions, singles)
times = st.builds(TimeBeacon, u64, u32, ids, u16, u8)
any_message = st.one_of(beacons, schedules(), joins, survivors, times)

HEADER = Header(12, 1, 3, 0xFFFF, 3, 0, 32, 0, 3, 0).encode()


@given(headers)
def test_a_header_is_decoded_as_it_was_encoded(header: Header) -> None:
    frame = header.encode()
    assert len(frame) == wire.HEADER_BYTES
    assert wire.decode_header(frame) == header
    assert wire.peek(frame) == (header.origin, header.seq, header.flags)


@given(any_message, ids)
def test_a_message_in_a_frame_is_decoded_as_it_was_encoded(message: Any, node: int) -> None:
    frame = HEADER + message.encode_frame(node) + wire.filler(40)
    assert type(message).decode_frame(frame) == message


@given(st.one_of(headers.map(lambda h: h.encode()), st.builds(lambda m, n: m.encode_frame(n), any_message, ids)))
def test_pymavlink_reads_what_we_write_and_would_write_the_same(frame: bytes) -> None:
    reader = fanet.MAVLink(None)
    (message,) = reader.parse_buffer(bytearray(frame))
    assert message.get_srcComponent() == wire.COMPONENT
    writer = fanet.MAVLink(None, srcSystem=message.get_srcSystem(), srcComponent=message.get_srcComponent())
    writer.seq = message.get_seq()
    fields = [getattr(message, name) for name in message.fieldnames]
    assert bytes(type(message)(*fields).pack(writer)) == frame


@pytest.mark.parametrize("spec", wire.SPECS, ids=lambda spec: str(spec.msgid))
def test_our_layouts_are_the_dialects(spec: wire.Spec) -> None:
    message = fanet.mavlink_map[spec.msgid]
    assert message.crc_extra == spec.crc_extra
    assert message.unpacker.format == spec.layout.format


@given(st.integers(17, 2304))
def test_filler_is_exactly_as_long_as_asked_and_whole_mavlink(size: int) -> None:
    data = wire.filler(size)
    assert len(data) == size
    assert all(msgid == 53004 for msgid, _ in wire.inner_frames(HEADER + data))


@given(st.sampled_from([17, 28, 500, 988, 2268]))
def test_pymavlink_reads_filler(size: int) -> None:
    messages = fanet.MAVLink(None).parse_buffer(bytearray(wire.filler(size)))
    assert sum(message.length for message in messages) == size - 16 * len(messages)


@given(headers, u8, u8, ids)
def test_a_rewritten_frame_keeps_its_inner_bytes_and_its_name(header: Header, left: int, hops: int, node: int) -> None:
    inner = wire.filler(100)
    frame = wire.rewrite(header.encode() + inner, prev_hop=node, hop_limit=left, hops=hops, flags=1)
    assert frame[wire.HEADER_BYTES :] == inner
    after = wire.decode_header(frame)
    assert after == header._replace(prev_hop=node, hop_limit=left, hops=hops, flags=1)


DECODERS: list[Callable[[bytes], object]] = [
    wire.decode_header,
    lambda data: list(wire.inner_frames(data)),
    *(kind.decode_frame for kind in (Beacon, Schedule, Join, Survivor, TimeBeacon)),
]


@given(st.one_of(st.binary(max_size=120), st.binary(max_size=90).map(lambda tail: HEADER + tail)))
def test_garbage_is_one_error(data: bytes) -> None:
    for decode in DECODERS:
        with suppress(MalformedFrameError):
            decode(data)


@given(any_message, st.data())
def test_one_changed_bit_in_a_message_is_noticed(message: Any, data: st.DataObject) -> None:
    inner = bytearray(message.encode_frame(1))
    at = data.draw(st.integers(0, 8 * len(inner) - 1))
    inner[at // 8] ^= 1 << at % 8
    with pytest.raises(MalformedFrameError):
        type(message).decode_frame(HEADER + bytes(inner))


@given(headers, st.data())
def test_one_changed_bit_in_a_header_is_noticed(header: Header, data: st.DataObject) -> None:
    frame = bytearray(header.encode())
    at = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[at // 8] ^= 1 << at % 8
    with pytest.raises(MalformedFrameError):
        wire.decode_header(bytes(frame))


def test_node_ids_beyond_the_system_ids_wrap_and_leave_the_ground_stations_free() -> None:
    assert [wire.system_id(node) for node in (1, 250, 251, 65534)] == [1, 250, 1, 34]

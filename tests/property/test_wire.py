"""The air format: what goes in comes out, pymavlink agrees, and garbage never gets further than one error."""

import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import assume, given
from hypothesis import strategies as st

from fanet_mw import wire
from fanet_mw.dialect import fanet
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, Enu
from fanet_mw.wire import Header
from fanet_mw.wire.hello.beacon import Beacon, Role, TimeBeacon
from fanet_mw.wire.schedule import CAPACITY, Join, Member, Schedule
from fanet_mw.wire.survivors import MOST_DBM, MOST_SURVIVORS, Survivor

u8, u16, u32, u64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))
ids = st.integers(1, 0xFFFE)
instants = st.integers(0, wire.LATEST_US)
singles = st.floats(allow_nan=False, allow_infinity=False, width=32)
coordinates = st.floats(-FARTHEST_M, FARTHEST_M, width=32)
positions = st.builds(Enu, coordinates, coordinates, coordinates)
speeds = st.floats(-FASTEST_M_S, FASTEST_M_S, width=32)
velocities = st.builds(Enu, speeds, speeds, speeds)

headers = st.builds(
    Header,
    origin_us=instants, seq=u32, origin=ids, destination=st.integers(1, 0xFFFF), prev_hop=ids,
    kind=st.sampled_from(wire.Kind).map(int),
    hop_limit=u8, hops=u8, priority=u8, flags=u8,
)  # fmt: skip
beacons = st.builds(
    Beacon, ids, st.integers(0, 0xFFFE), u16, u16, u16, u16, st.sampled_from(Role).map(int), u8, u32,
    st.integers(0, 0xFFFE),
)  # fmt: skip


@st.composite
def schedules(draw: st.DrawFn) -> Schedule:
    clusters = draw(st.integers(1, 0x8000))
    slot_us = draw(st.integers(1, (2**32 - 1) // clusters))
    parts = draw(st.integers(1, 255))
    entries = st.builds(Member, ids, st.integers(0, clusters - 1), st.booleans())
    members = tuple(draw(st.lists(entries, max_size=CAPACITY, unique_by=lambda member: member.node)))
    return Schedule(
        start_us=draw(instants), period_us=draw(st.integers(slot_us * clusters, 2**32 - 1)), slot_us=slot_us,
        epoch=draw(st.integers(1, 0xFFFF)) if members else 0, leader=draw(ids), clusters=clusters,
        part=draw(st.integers(0, parts - 1)), parts=parts, members=members, term=draw(u32),
    )  # fmt: skip


joins = st.builds(Join, ids, positions, velocities, st.integers(0, 0xFFFE))
powers = st.floats(-MOST_DBM, MOST_DBM, width=32)
survivors = st.builds(Survivor, instants, st.integers(1, MOST_SURVIVORS), ids, positions, powers)
instants_ns = st.integers(0, wire.LATEST_US * 1000 + 999)
times = st.builds(TimeBeacon, instants_ns, u32, u32, u32, u32, u16, ids, ids, u8, st.integers(1, 255)).map(
    lambda beacon: beacon._replace(hops=0) if beacon.reference == beacon.node else beacon
)
any_message = st.one_of(beacons, schedules(), joins, survivors, times)

HEADER = Header(12, 1, 3, 0xFFFF, 3, 0, 32, 0, 3, 0).encode()


@given(headers)
def test_a_header_is_decoded_as_it_was_encoded(header: Header) -> None:
    frame = header.encode()
    assert len(frame) == wire.HEADER_BYTES
    assert wire.decode_header(frame) == header
    assert wire.peek_kind(frame) == header.kind


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


@given(st.one_of(headers, beacons, joins, survivors, times))
def test_every_field_has_the_same_value_under_the_same_name_in_pymavlink(message: Any) -> None:
    frame = message.encode() if isinstance(message, Header) else message.encode_frame(7)
    (theirs,) = fanet.MAVLink(None).parse_buffer(bytearray(frame))
    ours = message._asdict()
    if "position" in ours:
        ours |= ours.pop("position")._asdict()
    if "velocity" in ours:
        ours |= {f"{axis}_speed": speed for axis, speed in ours.pop("velocity")._asdict().items()}
    if "rssi_dbm" in ours:
        ours["rssi"] = ours.pop("rssi_dbm")
    assert theirs.to_dict() == ours | {"mavpackettype": theirs.get_type(), "version": wire.VERSION}


@given(schedules())
def test_a_schedule_has_its_entries_in_two_parallel_arrays_in_pymavlink(schedule: Schedule) -> None:
    (theirs,) = fanet.MAVLink(None).parse_buffer(bytearray(schedule.encode_frame(1)))
    count = len(schedule.members)
    assert theirs.count == count
    assert theirs.nodes == [m.node for m in schedule.members] + [0] * (CAPACITY - count)
    assert theirs.assigned[:count] == [m.cluster + 0x8000 * m.is_head for m in schedule.members]
    for name in ("start_us", "period_us", "slot_us", "epoch", "leader", "clusters", "part", "parts", "term"):
        assert getattr(theirs, name) == getattr(schedule, name)


@given(u64, ids)
def test_what_pymavlink_writes_within_our_bounds_is_read_by_us(t_ns: int, node: int) -> None:
    hops = 0 if node == 9 else 2
    message = fanet.MAVLink_fanet_time_message(t_ns, 5, 4, 6, 7, 8, node, 9, 3, hops, wire.VERSION)
    frame = HEADER + bytes(message.pack(fanet.MAVLink(None, srcSystem=3, srcComponent=191)))
    if t_ns // 1000 > wire.LATEST_US:
        with pytest.raises(MalformedFrameError):
            TimeBeacon.decode_frame(frame)
    else:
        assert TimeBeacon.decode_frame(frame) == TimeBeacon(t_ns, 5, 4, 6, 7, 8, node, 9, 3, hops)


@pytest.mark.parametrize(("node", "reference", "hops"), [(3, 3, 1), (3, 4, 0), (3, 0, 1), (3, 0xFFFF, 1)])
def test_time_of_no_reference_or_of_a_reference_at_no_distance_is_malformed(
    node: int, reference: int, hops: int
) -> None:
    beacon = TimeBeacon(5, 0, 0, 0, 1, 1, node, reference, 0, hops)
    with pytest.raises(MalformedFrameError):
        TimeBeacon.decode_frame(HEADER + beacon.encode_frame(node))


@given(st.integers(64, 2304))
def test_header_and_filler_are_exactly_as_long_as_asked_and_whole_mavlink(payload_bytes: int) -> None:
    frame = HEADER + wire.filler(payload_bytes - wire.HEADER_BYTES)
    assert len(frame) == payload_bytes
    assert {msgid for msgid, _ in wire.inner_frames(frame)} == {53004}


@given(st.integers(17, 2268), ids)
def test_pymavlink_reads_filler_and_would_write_the_same(size: int, node: int) -> None:
    data = wire.filler.__wrapped__(size, node=node)  # past the cache: hypothesis would fill it
    chunks = fanet.MAVLink(None).parse_buffer(bytearray(data))
    assert [(chunk.index, chunk.count) for chunk in chunks] == [(i, len(chunks)) for i in range(len(chunks))]
    writer = fanet.MAVLink(None, srcSystem=wire.system_id(node), srcComponent=wire.COMPONENT)
    assert data == b"".join(bytes(chunk.pack(writer)) for chunk in map(_renumbered(writer), chunks))
    assert all(0 not in chunk.data[: chunk.length] for chunk in chunks)


def _renumbered(writer: fanet.MAVLink) -> Callable[[Any], Any]:
    """`pack` writes the writer's sequence; only `send` would count it up."""

    def renumber(message: Any) -> Any:
        writer.seq = message.get_seq()
        return type(message)(message.length, message.index, message.count, message.data)

    return renumber


@pytest.mark.parametrize("size", [-1, 1, 16, 65_281])
def test_filler_that_no_frames_can_add_up_to_is_refused(size: int) -> None:
    with pytest.raises(LocalProtocolError, match=str(size)):
        wire.filler(size)


@given(headers.filter(lambda header: header.hop_limit), ids, st.booleans())
def test_a_rewritten_frame_keeps_its_inner_bytes_and_its_name(header: Header, node: int, at_origin: bool) -> None:
    inner = wire.filler(100)
    hop = 0 if at_origin else 1
    frame = wire.rewrite(header.encode() + inner, node, 1, hop=hop)
    assert frame[wire.HEADER_BYTES :] == inner
    left, made = header.hop_limit - hop, min(header.hops + hop, wire.MOST_HOPS)
    after = header._replace(prev_hop=node, hop_limit=left, hops=made, flags=1)
    assert wire.decode_header(frame) == after
    assert frame == after.encode() + inner


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


FORMATS = {
    Beacon: wire.BEACON, Schedule: wire.SCHEDULE, Join: wire.JOIN, Survivor: wire.SURVIVOR, TimeBeacon: wire.TIME,
}  # fmt: skip


@given(st.sampled_from([*FORMATS]), st.data())
def test_a_right_crc_around_any_payload_gives_a_value_that_can_be_encoded_or_one_error(
    kind: Any, data: st.DataObject
) -> None:
    spec = FORMATS[kind]
    payload = data.draw(st.binary(min_size=spec.layout.size - 1, max_size=spec.layout.size - 1)) + b"\x01"
    frame = wire.encode_inner(spec, payload, node=1)
    with suppress(MalformedFrameError):
        value = kind.decode_frame(HEADER + frame)
        assert kind.decode_frame(HEADER + value.encode_frame(1)) == value


@given(st.binary(min_size=23, max_size=23))
def test_a_right_crc_around_any_header_gives_a_header_that_encodes_to_the_same_or_one_error(payload: bytes) -> None:
    kind = bytes((payload[18] % 5,))
    payload = payload[:18] + kind + payload[19:] + bytes((wire.VERSION,))
    _, seq, _, _, prev_hop, *_ = wire.ROUTE.layout.unpack(payload)
    frame = wire.encode_inner(wire.ROUTE, payload, node=prev_hop, seq=seq)
    with suppress(MalformedFrameError):
        assert wire.decode_header(frame).encode() == frame


@pytest.mark.parametrize(
    "change",
    [
        {"origin": 0}, {"origin": 0xFFFF}, {"prev_hop": 0}, {"prev_hop": 0xFFFF}, {"destination": 0}, {"kind": 7},
        {"origin_us": wire.LATEST_US + 1},
    ],
    ids=str,
)  # fmt: skip
def test_a_header_with_an_impossible_value_is_malformed(change: dict[str, int]) -> None:
    with pytest.raises(MalformedFrameError):
        wire.decode_header(wire.decode_header(HEADER)._replace(**change).encode())


SCHEDULE = Schedule(0, 1000, 250, 1, 1, 4, 0, 1, (Member(2, 0, is_head=True), Member(3, 3, is_head=True)))


@pytest.mark.parametrize(
    "change",
    [
        {"slot_us": 251}, {"slot_us": 0}, {"clusters": 0}, {"clusters": 3}, {"epoch": 0}, {"part": 1}, {"leader": 0},
        {"members": ()},
        {"members": (Member(0, 0, is_head=True),)}, {"members": (Member(0xFFFF, 0, is_head=True),)},
        {"start_us": wire.LATEST_US + 1},
    ],
    ids=str,
)  # fmt: skip
def test_a_schedule_that_cannot_be_obeyed_is_malformed(change: dict[str, Any]) -> None:
    assert Schedule.decode_frame(HEADER + SCHEDULE.encode_frame(1)) == SCHEDULE
    with pytest.raises(MalformedFrameError):
        Schedule.decode_frame(HEADER + SCHEDULE._replace(**change).encode_frame(1))


def test_a_schedule_too_long_for_a_message_is_our_own_mistake() -> None:
    with pytest.raises(LocalProtocolError, match="57 entries"):
        SCHEDULE._replace(members=(Member(2, 0, is_head=True),) * 57).encode_frame(1)


def flagged(frame: bytes, flags: int) -> bytes:
    """A JOIN with these incompatibility flags, its CRC right."""
    body = frame[:2] + bytes((flags,)) + frame[3:-2]
    return body + struct.pack("<H", mcrf4xx(body[1:] + bytes((wire.JOIN.crc_extra,))))


@pytest.mark.parametrize("flags", [2, 3, 0x80])
def test_a_frame_with_an_incompatibility_flag_nobody_knows_is_not_read(flags: int) -> None:
    inner = flagged(Join(3, Enu(1, 2, 3)).encode_frame(3), flags)
    with pytest.raises(MalformedFrameError, match="byte 36"):
        list(wire.inner_frames(HEADER + inner + bytes(13)))


def test_a_signed_inner_frame_is_passed_whole_with_its_signature() -> None:
    signed = flagged(Join(3, Enu(1, 2, 3)).encode_frame(3), 1) + bytes(13)
    assert list(wire.inner_frames(HEADER + signed)) == [(53006, signed)]
    assert Join.decode_frame(HEADER + signed) == Join(3, Enu(1, 2, 3))


@pytest.mark.parametrize(("size", "why"), [(28, "version 0"), (30, "30 bytes")])
def test_a_message_of_another_length_is_malformed_although_its_crc_is_right(size: int, why: str) -> None:
    payload = (wire.JOIN.layout.pack(1, 2, 3, 0, 0, 0, 3, 0, wire.VERSION) + b"\x01")[:size]
    with pytest.raises(MalformedFrameError, match=why):
        Join.decode_frame(HEADER + wire.encode_inner(wire.JOIN, payload, node=3))


BEACON = Beacon(node=3, head=4, head_seq=5, cluster=6, epoch=7, slot=8, role=2, hops_to_head=1)


@pytest.mark.parametrize(
    "change", [{"role": 3}, {"node": 0}, {"node": 0xFFFF}, {"head": 0xFFFF}, {"leader": 0xFFFF}], ids=str
)
def test_a_beacon_with_an_impossible_value_is_malformed(change: dict[str, int]) -> None:
    assert Beacon.decode_frame(HEADER + BEACON.encode_frame(3)) == BEACON
    with pytest.raises(MalformedFrameError):
        Beacon.decode_frame(HEADER + BEACON._replace(**change).encode_frame(3))


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
def test_a_position_or_a_power_that_is_no_number_is_malformed(bad: float) -> None:
    for message in (
        Join(3, Enu(bad, 0, 0)), Join(3, Enu(0, bad, 0)), Join(3, Enu(0, 0, bad)),
        Join(3, Enu(0, 0, 0), Enu(0, 0, bad)),
        Survivor(1, 2, 3, Enu(0, bad, 0), -70), Survivor(1, 2, 3, Enu(0, 0, 0), bad),
    ):  # fmt: skip
        with pytest.raises(MalformedFrameError):
            type(message).decode_frame(HEADER + message.encode_frame(3))


@given(any_message, any_message)
def test_a_broken_frame_before_the_wanted_one_spoils_the_packet(first: Any, second: Any) -> None:
    assume(type(first) is not type(second))
    broken = bytearray(first.encode_frame(1))
    broken[-1] ^= 1
    with pytest.raises(MalformedFrameError, match="CRC"):
        type(second).decode_frame(HEADER + bytes(broken) + second.encode_frame(1))


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


@given(st.lists(st.tuples(headers, st.sampled_from([0, 17, 60, 300])), min_size=1, max_size=6))
def test_a_bundle_is_taken_apart_into_what_it_was_made_of(parts: list[tuple[Header, int]]) -> None:
    packets = [header._replace(flags=header.flags & 3).encode() + wire.filler(size) for header, size in parts]
    apart = wire.unbundle(wire.bundle(packets))
    assert len(apart) == len(packets)
    for got, packet in zip(apart, packets, strict=True):
        header = wire.decode_header(got)
        assert header._replace(flags=header.flags & 3) == wire.decode_header(packet)
        assert got[wire.HEADER_BYTES :] == packet[wire.HEADER_BYTES :]
    more = [bool(wire.decode_header(got).flags & wire.FLAG_MORE) for got in apart]
    assert more == [True] * (len(packets) - 1) + [False]


@given(
    st.lists(st.tuples(headers, st.sampled_from([17, 60, 300])), min_size=1, max_size=5),
    st.lists(st.tuples(headers, st.sampled_from([0, 17, 60, 300])), max_size=3),
    st.integers(0, 3),
)
def test_what_is_known_of_packets_changes_nothing_about_how_a_bundle_is_taken_apart(
    parts: list[tuple[Header, int]], others: list[tuple[Header, int]], longer: int
) -> None:
    packets = [header._replace(flags=header.flags & 3).encode() + wire.filler(size) for header, size in parts]
    known = {packet[wire.END_TO_END]: packet[wire.HEADER_BYTES :] for packet in packets[longer:]}
    for (header, _), (_, size) in zip(parts, others, strict=False):  # another packet of that name was seen
        known[header.encode()[wire.END_TO_END]] = wire.filler(size)
    frame = wire.bundle(packets)
    assert wire.unbundle(frame, known) == wire.unbundle(frame)
    with pytest.raises(MalformedFrameError):
        wire.unbundle(frame[:-1], known)


@given(st.one_of(st.binary(max_size=120), st.binary(max_size=90).map(lambda tail: HEADER + tail)))
def test_garbage_for_a_bundle_is_one_error(data: bytes) -> None:
    with suppress(MalformedFrameError):
        assert b"".join(wire.unbundle(data)) == data

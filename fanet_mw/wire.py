"""One radio frame: MAVLink 2 frames, concatenated. First FANET_ROUTE, rewritten per hop; then inner frames, unchanged.

The codecs of our own dialect, by struct and a Rust CRC, because every reception passes here; pymavlink is their oracle
in the tests. Every decode is total: any bytes give a value or MalformedFrameError. Layouts: docs/wire.md.
"""

import math
import struct
from collections.abc import Iterator
from enum import IntEnum
from functools import lru_cache
from typing import Any, Final, NamedTuple, Self

from fastcrc.crc16 import mcrf4xx

from fanet_mw.errors import MalformedFrameError
from fanet_mw.rng import stream
from fanet_mw.units import Enu

MAGIC: Final = 0xFD
"""MAVLink 2 start of frame."""
COMPONENT: Final = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER: the companion computer that runs this middleware."""
VERSION: Final = 1
"""Of our messages; non-zero and last on the wire, so that MAVLink's trailing-zero truncation never shortens them."""

FLAG_FLOOD: Final = 1
"""The packet is in its flooding phase."""
FLAG_TO_HEAD: Final = 2
"""The packet is on its unicast way to a cluster head."""
PHASE_MASK: Final = FLAG_FLOOD | FLAG_TO_HEAD

PRIORITY_CONTROL: Final = 0
PRIORITY_SAFETY: Final = 1
PRIORITY_REPORT: Final = 2
PRIORITY_BULK: Final = 3

_OVERHEAD: Final = 12
"""Bytes of a MAVLink 2 frame around its payload: 10 before, 2 of CRC after."""
_PREFIX: Final = struct.Struct("<BBBBBBBHB")
_CRC: Final = struct.Struct("<H")


class Kind(IntEnum):
    """What a packet is, to the routing layer."""

    DATA = 0
    HELLO = 1
    JOIN = 2
    SCHEDULE = 3
    TIME = 4


class Role(IntEnum):
    """A node's part in its cluster."""

    ISOLATED = 0
    MEMBER = 1
    HEAD = 2


def system_id(node: int) -> int:
    """The MAVLink system id (1..250) that stands for a 16-bit node id; 251..255 stay free for ground stations."""
    return (node - 1) % 250 + 1


class Spec(NamedTuple):
    """What MAVLink needs to know of a message: id, CRC_EXTRA, payload layout."""

    msgid: int
    crc_extra: int
    layout: struct.Struct


def _frame(spec: Spec, payload: bytes, *, node: int, seq: int = 0) -> bytes:
    head = _PREFIX.pack(
        MAGIC, len(payload), 0, 0, seq & 0xFF, system_id(node), COMPONENT, spec.msgid & 0xFFFF, spec.msgid >> 16
    )
    crc = mcrf4xx(head[1:] + payload + bytes((spec.crc_extra,)))
    return head + payload + _CRC.pack(crc)


def _payload(spec: Spec, frame: bytes) -> tuple[Any, ...]:
    """The unpacked fields of the single frame `frame`; raises MalformedFrameError."""
    size = spec.layout.size
    if len(frame) != size + _OVERHEAD or frame[0] != MAGIC or frame[1] != size or frame[2]:
        raise MalformedFrameError(f"{len(frame)} bytes are no message {spec.msgid}")
    if frame[7] | frame[8] << 8 | frame[9] << 16 != spec.msgid:
        raise MalformedFrameError(f"not message {spec.msgid}")
    if mcrf4xx(frame[1:-2] + bytes((spec.crc_extra,))) != frame[-2] | frame[-1] << 8:
        raise MalformedFrameError(f"CRC of message {spec.msgid}")
    return spec.layout.unpack_from(frame, 10)


# --- the routing header -------------------------------------------------------------------------------------------

ROUTE: Final = Spec(53000, 34, struct.Struct("<QIHHHBBBBBB"))
HEADER_BYTES: Final = ROUTE.layout.size + _OVERHEAD
_ROUTE_MARK: Final = bytes((MAGIC, ROUTE.layout.size, 0))
_ROUTE_ID: Final = ROUTE.msgid.to_bytes(3, "little")
_PEEK: Final = struct.Struct("<IH")
_PEEK_AT: Final = 10 + 8
_FLAGS_AT: Final = 10 + 22
_EXTRA: Final = bytes((ROUTE.crc_extra,))
_ANY_NODE: Final = 0xFFFF


class Header(NamedTuple):
    """FANET_ROUTE. `origin_us` is swarm time [us]; ids are node ids; `destination` 0xFFFF means every node."""

    origin_us: int
    seq: int
    origin: int
    destination: int
    prev_hop: int
    kind: int
    hop_limit: int
    hops: int
    priority: int
    flags: int

    def encode(self) -> bytes:
        return _route_frame(ROUTE.layout.pack(*self, VERSION), prev_hop=self.prev_hop, seq=self.seq)


def _route_frame(payload: bytes, *, prev_hop: int, seq: int) -> bytes:
    """The transmitter of this hop is the MAVLink sender; the MAVLink sequence is the packet's, low byte."""
    head = _PREFIX.pack(
        MAGIC, len(payload), 0, 0, seq & 0xFF, system_id(prev_hop), COMPONENT, ROUTE.msgid & 0xFFFF, ROUTE.msgid >> 16
    )
    return head + payload + _CRC.pack(mcrf4xx(head[1:] + payload + _EXTRA))


def peek(frame: bytes) -> tuple[int, int, int] | None:
    """(origin, seq, flags) at their fixed offsets, unchecked; None when these bytes cannot begin with our header.

    Enough to recognize a duplicate; whoever goes on must `decode_header`.
    """
    if len(frame) < HEADER_BYTES or frame[:3] != _ROUTE_MARK or frame[7:10] != _ROUTE_ID:
        return None
    seq, origin = _PEEK.unpack_from(frame, _PEEK_AT)
    return origin, seq, frame[_FLAGS_AT]


def decode_header(frame: bytes) -> Header:
    """The routing header of a frame; raises MalformedFrameError."""
    if peek(frame) is None:
        raise MalformedFrameError("no routing header")
    if mcrf4xx(frame[1 : HEADER_BYTES - 2] + _EXTRA) != frame[HEADER_BYTES - 2] | frame[HEADER_BYTES - 1] << 8:
        raise MalformedFrameError("CRC of the routing header")
    *fields, version = ROUTE.layout.unpack_from(frame, 10)
    header = Header(*fields)
    if version != VERSION or header.kind > Kind.TIME or header.origin in (0, _ANY_NODE) or header.prev_hop == 0:
        raise MalformedFrameError(f"routing header {header}, version {version}")
    return header


def rewrite(frame: bytes, *, prev_hop: int, hop_limit: int, hops: int, flags: int) -> bytes:
    """The frame for its next hop: a new header, the inner frames byte for byte. The frame must have been decoded."""
    header = Header(*ROUTE.layout.unpack_from(frame, 10)[:-1])
    header = header._replace(prev_hop=prev_hop, hop_limit=hop_limit, hops=hops, flags=flags)
    return header.encode() + frame[HEADER_BYTES:]


# --- inner frames -------------------------------------------------------------------------------------------------


def inner_frames(frame: bytes) -> Iterator[tuple[int, bytes]]:
    """(message id, whole MAVLink frame) of each inner frame, in order; raises MalformedFrameError at a broken one.

    Checks lengths only: the CRC needs the message's definition, which its decoder has.
    """
    at = HEADER_BYTES
    while at < len(frame):
        if len(frame) - at < _OVERHEAD or frame[at] != MAGIC:
            raise MalformedFrameError(f"no MAVLink 2 frame at byte {at}")
        end = at + _OVERHEAD + frame[at + 1] + (13 if frame[at + 2] & 1 else 0)  # a signature is 13 bytes
        if end > len(frame):
            raise MalformedFrameError(f"frame at byte {at} ends beyond the end")
        yield frame[at + 7] | frame[at + 8] << 8 | frame[at + 9] << 16, frame[at:end]
        at = end


def _inner(spec: Spec, frame: bytes) -> tuple[Any, ...]:
    """The fields of the first inner frame that is this message; raises MalformedFrameError."""
    for msgid, inner in inner_frames(frame):
        if msgid == spec.msgid:
            return _payload(spec, inner)
    raise MalformedFrameError(f"no message {spec.msgid} in the frame")


def _check(version: int, node: int) -> None:
    if version != VERSION or not 0 < node < _ANY_NODE:
        raise MalformedFrameError(f"version {version}, node {node}")


class Beacon(NamedTuple):
    """FANET_BEACON: the routing part of a hello."""

    node: int
    head: int
    head_seq: int
    cluster: int
    epoch: int
    slot: int
    role: int
    hops_to_head: int

    def encode_frame(self, node: int) -> bytes:
        return _frame(BEACON, BEACON.layout.pack(*self, VERSION), node=node)

    @classmethod
    def decode_frame(cls, frame: bytes) -> Self:
        *fields, version = _inner(BEACON, frame)
        beacon = cls(*fields)
        _check(version, beacon.node)
        return beacon


class Member(NamedTuple):
    """One entry of a schedule."""

    node: int
    cluster: int
    is_head: bool


_HEAD_BIT: Final = 0x8000


class Schedule(NamedTuple):
    """FANET_SCHEDULE: one part of the leader's assignment."""

    start_us: int
    period_us: int
    slot_us: int
    epoch: int
    leader: int
    clusters: int
    part: int
    parts: int
    members: tuple[Member, ...]

    def encode_frame(self, node: int) -> bytes:
        unused = (0,) * (CAPACITY - len(self.members))
        return _frame(
            SCHEDULE,
            SCHEDULE.layout.pack(
                *self[:6],
                *(m.node for m in self.members),
                *unused,
                *(m.cluster | (_HEAD_BIT if m.is_head else 0) for m in self.members),
                *unused,
                self.part,
                self.parts,
                len(self.members),
                VERSION,
            ),
            node=node,
        )

    @classmethod
    def decode_frame(cls, frame: bytes) -> Self:
        fields = _inner(SCHEDULE, frame)
        part, parts, count, version = fields[-4:]
        nodes, assigned = fields[6 : 6 + CAPACITY], fields[6 + CAPACITY : 6 + 2 * CAPACITY]
        if count > CAPACITY or part >= parts:
            raise MalformedFrameError(f"schedule part {part} of {parts} with {count} entries")
        members = tuple(
            Member(node, entry & ~_HEAD_BIT, bool(entry & _HEAD_BIT))
            for node, entry in zip(nodes[:count], assigned[:count], strict=True)
        )
        start_us, period_us, slot_us, epoch, leader, clusters = fields[:6]
        schedule = cls(start_us, period_us, slot_us, epoch, leader, clusters, part, parts, members)
        _check(version, schedule.leader)
        if not 0 < schedule.slot_us <= schedule.period_us or not schedule.epoch:
            raise MalformedFrameError(f"schedule epoch {schedule.epoch}, slot {schedule.slot_us} us")
        return schedule


class Join(NamedTuple):
    """FANET_JOIN."""

    node: int
    position: Enu

    def encode_frame(self, node: int) -> bytes:
        return _frame(JOIN, JOIN.layout.pack(*self.position, self.node, VERSION), node=node)

    @classmethod
    def decode_frame(cls, frame: bytes) -> Self:
        east, north, up, node, version = _inner(JOIN, frame)
        _check(version, node)
        return cls(node, _finite(east, north, up))


class Survivor(NamedTuple):
    """FANET_SURVIVOR: `reporter`, at `position`, hears the phone of `survivor`."""

    t_us: int
    survivor: int
    reporter: int
    position: Enu
    rssi_dbm: float

    def encode_frame(self, node: int) -> bytes:
        payload = SURVIVOR.layout.pack(self.t_us, self.survivor, *self.position, self.rssi_dbm, self.reporter, VERSION)
        return _frame(SURVIVOR, payload, node=node)

    @classmethod
    def decode_frame(cls, frame: bytes) -> Self:
        t_us, survivor, east, north, up, rssi_dbm, reporter, version = _inner(SURVIVOR, frame)
        _check(version, reporter)
        if not math.isfinite(rssi_dbm):
            raise MalformedFrameError(f"rssi {rssi_dbm}")
        return cls(t_us, survivor, reporter, _finite(east, north, up), rssi_dbm)


class TimeBeacon(NamedTuple):
    """FANET_TIME: what the sender believes the swarm time to be."""

    t_us: int
    error_us: int
    node: int
    reference: int
    hops: int

    def encode_frame(self, node: int) -> bytes:
        return _frame(TIME, TIME.layout.pack(*self, VERSION), node=node)

    @classmethod
    def decode_frame(cls, frame: bytes) -> Self:
        *fields, version = _inner(TIME, frame)
        beacon = cls(*fields)
        _check(version, beacon.node)
        return beacon


def _finite(east: float, north: float, up: float) -> Enu:
    if not (math.isfinite(east) and math.isfinite(north) and math.isfinite(up)):
        raise MalformedFrameError(f"position {east}, {north}, {up}")
    return Enu(east, north, up)


BEACON: Final = Spec(53001, 138, struct.Struct("<HHHHHHBBB"))
SCHEDULE: Final = Spec(53002, 158, struct.Struct("<QIIHHH56H56HBBBB"))
SURVIVOR: Final = Spec(53003, 240, struct.Struct("<QIffffHB"))
CHUNK: Final = Spec(53004, 155, struct.Struct("<HBB240B"))
TIME: Final = Spec(53005, 192, struct.Struct("<QIHHBB"))
JOIN: Final = Spec(53006, 50, struct.Struct("<fffHB"))
SPECS: Final = (ROUTE, BEACON, SCHEDULE, SURVIVOR, CHUNK, TIME, JOIN)
CAPACITY: Final = 56
"""Entries of one schedule part."""

# --- application data ---------------------------------------------------------------------------------------------

_CHUNK_HEAD: Final = struct.Struct("<HBB")
_CHUNK_DATA: Final = 240
_LEAST_CHUNK: Final = _OVERHEAD + _CHUNK_HEAD.size + 1


@lru_cache(maxsize=64)
def filler(size: int) -> bytes:
    """Inner FANET_CHUNK frames of exactly `size` bytes: application data whose content does not matter.

    `size` is 0 or at least 17, one frame with one byte of data. The bytes are fixed, pseudo-random and never zero, so
    that nothing is truncated and nothing depends on a run.
    """
    if size == 0:
        return b""
    if size < _LEAST_CHUNK:
        raise ValueError(f"filler of {size} bytes: must be 0 or >= {_LEAST_CHUNK}")
    whole = _LEAST_CHUNK - 1 + _CHUNK_DATA
    lengths = [whole] * (size // whole)
    rest = size % whole
    if rest and rest < _LEAST_CHUNK:  # too short for a frame of its own: the one before gives some bytes
        lengths[-1] -= _LEAST_CHUNK - rest
        rest = _LEAST_CHUNK
    if rest:
        lengths.append(rest)
    random = stream(0, "filler", size)
    frames = []
    for index, length in enumerate(lengths):
        data = bytes(random.randint(1, 255) for _ in range(length - _LEAST_CHUNK + 1))
        payload = _CHUNK_HEAD.pack(len(data), index, len(lengths)) + data
        frames.append(_frame(CHUNK, payload, node=1, seq=index))
    return b"".join(frames)

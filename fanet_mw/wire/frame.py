"""The format of a radio frame: MAVLink 2 frames one after another, first FANET_ROUTE, then inner frames.

The header, and the frame around each message of this dialect, are coded by struct and a Rust CRC, because every
reception passes here; tests compare them with pymavlink. Layouts: docs/reference/air-format.md.
"""

import struct
from collections.abc import Iterable, Iterator
from enum import IntEnum
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from fastcrc.crc16 import kermit, mcrf4xx

from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.rng import stream
from fanet_mw.units import US

MAGIC: Final = 0xFD
"""The start byte of a MAVLink 2 frame."""
COMPONENT: Final = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER: the companion computer that runs this middleware."""
VERSION: Final = 1
"""The version of this dialect's messages; it is non-zero and last, so that MAVLink never truncates them."""

FLAG_FLOOD: Final = 1
"""The packet is in its flooding phase."""
FLAG_TO_HEAD: Final = 2
"""The packet is on its unicast way to a cluster head."""
PHASE_MASK: Final = FLAG_FLOOD | FLAG_TO_HEAD
FLAG_MORE: Final = 4
"""Another packet with its own header follows in the same radio frame."""
FLAG_TURN: Final = 8
"""The packet's flood began in a turn that its origin has by a timetable."""
FLAG_DEAF: Final = 16
"""The packet's origin had heard nobody for some time when it sent the packet."""

PRIORITY_CONTROL: Final = 0
PRIORITY_SAFETY: Final = 1
PRIORITY_REPORT: Final = 2
PRIORITY_BULK: Final = 3
PRIORITIES: Final = MappingProxyType({"safety": PRIORITY_SAFETY, "report": PRIORITY_REPORT, "bulk": PRIORITY_BULK})
"""The priorities of applications' packets, by their names."""

OVERHEAD: Final = 12
"""The length of a MAVLink 2 frame without its payload: 10 bytes in front, and 2 of CRC behind."""
_PREFIX: Final = struct.Struct("<BBBBBBBHB")
_CRC: Final = struct.Struct("<H")
_SIGNED: Final = 1
"""The only incompatibility flag that MAVLink 2 defines; a frame with another flag must not be read."""
_SIGNATURE: Final = 13
MOST_HOPS: Final = 255
"""The greatest number of hops that the routing header can state."""
LATEST_US: Final = (1 << 63) // US - 1
"""The latest instant that a message may state; in nanoseconds it still fits the 64 bits of bus and kernel."""


class Kind(IntEnum):
    """The kind of a packet, for the routing layer."""

    DATA = 0
    HELLO = 1
    JOIN = 2
    SCHEDULE = 3
    TIME = 4
    LINKS = 5
    """The leader's links of an assignment."""
    ROUND = 6
    """What a node tells its neighbors in its turn of a round (`rounds.py`)."""
    ROUTING = 8
    """A control message of a rival protocol (`fanet_mw.routing.rival_control_messages`)."""


_KINDS: Final = frozenset(int(kind) for kind in Kind)


def system_id(node: int) -> int:
    """The MAVLink system id (1..250) that stands for a 16-bit node id; 251..255 stay free for ground stations."""
    return (node - 1) % 250 + 1


def node_of_system(system: int, *, nodes: int) -> int:
    """The node of a swarm of so many that a system id stands for; 0 if there are several."""
    return system if nodes < system + 250 else 0


class Spec(NamedTuple):
    """The definition of a message, as MAVLink needs it: id, CRC_EXTRA, payload layout."""

    msgid: int
    crc_extra: int
    layout: struct.Struct


def encode_inner(spec: Spec, payload: bytes, *, node: int, seq: int = 0) -> bytes:
    """A MAVLink 2 frame with one message of this dialect."""
    head = _PREFIX.pack(
        MAGIC, len(payload), 0, 0, seq & 0xFF, system_id(node), COMPONENT, spec.msgid & 0xFFFF, spec.msgid >> 16
    )
    crc = mcrf4xx(head[1:] + payload + bytes((spec.crc_extra,)))
    return head + payload + _CRC.pack(crc)


def encode_truncated(spec: Spec, payload: bytes, *, node: int) -> bytes:
    """The same without the zeros at the end of the payload, as MAVLink 2 leaves them out."""
    return encode_inner(spec, payload[:1] + payload[1:].rstrip(b"\0"), node=node)


def message_id(frame: bytes, at: int = 0) -> int:
    """The id of the message in the MAVLink 2 frame at an offset."""
    return frame[at + 7] | frame[at + 8] << 8 | frame[at + 9] << 16


# --- the routing header -------------------------------------------------------------------------------------------

ROUTE: Final = Spec(53000, 34, struct.Struct("<QIHHHBBBBBB"))
HEADER_BYTES: Final = ROUTE.layout.size + OVERHEAD
_ROUTE_MARK: Final = bytes((MAGIC, ROUTE.layout.size, 0))
ROUTE_ID: Final = ROUTE.msgid.to_bytes(3, "little")
"""The message id of a routing header, as it stands in a frame."""
_ROUTE_BEFORE: Final = _ROUTE_MARK + b"\0"
_ROUTE_SENDER: Final = bytes((COMPONENT,)) + ROUTE_ID
_EXTRA: Final = bytes((ROUTE.crc_extra,))
ANY_NODE: Final = 0xFFFF
"""An id that no node has."""

# These layouts cover whole headers, including MAVLink's ten bytes, because the calls of struct take the most time.
_PACKED: Final = struct.Struct("<4sBB4s" + ROUTE.layout.format[1:])
_CHECKED: Final = struct.Struct("<3s4x3s" + ROUTE.layout.format[1:] + "H")
_BODY_END: Final = HEADER_BYTES - 2
_PAYLOAD_AT: Final = 10
"""Where the payload of a MAVLink 2 frame begins."""
_SYSTEM_AT: Final = 5
END_TO_END: Final = slice(10, 26)
"""The bytes of a routing header that no hop changes: birth, sequence number, origin and destination."""
NAME: Final = slice(18, 24)
"""The bytes of a header that name its packet: sequence number and origin."""
SEQ: Final = slice(18, 22)
"""The bytes of a header that hold its packet's sequence number, the low byte first."""
INNER_ID: Final = slice(HEADER_BYTES + 7, HEADER_BYTES + 10)
"""The bytes of a packet that hold the message id of its first inner frame."""
_PREV_HOP_AT: Final = 26
_KIND_AT: Final = 28
_HOP_LIMIT_AT: Final = 29
_HOPS_AT: Final = 30
_PRIORITY_AT: Final = 31
_FLAGS_AT: Final = 32
_COVERED: Final = slice(1, _BODY_END)
"""The bytes of a header that its CRC covers, together with CRC_EXTRA."""
_INNER: Final = slice(HEADER_BYTES, None)

# To make these once and not for every frame saves a fifth of the time that `rewrite` takes.
_BEFORE_SYSTEM: Final = slice(1, _SYSTEM_AT)
_BEFORE_PREV_HOP: Final = slice(_SYSTEM_AT + 1, _PREV_HOP_AT)
_VERSION_AND_EXTRA: Final = bytes((VERSION, ROUTE.crc_extra))
_pack_covered: Final = struct.Struct("<4sB20sH5B2s").pack
"""Packs the bytes that the CRC of a header covers: the header without its first byte, then CRC_EXTRA."""
_pack_header: Final = struct.Struct("<c33sH").pack
"""Packs a header of its first byte, the rest without CRC_EXTRA, and the CRC."""
_START: Final = bytes((MAGIC,))


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
        """The header's bytes; MAVLink's sender is the transmitter, its sequence the low byte of the packet's number."""
        sender = system_id(self.prev_hop)
        body = _PACKED.pack(_ROUTE_BEFORE, self.seq & 0xFF, sender, _ROUTE_SENDER, *self, VERSION)
        return body + _CRC.pack(mcrf4xx(body[1:] + _EXTRA))


_new: Final = tuple.__new__
"""Makes a named tuple three times as fast as its class does, for objects that are made once per frame."""


Fields = tuple[bytes, bytes, int, int, int, int, int, int, int, int, int, int, int, int]
"""The values at the fixed offsets of a header, unchecked: two marks, the fields of the header, version, CRC."""
NO_FIELDS: Final[Fields] = (b"", b"", 0, 0, 0, 0, 0, 0, 0, 0, 0, PHASE_MASK, 0, 0)
"""The fields of bytes that cannot begin with a routing header: in both phases at once, as no packet is."""


def fields_of(frame: bytes) -> Fields:
    """The values at a header's offsets; NO_FIELDS if there can be none. Enough for duplicates; else see `checked`."""
    if len(frame) < HEADER_BYTES:
        return NO_FIELDS
    fields: Fields = _CHECKED.unpack_from(frame)
    return fields if fields[0] == _ROUTE_MARK and fields[1] == ROUTE_ID else NO_FIELDS


def peek_kind(frame: bytes) -> int | None:
    """The kind of a packet, unchecked; None if these bytes cannot begin with a routing header."""
    whole = len(frame) >= HEADER_BYTES and frame[:3] == _ROUTE_MARK and frame[7:10] == ROUTE_ID
    return frame[_KIND_AT] if whole else None


def decode_header(frame: bytes) -> Header:
    """The routing header of a frame; raises MalformedFrameError."""
    fields = fields_of(frame)
    if fields is NO_FIELDS:
        raise MalformedFrameError("no routing header")
    return checked(frame, fields)


def checked(frame: bytes, fields: Fields) -> Header:
    """The routing header of a frame with these fields; raises MalformedFrameError."""
    _, _, origin_us, _, origin, destination, prev_hop, kind, _, _, _, _, version, crc = fields
    if mcrf4xx(frame[_COVERED] + _EXTRA) != crc:
        raise MalformedFrameError("CRC of the routing header")
    header = _new(Header, fields[2:12])  # all between the marks and the version
    if (
        version != VERSION
        or kind not in _KINDS
        or origin_us > LATEST_US
        or not 0 < origin < ANY_NODE
        or not 0 < prev_hop < ANY_NODE
        or not destination
    ):
        raise MalformedFrameError(f"routing header {header}, version {version}")
    return header


def rewrite(frame: bytes, prev_hop: int, flags: int, hop: int = 1) -> bytes:
    """The frame as `prev_hop` transmits it: a new header, the same inner frames. A hop less is left and one more made,
    not with `hop=0` at the origin; the frame must have been decoded, with a hop limit of at least `hop`.
    """
    sender = (prev_hop - 1) % 250 + 1  # system_id, without the call
    hops = frame[_HOPS_AT] + hop
    if hops > MOST_HOPS:  # a hostile frame may state the greatest number
        hops = MOST_HOPS
    covered = _pack_covered(
        frame[_BEFORE_SYSTEM], sender, frame[_BEFORE_PREV_HOP], prev_hop,
        frame[_KIND_AT], frame[_HOP_LIMIT_AT] - hop, hops, frame[_PRIORITY_AT], flags, _VERSION_AND_EXTRA,
    )  # fmt: skip
    return _pack_header(_START, covered, mcrf4xx(covered)) + frame[_INNER]


def with_more(packet: bytes) -> bytes:
    """The packet with the flag that another one follows it in the same frame."""
    body = bytearray(packet[:_BODY_END])
    body[_FLAGS_AT] |= FLAG_MORE
    return b"".join((body, _CRC.pack(mcrf4xx(bytes(body[1:]) + _EXTRA)), packet[HEADER_BYTES:]))


# --- inner frames -------------------------------------------------------------------------------------------------


def end_of_frame(data: bytes, at: int) -> int:
    """Where the MAVLink 2 frame at an offset ends, found by its length alone; raises MalformedFrameError."""
    if len(data) - at < OVERHEAD or data[at] != MAGIC or data[at + 2] & ~_SIGNED:
        raise MalformedFrameError(f"no MAVLink 2 frame at byte {at}")
    end = at + OVERHEAD + data[at + 1] + (_SIGNATURE if data[at + 2] else 0)
    if end > len(data):
        raise MalformedFrameError(f"frame at byte {at} ends beyond the end")
    return end


def frames(data: bytes, *, start: int = 0) -> Iterator[bytes]:
    """Each of several successive MAVLink 2 frames; raises MalformedFrameError at a broken one."""
    at = start
    while at < len(data):
        end = end_of_frame(data, at)
        yield data[at:end]
        at = end


def renumbered(frame: bytes, seq: int) -> bytes:
    """A MAVLink 2 frame with another sequence number; its CRC stays right, or wrong: the change alone, as a CRC from 0,
    tells the effect. A signed frame keeps its number, which its signature covers.
    """
    change = frame[4] ^ seq
    if not change or frame[2]:
        return frame
    covered = OVERHEAD - 2 + frame[1]  # the CRC covers all but the magic byte, and CRC_EXTRA
    (crc,) = _CRC.unpack_from(frame, covered)
    crc ^= kermit(bytes((0, 0, 0, change)) + bytes(covered - 4))
    return frame[:4] + bytes((seq,)) + frame[5:covered] + _CRC.pack(crc)


class Content(NamedTuple):
    """The inner frames of a packet, found and checked; decoders accept it in place of the packet."""

    inner: tuple[tuple[int, bytes], ...]
    """(message id, whole MAVLink frame) of each, in order."""

    @classmethod
    def of(cls, frame: bytes) -> "Content":
        """The content of a packet, routing header first; raises MalformedFrameError unless all of it is valid."""
        return cls(tuple(_found_in(frame)))


Packed = bytes | Content
"""A packet, routing header first, or its content if that was found already."""


def inner_frames(packed: Packed) -> Iterable[tuple[int, bytes]]:
    """(message id, whole MAVLink frame) of each inner frame, in order; raises MalformedFrameError at a broken one."""
    return packed.inner if isinstance(packed, Content) else _found_in(packed)


def _found_in(frame: bytes) -> Iterator[tuple[int, bytes]]:
    """The inner frames of a packet; the CRC is checked of this dialect's only, others need their definition."""
    for inner in frames(frame, start=HEADER_BYTES):
        msgid = message_id(inner)
        spec = _OURS.get(msgid)
        if spec is not None:
            end = OVERHEAD + inner[1]
            crc = mcrf4xx(inner[1 : end - 2] + bytes((spec.crc_extra,)))
            if crc != inner[end - 2] | inner[end - 1] << 8:
                raise MalformedFrameError(f"CRC of message {msgid}")
        yield msgid, inner


def decode_every(spec: Spec, packed: Packed) -> list[tuple[Any, ...]]:
    """The fields of each inner frame with this message; raises MalformedFrameError."""
    found = []
    for msgid, inner in inner_frames(packed):
        if msgid == spec.msgid:
            if inner[1] > spec.layout.size:
                raise MalformedFrameError(f"message {msgid} of {inner[1]} bytes must have <= {spec.layout.size}")
            found.append(_filled(spec, inner))
    return found


def _filled(spec: Spec, inner: bytes) -> tuple[Any, ...]:
    """The fields of an inner frame; zeros that its sender left out at the end of the payload are filled in."""
    if inner[1] == spec.layout.size:
        return spec.layout.unpack_from(inner, _PAYLOAD_AT)
    return spec.layout.unpack(inner[_PAYLOAD_AT : _PAYLOAD_AT + inner[1]].ljust(spec.layout.size, b"\0"))


def fields_of_each(packed: Packed) -> Iterator[tuple[Spec, tuple[Any, ...]]]:
    """The fields of each inner frame with a message of this dialect; raises MalformedFrameError."""
    for msgid, inner in inner_frames(packed):
        spec = _OURS.get(msgid)
        if spec is not None and inner[1] <= spec.layout.size:
            yield spec, _filled(spec, inner)


def decode_first(spec: Spec, packed: Packed) -> tuple[Any, ...]:
    """The fields of the first inner frame with this message; raises MalformedFrameError."""
    found = decode_every(spec, packed)
    if not found:
        raise MalformedFrameError(f"no message {spec.msgid} in the frame")
    return found[0]


# The codecs of these messages are in the other files of this package; that of ROUTING is in
# `routing/rival_control_messages.py`.
BEACON: Final = Spec(53001, 43, struct.Struct("<IHHHHHHHBBB"))
SCHEDULE: Final = Spec(53002, 88, struct.Struct("<QIIIHHH56H56HBBBB"))
SURVIVOR: Final = Spec(53003, 240, struct.Struct("<QIffffHB"))
CHUNK: Final = Spec(53004, 155, struct.Struct("<HBB240B"))
TIME: Final = Spec(53005, 172, struct.Struct("<QIIIIHHHBBB"))
JOIN: Final = Spec(53006, 221, struct.Struct("<ffffffHHB"))
DIGEST: Final = Spec(53007, 37, struct.Struct("<24I24I24HBBB"))
PLACES: Final = Spec(53008, 1, struct.Struct("<28h28h28hhhhBBB"))
ROUTING: Final = Spec(53010, 255, struct.Struct("<BBBB240B"))
LINKS: Final = Spec(53011, 92, struct.Struct("<IHH36H36H36B36bBBBB"))
MESSAGE: Final = Spec(53012, 170, struct.Struct("<QIIIIHHHBBBB"))
RECEIPT: Final = Spec(53013, 26, struct.Struct("<QIBB"))
TARGETS: Final = Spec(53014, 54, struct.Struct("<32HBB"))
LOADS: Final = Spec(53015, 190, struct.Struct("<56HBB"))
HEARD: Final = Spec(53016, 200, struct.Struct("<64BBBB"))
HELD: Final = Spec(53017, 58, struct.Struct("<16I16HBB"))
SEARCH: Final = Spec(53020, 215, struct.Struct("<QffffffHHHBBBBBB200B"))
STATUS: Final = Spec(53021, 210, struct.Struct("<QfffHHBBB"))
BIDS: Final = Spec(53022, 212, struct.Struct("<12H12H12H12HH12BBB"))
FOUND: Final = Spec(53023, 195, struct.Struct("<QIfffffHBB"))
ROLL: Final = Spec(53025, 142, struct.Struct("<IHHB200B"))
ORDER: Final = Spec(53026, 213, struct.Struct("<QfffHHHBB"))
SPECS: Final = (
    ROUTE, BEACON, SCHEDULE, SURVIVOR, CHUNK, TIME, JOIN, DIGEST, PLACES, ROUTING, LINKS,
    MESSAGE, RECEIPT, TARGETS, LOADS, HEARD, HELD, SEARCH, STATUS, BIDS, FOUND,
    ROLL, ORDER,
)  # fmt: skip
_OURS: Final = {spec.msgid: spec for spec in SPECS}

# --- application data ---------------------------------------------------------------------------------------------

CHUNK_HEAD: Final = struct.Struct("<HBB")
"""The beginning of the payload of a FANET_CHUNK: the length of its data, its number, and the number of chunks."""
CHUNK_DATA: Final = 240
_LEAST_CHUNK: Final = OVERHEAD + CHUNK_HEAD.size + 1
_WHOLE_CHUNK: Final = OVERHEAD + CHUNK_HEAD.size + CHUNK_DATA
_MOST: Final = 255 * _WHOLE_CHUNK


@lru_cache(maxsize=256)
def filler(size: int, *, node: int = 1) -> bytes:
    """Inner FANET_CHUNK frames of exactly `size` bytes (0, or at least 17), pseudo-random and never zero."""
    if size == 0:
        return b""
    if not _LEAST_CHUNK <= size <= _MOST:
        raise LocalProtocolError(f"filler size = {size} must be 0 or in [{_LEAST_CHUNK}, {_MOST}]")
    lengths = [_WHOLE_CHUNK] * (size // _WHOLE_CHUNK)
    rest = size % _WHOLE_CHUNK
    # it would be too short for a frame of its own, so the previous frame gives up some bytes
    if 0 < rest < _LEAST_CHUNK:
        lengths[-1] -= _LEAST_CHUNK - rest
        rest = _LEAST_CHUNK
    if rest:
        lengths.append(rest)
    random = stream(0, "filler", size)
    chunks = []
    for index, length in enumerate(lengths):
        data = random.randbytes(length - _LEAST_CHUNK + 1).replace(b"\x00", b"\x01")
        payload = CHUNK_HEAD.pack(len(data), index, len(lengths)) + data
        chunks.append(encode_inner(CHUNK, payload, node=node, seq=index))
    return b"".join(chunks)

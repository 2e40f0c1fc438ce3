"""Near misses of valid bytes: one field of a message at its bound, a frame dropped or doubled, a length that lies.

What is changed is wrapped up again, lengths and checksums right, most of the time: what a checksum refuses says
nothing about what is behind it. Fields are those of MAVLink's layouts and need no list here.
"""

import math
import re
import struct
from collections.abc import Sequence
from random import Random
from typing import Final, NamedTuple

from fastcrc.crc16 import mcrf4xx

from fanet_mw import mavlink, wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing import rival_control_messages as control

_FLOATS: Final = (
    0.0, -0.0, 1.0, -1.0, 1e-30, 1e10, -1e10, 3e38, -3e38, math.inf, -math.inf, math.nan, 300.0, -300.0, 1e5, 1e6,
)  # fmt: skip
_BYTES_OF: Final = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "q": 8, "Q": 8, "f": 4, "d": 8}
_PAYLOAD_AT: Final = 10
"""Where the payload of a MAVLink 2 frame begins."""


class Field(NamedTuple):
    """One number in a payload."""

    code: str
    at: int


def fields_of(layout: struct.Struct) -> tuple[Field, ...]:
    """Every number of a little-endian layout without padding."""
    codes = "".join(code * int(count or 1) for count, code in re.findall(r"(\d*)([a-zA-Z])", layout.format))
    found, at = [], 0
    for code in codes:
        found.append(Field(code, at))
        at += _BYTES_OF[code]
    assert at == layout.size, f"{layout.format} is not understood"
    return tuple(found)


class Layout(NamedTuple):
    """What has to be known of a MAVLink message to change a field of it."""

    size: int
    crc_extra: bytes
    fields: tuple[Field, ...]


_LAYOUTS: Final = {
    msgid: Layout(kind.unpacker.size, bytes((kind.crc_extra,)), fields_of(kind.unpacker))
    for msgid, kind in mavlink.common.mavlink_map.items()  # both dialects
    if "s" not in kind.unpacker.format
}
_NO_LAYOUT: Final = Layout(0, b"\0", ())


def number(code: str, old: float, pick: Random) -> int | float:
    """Another value for a field of this code: a bound, a neighbor of the old one, or any."""
    if code in "fd":
        return pick.choice(_FLOATS) if pick.random() < 0.7 else pick.uniform(-1e3, 1e3)
    bits = 8 * _BYTES_OF[code]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if code.islower() else (0, (1 << bits) - 1)
    dice = pick.random()
    if dice < 0.3:
        return max(low, min(high, int(old) + pick.choice((-2, -1, 1, 2))))
    if dice < 0.6:
        return pick.choice((low, low + 1, high, high - 1, (low + high) // 2, (low + high) // 2 + 1))
    if dice < 0.8:
        return pick.randint(low, min(high, max(low, 20)))
    return pick.randint(low, high)


def with_another_number(data: bytes, field: Field, pick: Random, *, start: int = 0) -> bytes:
    """The same bytes with one field changed."""
    layout = struct.Struct("<" + field.code)
    changed = bytearray(data)
    (old,) = layout.unpack_from(changed, start + field.at)
    layout.pack_into(changed, start + field.at, number(field.code, old, pick))
    return bytes(changed)


def scrambled(data: bytes, pick: Random) -> bytes:
    """Bytes changed without any idea of what they mean: flipped, cut off, doubled, filled up."""
    if not data or pick.random() < 0.02:
        return pick.randbytes(pick.randrange(80))
    kind, at = pick.randrange(6), pick.randrange(len(data))
    if kind == 0:
        return data[:at] + bytes((data[at] ^ 1 << pick.randrange(8),)) + data[at + 1 :]
    if kind == 1:
        return data[:at] + bytes((pick.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF)),)) + data[at + 1 :]
    if kind == 2:
        return data[:at]
    if kind == 3:
        return data + pick.randbytes(pick.randrange(1, 20))
    end = min(len(data), at + pick.randrange(1, 12))
    if kind == 4:
        return data[:at] + data[end:]
    return data[:end] + data[at:end] + data[end:]


# --- MAVLink frames -------------------------------------------------------------------------------------------------


def sealed(inner: bytes, payload: bytes, crc_extra: bytes) -> bytes:
    """A MAVLink frame with another payload, its length and checksum right."""
    body = inner[:1] + bytes((len(payload),)) + inner[2:_PAYLOAD_AT] + payload
    return body + struct.pack("<H", mcrf4xx(body[1:] + crc_extra))


def message_changed(inner: bytes, pick: Random) -> bytes:
    """One MAVLink frame, its checksum right: a field or two changed, or its payload of another length."""
    msgid = int.from_bytes(inner[7:10], "little")
    payload = inner[_PAYLOAD_AT : _PAYLOAD_AT + inner[1]]
    layout = _LAYOUTS.get(msgid, _NO_LAYOUT)
    if msgid == wire.ROUTING.msgid and len(payload) > 4 and pick.random() < 0.9:
        return _control_changed(payload, pick)
    if not layout.fields or pick.random() < 0.03:
        return sealed(inner, scrambled(payload, pick)[:255], layout.crc_extra)
    payload = payload.ljust(layout.size, b"\0")  # MAVLink leaves zeros at the end away
    for _ in range(1 if pick.random() < 0.7 else pick.randint(2, 4)):
        payload = with_another_number(payload, pick.choice(layout.fields), pick)
    return sealed(inner, payload, layout.crc_extra)


def _control_changed(payload: bytes, pick: Random) -> bytes:
    kind, body = payload[1], payload[4:-1]
    if pick.random() < 0.15:
        kind = pick.randrange(256) if pick.random() < 0.3 else control.type_of(pick.choice([*control.Family]), kind & 3)
    return control.encode(kind, integers_changed(body, pick), node=1)


def integers_changed(body: bytes, pick: Random) -> bytes:
    """A body of packed integers, a few of them others; now and then scrambled."""
    if not body or pick.random() < 0.3:
        return scrambled(body, pick)
    codes = [code for code in ("B", "H", "I", "f") if _BYTES_OF[code] <= len(body)]
    for _ in range(1 if pick.random() < 0.6 else pick.randint(2, 4)):
        code = pick.choice(codes)
        body = with_another_number(body, Field(code, pick.randint(0, len(body) - _BYTES_OF[code])), pick)
    return body


def frame_changed(frame: bytes, others: Sequence[bytes], pick: Random) -> bytes:
    """A radio frame changed in one way; `others` are frames whose messages may get into it."""
    dice = pick.random()
    if dice < 0.06 or not frame:
        return scrambled(frame, pick)
    try:
        parts = list(wire.frames(frame))
    except MalformedFrameError:
        return scrambled(frame, pick)
    at = pick.randrange(len(parts))
    if dice < 0.7:
        parts[at] = message_changed(parts[at], pick)
    elif dice < 0.76:
        del parts[at]
    elif dice < 0.82:
        parts.insert(at, parts[pick.randrange(len(parts))])
    elif dice < 0.86:
        pick.shuffle(parts)
    elif dice < 0.96:
        parts[at + 1 :] = _messages_of(pick.choice(others))
    else:
        parts += _messages_of(pick.choice(others)) * pick.randint(1, 4)
    return b"".join(parts)


def _messages_of(frame: bytes) -> list[bytes]:
    try:
        return list(wire.frames(frame))[1:]
    except MalformedFrameError:
        return []


# --- puts on the bus ------------------------------------------------------------------------------------------------

_ITEM: Final = struct.Struct("<BI")
_WORDS: Final = (
    b"null", b"true", b"-1", b"1e999", b"NaN", b"9223372036854775808", b"[]", b"{}", b'""', b"0.5", b"\xff", b"\n",
    b"[[", b"99999999999999999999999999", b'"\\ud800"',
)  # fmt: skip


def put_changed(put: bytes, pick: Random) -> bytes:
    """A put on the bus with one of its messages changed, its lengths right most of the time."""
    if pick.random() < 0.1 or len(put) < _ITEM.size:
        return scrambled(put, pick)
    code, length = _ITEM.unpack_from(put)
    body, rest = put[_ITEM.size : _ITEM.size + length], put[_ITEM.size + length :]
    if pick.random() < 0.03:
        code = pick.randrange(24)
    body = text_changed(body, pick) if body[:1] in (b"[", b"{") or b'"' in body[:60] else numbers_changed(body, pick)
    return _ITEM.pack(code, len(body)) + body + rest


def numbers_changed(body: bytes, pick: Random) -> bytes:
    """A body of packed numbers of any kind, one of them another; now and then scrambled."""
    codes = [code for code in ("B", "H", "I", "q", "f", "d") if _BYTES_OF[code] <= len(body)]
    if not codes or pick.random() < 0.3:
        return scrambled(body, pick)
    code = pick.choice(codes)
    return with_another_number(body, Field(code, pick.randint(0, len(body) - _BYTES_OF[code])), pick)


_TOKEN: Final = re.compile(rb'"[^"]*"|-?[0-9][0-9.e+-]*|true|false|null|[\[\]{},:]')


def text_changed(text: bytes, pick: Random) -> bytes:
    """JSON with one value another, or one token gone or doubled."""
    if pick.random() < 0.15:
        return scrambled(text, pick)
    start = pick.randrange(max(1, len(text)))
    token = _TOKEN.search(text, start) or _TOKEN.search(text)
    if token is None:
        return scrambled(text, pick)
    a, b = token.span()
    dice = pick.random()
    new = pick.choice(_WORDS) if dice < 0.7 else b"" if dice < 0.8 else text[a:b] * 2
    return text[:a] + new + text[b:]

"""The byte format of the messages on the bus, which no other file knows.

One put on the bus carries a batch of messages. Each is one byte for its kind, a 32-bit length and its body, all little
endian. Any bytes decode either to messages or to MalformedFrameError, and to no other exception; a message that its
bytes cannot hold is a LocalProtocolError.
"""

import hashlib
import math
import struct
from array import array
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple, get_type_hints

from fanet_mw import trace
from fanet_mw.bus import messages as m
from fanet_mw.bus import radio_control as air
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.orders import Order
from fanet_mw.units import Enu, NodeId

MAX_HEARD: Final = 10_000
"""The greatest number of phones in a scan, people in an image, or voices: the most survivors of a scenario."""
MAX_ECHOES: Final = 4_096
"""The greatest number of returns in a radar scan."""


class Codec(NamedTuple):
    """How one kind of message is written."""

    kind: type[Any]
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], m.Message]
    structs: tuple[struct.Struct, ...] = ()
    """That of its head, and that of each row for kinds with rows."""


# --- kinds whose fields, in order, are those of a struct ---------------------------------------------------------


def _flat(values: Iterable[Any]) -> Iterator[Any]:
    for value in values:
        if isinstance(value, Enu):
            yield from value
        else:
            yield math.nan if value is None else value


def _field(hint: Any, values: Iterator[Any]) -> Any:  # noqa: ANN401  (of the type that it hints at)
    if hint is Enu:
        return Enu(next(values), next(values), next(values))
    value = next(values)
    if hint == float | None:
        return None if math.isnan(value) else value
    return hint(value)


def _plain(kind: type[Any], layout: str, check: Callable[[Any], None] = lambda _: None) -> Codec:
    """Vectors are taken apart, None is NaN, and a label, which comes first, stands behind the struct as text."""
    head = struct.Struct(layout)
    labels = int("label" in kind.__annotations__)
    hints = list(get_type_hints(kind).values())[labels:]

    def encode(message: Any) -> bytes:  # noqa: ANN401  (of this kind)
        return head.pack(*_flat(message[labels:])) + "".join(message[:labels]).encode()

    def decode(body: bytes) -> Any:  # noqa: ANN401
        values = iter(head.unpack_from(body) if labels else head.unpack(body))
        label = [body[head.size :].decode()] if labels else []
        message = kind(*label, *(_field(hint, values) for hint in hints))
        check(message)
        return message

    return Codec(kind, encode, decode, (head,))


def _finite(values: Iterable[Any]) -> None:
    """Raise ValueError for values that no sensor gives and nobody can fly to: infinite ones and NaN."""
    for value in values:
        if isinstance(value, tuple):
            _finite(value)
        elif value is not None and not math.isfinite(value):
            raise ValueError("not finite")


def _check_flight(message: m.FlightState) -> None:
    _finite(message)
    if message.unix_ns < 0:
        raise ValueError("time")


def _check_clock(message: m.ClockEpoch) -> None:
    if not 0 < message.time_scale <= 100:
        raise ValueError("time_scale")


def _check_pace(message: m.ClockRequest) -> None:
    if not m.PACE_BOUNDS[0] <= message.time_scale <= m.PACE_BOUNDS[1]:  # also true for NaN
        raise ValueError("pace")


# --- kinds of an instant and rows --------------------------------------------------------------------------------

_ROWS: Final = struct.Struct("<qH")


def _rows(
    kind: type[Any],
    make: Callable[[Iterable[Any]], Any],
    layout: str,
    *,
    most: int = MAX_HEARD,
) -> Codec:
    row = struct.Struct(layout)

    def encode(message: Any) -> bytes:  # noqa: ANN401  (of this kind)
        t_ns, rows = message
        return _ROWS.pack(t_ns, len(rows)) + b"".join(row.pack(*item) for item in rows)

    def decode(body: bytes) -> Any:  # noqa: ANN401
        t_ns, count = _ROWS.unpack_from(body)
        if len(body) != _ROWS.size + count * row.size or count > most:
            raise ValueError("length")
        rows = tuple(map(make, row.iter_unpack(body[_ROWS.size :])))
        _finite(rows)
        return kind(t_ns, rows)

    return Codec(kind, encode, decode, (_ROWS, row))


# --- all others: one encoder and one decoder beside each other; those of the radio are called most ---------------

_TX = struct.Struct("<IqHBq")
_RX = struct.Struct("<Hqf")
_STATUS = struct.Struct("<IBqB")
_POSES = struct.Struct("<qI")
_OBSTRUCTIONS = struct.Struct("<qHI")
_INSTANT = struct.Struct("<q")
_IMAGE = struct.Struct("<qHH")
_PARTITION = struct.Struct("<4dqH")
_LINKS = struct.Struct("<qqI")


def _encode_tx(request: m.TxRequest) -> bytes:
    seq, start_ns, frame, dst, wants_status, until_ns = request
    return _TX.pack(seq & 0xFFFF_FFFF, start_ns, dst, wants_status, until_ns) + frame


def _decode_tx(body: bytes) -> m.TxRequest:
    seq, start_ns, dst, wants_status, until_ns = _TX.unpack_from(body)
    return m.TxRequest(seq, start_ns, body[_TX.size :], NodeId(dst), bool(wants_status), until_ns)


def _encode_rx(reception: m.Reception) -> bytes:
    frame, src, end_ns, rssi_dbm = reception
    return _RX.pack(src, end_ns, rssi_dbm) + frame


def _decode_rx(body: bytes) -> m.Reception:
    src, end_ns, rssi_dbm = _RX.unpack_from(body)
    if not math.isfinite(rssi_dbm):
        raise ValueError("not finite")
    return m.Reception(body[_RX.size :], NodeId(src), end_ns, rssi_dbm)


def _encode_status(status: m.TxStatus) -> bytes:
    seq, outcome, end_ns, attempts = status
    return _STATUS.pack(seq & 0xFFFF_FFFF, outcome, end_ns, attempts)


def _decode_status(body: bytes) -> m.TxStatus:
    seq, outcome, end_ns, attempts = _STATUS.unpack(body)
    return m.TxStatus(seq, m.TxOutcome(outcome), end_ns, attempts)


def _arrays(body: bytes, at: int, *counts: tuple[str, int]) -> list[Any]:
    """Arrays of these types and lengths, which are all that is left of a body; raises ValueError."""
    found = []
    for code, count in counts:
        values: array[Any] = array(code)
        end = at + count * values.itemsize
        if end > len(body):
            raise ValueError("length")
        values.frombytes(body[at:end])
        found.append(values)
        at = end
    if at != len(body):
        raise ValueError("length")
    return found


def _encode_poses(poses: m.Poses) -> bytes:
    return _POSES.pack(poses.t_ns, len(poses.ids)) + poses.ids.tobytes() + poses.states.tobytes()


def _decode_poses(body: bytes) -> m.Poses:
    t_ns, count = _POSES.unpack_from(body)
    return m.Poses(t_ns, *_arrays(body, _POSES.size, ("H", count), ("d", 6 * count)))


def _encode_obstructions(found: m.Obstructions) -> bytes:
    head = _OBSTRUCTIONS.pack(found.t_ns, len(found.ground_m), len(found.pairs))
    return head + found.ground_m.tobytes() + found.pairs.tobytes() + found.losses_ddb.tobytes()


def _decode_obstructions(body: bytes) -> m.Obstructions:
    t_ns, grounds, count = _OBSTRUCTIONS.unpack_from(body)
    if count % 2:
        raise ValueError("length")
    losses = 0 if len(body) == _OBSTRUCTIONS.size + 4 * grounds + 2 * count else count // 2
    ground, pairs, found = _arrays(body, _OBSTRUCTIONS.size, ("f", grounds), ("H", count), ("H", losses))
    return m.Obstructions(t_ns, pairs, found, ground)


def _encode_links(stats: LinkStats) -> bytes:
    head = _LINKS.pack(stats.t_ns, stats.span_ns, len(stats.rssi_sums_mdbm))
    return head + stats.ends.tobytes() + stats.counts.tobytes() + stats.rssi_sums_mdbm.tobytes()


def _decode_links(body: bytes) -> LinkStats:
    t_ns, span_ns, links = _LINKS.unpack_from(body)
    return LinkStats(t_ns, span_ns, *_arrays(body, _LINKS.size, ("H", 2 * links), ("I", COUNTS * links), ("q", links)))


def _encode_partition(fault: air.Partition) -> bytes:
    head = _PARTITION.pack(*fault.line_m, fault.for_ns, len(fault.group))
    return head + array("H", fault.group).tobytes() + fault.label.encode()


def _decode_partition(body: bytes) -> air.Partition:
    east, north, other_east, other_north, for_ns, count = _PARTITION.unpack_from(body)
    end = _PARTITION.size + 2 * count
    (group,) = _arrays(body[:end], _PARTITION.size, ("H", count))
    return air.Partition(body[end:].decode(), tuple(group), (east, north, other_east, other_north), for_ns)


def _encode_image(image: m.CameraImage) -> bytes:
    return _IMAGE.pack(image.t_ns, image.width, image.height) + image.rgb


def _decode_image(body: bytes) -> m.CameraImage:
    t_ns, width, height = _IMAGE.unpack_from(body)
    rgb = body[_IMAGE.size :]
    if len(rgb) != 3 * width * height:
        raise ValueError("length")
    return m.CameraImage(t_ns, width, height, rgb)


def _encode_trace(batch: m.TraceBatch) -> bytes:
    return "\n".join(trace.line(record) for record in batch.records).encode()


def _decode_trace(body: bytes) -> m.TraceBatch:
    return m.TraceBatch(tuple(trace.parse(text) for text in body.decode().splitlines()))


def _encode_report(report: m.Report) -> bytes:
    return _INSTANT.pack(report.t_ns) + f"{report.name}\n{report.json}".encode()


def _decode_report(body: bytes) -> m.Report:
    name, _, text = body[_INSTANT.size :].decode().partition("\n")
    return m.Report(name, _INSTANT.unpack_from(body)[0], text)


def _decode_tap(body: bytes) -> m.MavlinkTap:
    return m.MavlinkTap(_INSTANT.unpack_from(body)[0], body[_INSTANT.size :])


_CODECS: Final = {
    1: Codec(m.TxRequest, _encode_tx, _decode_tx, (_TX,)),
    2: Codec(m.Reception, _encode_rx, _decode_rx, (_RX,)),
    3: Codec(m.TxStatus, _encode_status, _decode_status, (_STATUS,)),
    4: Codec(m.Poses, _encode_poses, _decode_poses, (_POSES,)),
    5: _plain(m.Setpoint, "<q4dB3d", _finite),
    6: _plain(m.Gps, "<q6d", _finite),
    7: _rows(m.WifiScan, tuple, "<If"),
    8: Codec(m.MavlinkTap, lambda tap: _INSTANT.pack(tap.t_ns) + tap.data, _decode_tap, (_INSTANT,)),
    9: Codec(m.TraceBatch, _encode_trace, _decode_trace),
    10: _plain(m.ClockEpoch, "<qdBqQIq", _check_clock),
    11: Codec(m.Report, _encode_report, _decode_report, (_INSTANT,)),
    12: _plain(air.Degrade, "<HHBddq"),
    13: _plain(air.Jam, "<5dq"),
    14: _plain(air.Cut, "<Hq2B"),
    15: Codec(air.Restore, lambda restore: restore.label.encode(), lambda body: air.Restore(body.decode())),
    16: Codec(LinkStats, _encode_links, _decode_links, (_LINKS,)),
    17: Codec(m.Obstructions, _encode_obstructions, _decode_obstructions, (_OBSTRUCTIONS,)),
    18: _rows(m.Camera, m.Person._make, "<3d"),
    19: _rows(m.Voice, m.Call._make, "<4d"),
    20: _rows(m.Radar, m.Echo._make, "<5d", most=MAX_ECHOES),
    21: _plain(m.Altimeter, "<q2d", _finite),
    22: _plain(m.Inertial, "<q3d", _finite),
    23: _plain(m.Battery, "<q3d", _finite),
    24: Codec(m.CameraImage, _encode_image, _decode_image, (_IMAGE,)),
    25: Codec(air.Partition, _encode_partition, _decode_partition, (_PARTITION,)),
    26: _plain(air.Mishap, "<HB3dq"),
    27: _plain(Order, "<BH3d"),
    28: _plain(m.ClockRequest, "<d", _check_pace),
    29: _plain(m.FlightState, "<q3dBdq", _check_flight),
    30: _plain(m.WindEstimate, "<q3d", _finite),
    31: _plain(m.LandingTarget, "<q3d", _finite),
}  # fmt: skip
CODES: Final = {codec.kind: code for code, codec in _CODECS.items()}
HEADS: Final = {codec.kind: codec.structs for codec in _CODECS.values()}
"""The structs of each kind: that of its head, and that of each row for kinds with rows."""


def layout_of(kinds: Iterable[type[Any]]) -> str:
    """A digest of the codes, names, fields and structs of these kinds of messages."""
    said = [(CODES[k], k.__name__, list(k.__annotations__), [s.format for s in HEADS[k]]) for k in kinds]
    return hashlib.sha256(repr(said).encode()).hexdigest()[:8]


LAYOUT: Final = layout_of(CODES)
"""Stands for the layout of all messages: processes with another one read nonsense in what these put."""
_ITEM: Final = struct.Struct("<BI")
_new: Final = tuple.__new__  # for what is made once per message
MAX_ITEMS: Final = 16_384
"""The greatest number of messages in one put: several times what the busiest medium sends at once."""


def encode(messages: Iterable[m.Message]) -> bytes:
    """The bytes of one put that carries these messages, in order; raises LocalProtocolError for a message with a value
    for which its bytes have no room.
    """
    parts = []
    for message in messages:
        code = CODES[type(message)]
        try:
            body = _CODECS[code].encode(message)
        except (struct.error, OverflowError) as error:
            raise LocalProtocolError(f"{message!r:.200} cannot be put on the bus: {error}") from error
        parts.append(_ITEM.pack(code, len(body)))
        parts.append(body)
    return b"".join(parts)


class Item(NamedTuple):
    """The position of one message in a put, not yet decoded."""

    code: int
    start: int
    end: int


def codes_of(*kinds: type[Any]) -> frozenset[int]:
    """The codes of these kinds of messages."""
    return frozenset(CODES[kind] for kind in kinds)


def items(data: bytes) -> list[Item]:
    """The messages of one put, not decoded; raises MalformedFrameError if they are cut off, or more than MAX_ITEMS."""
    found: list[Item] = []
    at, size = 0, len(data)
    while at < size:
        start = at + _ITEM.size
        if start > size or len(found) == MAX_ITEMS:
            raise MalformedFrameError(f"bus message malformed at byte {at}: cut off, or the {MAX_ITEMS + 1}th of a put")
        code, length = _ITEM.unpack_from(data, at)
        at = start + length
        if at > size:
            raise MalformedFrameError(f"bus message malformed at byte {start}: length beyond the end")
        found.append(_new(Item, (code, start, at)))
    return found


def decode_item(data: bytes, item: Item) -> m.Message:
    """One message of a put; raises MalformedFrameError for bytes that `encode` could not have made."""
    code, start, end = item
    try:
        return _CODECS[code].decode(data[start:end])
    except (struct.error, ValueError, KeyError, OverflowError, RecursionError) as error:
        raise MalformedFrameError(f"bus message malformed at byte {start}: {error}") from error


def decode(data: bytes) -> list[m.Message]:
    """The messages of one put; raises MalformedFrameError for bytes that `encode` could not have made."""
    return [decode_item(data, item) for item in items(data)]

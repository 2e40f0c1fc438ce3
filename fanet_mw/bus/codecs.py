"""The byte format of the messages on the bus; `sensor_codecs.py` has that of sensor readings, and no other file knows
it.

One put on the bus carries a batch of messages. Each is one byte for its kind, a 32-bit length and its body, all little
endian. Any bytes decode either to messages or to MalformedFrameError, and to no other exception.
"""

import hashlib
import struct
from array import array
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

from fanet_mw import trace
from fanet_mw.bus import sensor_codecs
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import (
    PACE_BOUNDS,
    Altimeter,
    Battery,
    Camera,
    CameraImage,
    ClockEpoch,
    ClockRequest,
    ClockState,
    FlightState,
    Gps,
    Inertial,
    MavlinkTap,
    Message,
    Obstructions,
    Poses,
    Radar,
    Reception,
    Report,
    Setpoint,
    SetpointKind,
    TraceBatch,
    TxOutcome,
    TxRequest,
    TxStatus,
    Voice,
    WifiScan,
    WindEstimate,
)
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, MishapKind, Partition, Restore
from fanet_mw.errors import MalformedFrameError
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import Enu, NodeId

# --- bodies: one encoder and one decoder per message type, beside each other -------------------------------------

_TX = struct.Struct("<IqHBq")
_RX = struct.Struct("<Hqf")
_STATUS = struct.Struct("<IBqB")
_SETPOINT = struct.Struct("<q4dB3d")
_POSES = struct.Struct("<qI")
_OBSTRUCTIONS = struct.Struct("<qHI")
_CLOCK = struct.Struct("<qdBqQIq")
_PACE = struct.Struct("<d")
_INSTANT = struct.Struct("<q")
_DEGRADE = struct.Struct("<HHBddq")
_JAM = struct.Struct("<5dq")
_CUT = struct.Struct("<Hq2B")
_PARTITION = struct.Struct("<4dqH")
_MISHAP = struct.Struct("<HB3dq")
_ORDER = struct.Struct("<BH3d")
_LINKS = struct.Struct("<qqI")


def _encode_tx(m: TxRequest) -> bytes:
    return _TX.pack(m.seq & 0xFFFF_FFFF, m.start_ns, m.dst, m.wants_status, m.until_ns) + m.frame


def _decode_tx(body: bytes) -> TxRequest:
    seq, start_ns, dst, wants_status, until_ns = _TX.unpack_from(body)
    return TxRequest(seq, start_ns, body[_TX.size :], NodeId(dst), bool(wants_status), until_ns)


def _encode_rx(m: Reception) -> bytes:
    return _RX.pack(m.src, m.end_ns, m.rssi_dbm) + m.frame


def _decode_rx(body: bytes) -> Reception:
    src, end_ns, rssi_dbm = _RX.unpack_from(body)
    return Reception(body[_RX.size :], NodeId(src), end_ns, rssi_dbm)


def _encode_status(m: TxStatus) -> bytes:
    return _STATUS.pack(m.seq & 0xFFFF_FFFF, m.outcome, m.end_ns, m.attempts)


def _decode_status(body: bytes) -> TxStatus:
    seq, outcome, end_ns, attempts = _STATUS.unpack(body)
    return TxStatus(seq, TxOutcome(outcome), end_ns, attempts)


def _encode_poses(m: Poses) -> bytes:
    return _POSES.pack(m.t_ns, len(m.ids)) + m.ids.tobytes() + m.states.tobytes()


def _decode_poses(body: bytes) -> Poses:
    t_ns, count = _POSES.unpack_from(body)
    ids, states = array("H"), array("d")
    split = _POSES.size + 2 * count
    if len(body) != split + 48 * count:
        raise ValueError("length")
    ids.frombytes(body[_POSES.size : split])
    states.frombytes(body[split:])
    return Poses(t_ns, ids, states)


def _encode_obstructions(m: Obstructions) -> bytes:
    head = _OBSTRUCTIONS.pack(m.t_ns, len(m.ground_m), len(m.pairs))
    return head + m.ground_m.tobytes() + m.pairs.tobytes() + m.losses_ddb.tobytes()


def _decode_obstructions(body: bytes) -> Obstructions:
    t_ns, grounds, count = _OBSTRUCTIONS.unpack_from(body)
    ground, pairs, losses = array("f"), array("H"), array("H")
    start = _OBSTRUCTIONS.size + 4 * grounds
    split = start + 2 * count
    if len(body) not in (split, split + count) or count % 2:
        raise ValueError("length")
    ground.frombytes(body[_OBSTRUCTIONS.size : start])
    pairs.frombytes(body[start:split])
    losses.frombytes(body[split:])
    return Obstructions(t_ns, pairs, losses, ground)


def _encode_setpoint(m: Setpoint) -> bytes:
    return _SETPOINT.pack(m.t_ns, *m.position, m.speed_m_s, m.kind, *m.velocity)


def _decode_setpoint(body: bytes) -> Setpoint:
    t_ns, east, north, up, speed_m_s, kind, *velocity = _SETPOINT.unpack(body)
    return Setpoint(t_ns, Enu(east, north, up), speed_m_s, SetpointKind(kind), Enu(*velocity))


def _encode_tap(m: MavlinkTap) -> bytes:
    return _INSTANT.pack(m.t_ns) + m.data


def _decode_tap(body: bytes) -> MavlinkTap:
    return MavlinkTap(_INSTANT.unpack_from(body)[0], body[_INSTANT.size :])


def _encode_trace(m: TraceBatch) -> bytes:
    return "\n".join(trace.line(record) for record in m.records).encode()


def _decode_trace(body: bytes) -> TraceBatch:
    return TraceBatch(tuple(trace.parse(text) for text in body.decode().splitlines()))


def _encode_clock(m: ClockEpoch) -> bytes:
    return _CLOCK.pack(m.epoch_unix_ns, m.time_scale, m.state, m.epoch_mono_ns, m.machine, m.number, m.ends_ns)


def _decode_clock(body: bytes) -> ClockEpoch:
    epoch_unix_ns, time_scale, state, epoch_mono_ns, machine, number, ends_ns = _CLOCK.unpack(body)
    if not 0 < time_scale <= 100:
        raise ValueError("time_scale")
    return ClockEpoch(epoch_unix_ns, time_scale, ClockState(state), epoch_mono_ns, machine, number, ends_ns)


def _encode_request(m: ClockRequest) -> bytes:
    return _PACE.pack(m.time_scale)


def _decode_request(body: bytes) -> ClockRequest:
    (time_scale,) = _PACE.unpack(body)
    if not PACE_BOUNDS[0] <= time_scale <= PACE_BOUNDS[1]:  # also true for NaN
        raise ValueError("pace")
    return ClockRequest(time_scale)


def _encode_report(m: Report) -> bytes:
    return _INSTANT.pack(m.t_ns) + f"{m.name}\n{m.json}".encode()


def _decode_report(body: bytes) -> Report:
    name, _, text = body[_INSTANT.size :].decode().partition("\n")
    return Report(name, _INSTANT.unpack_from(body)[0], text)


def _encode_degrade(m: Degrade) -> bytes:
    return _DEGRADE.pack(m.src, m.dst, m.both, m.loss_db, m.loss_share, m.for_ns) + m.label.encode()


def _decode_degrade(body: bytes) -> Degrade:
    src, dst, both, loss_db, loss_share, for_ns = _DEGRADE.unpack_from(body)
    label = body[_DEGRADE.size :].decode()
    return Degrade(label, NodeId(src), NodeId(dst), bool(both), loss_db, loss_share, for_ns)


def _encode_jam(m: Jam) -> bytes:
    return _JAM.pack(*m.center, m.radius_m, m.noise_dbm, m.for_ns) + m.label.encode()


def _decode_jam(body: bytes) -> Jam:
    east, north, up, radius_m, noise_dbm, for_ns = _JAM.unpack_from(body)
    return Jam(body[_JAM.size :].decode(), Enu(east, north, up), radius_m, noise_dbm, for_ns)


def _encode_cut(m: Cut) -> bytes:
    return _CUT.pack(m.node, m.for_ns, m.sends, m.hears) + m.label.encode()


def _decode_cut(body: bytes) -> Cut:
    node, for_ns, sends, hears = _CUT.unpack_from(body)
    return Cut(body[_CUT.size :].decode(), NodeId(node), for_ns, bool(sends), bool(hears))


def _encode_partition(m: Partition) -> bytes:
    return _PARTITION.pack(*m.line_m, m.for_ns, len(m.group)) + array("H", m.group).tobytes() + m.label.encode()


def _decode_partition(body: bytes) -> Partition:
    *line_m, for_ns, count = _PARTITION.unpack_from(body)
    group, end = array("H"), _PARTITION.size + 2 * count
    if len(body) < end:
        raise ValueError("length")
    group.frombytes(body[_PARTITION.size : end])
    east, north, other_east, other_north = line_m
    return Partition(body[end:].decode(), tuple(map(NodeId, group)), (east, north, other_east, other_north), for_ns)


def _encode_mishap(m: Mishap) -> bytes:
    return _MISHAP.pack(m.node, m.what, *m.value, m.for_ns) + m.label.encode()


def _decode_mishap(body: bytes) -> Mishap:
    node, what, east, north, up, for_ns = _MISHAP.unpack_from(body)
    return Mishap(body[_MISHAP.size :].decode(), NodeId(node), MishapKind(what), Enu(east, north, up), for_ns)


def _encode_restore(m: Restore) -> bytes:
    return m.label.encode()


def _decode_restore(body: bytes) -> Restore:
    return Restore(body.decode())


def _encode_order(m: Order) -> bytes:
    return _ORDER.pack(*m)


def _decode_order(body: bytes) -> Order:
    kind, *rest = _ORDER.unpack(body)
    return Order(OrderKind(kind), *rest)


def _encode_links(m: LinkStats) -> bytes:
    head = _LINKS.pack(m.t_ns, m.span_ns, len(m.rssi_sums_mdbm))
    return head + m.ends.tobytes() + m.counts.tobytes() + m.rssi_sums_mdbm.tobytes()


def _decode_links(body: bytes) -> LinkStats:
    t_ns, span_ns, links = _LINKS.unpack_from(body)
    ends, counts, sums = array("H"), array("I"), array("q")
    a = _LINKS.size
    b = a + 4 * links
    c = b + 4 * COUNTS * links
    if len(body) != c + 8 * links:
        raise ValueError("length")
    ends.frombytes(body[a:b])
    counts.frombytes(body[b:c])
    sums.frombytes(body[c:])
    return LinkStats(t_ns, span_ns, ends, counts, sums)


_CODECS: Final[dict[int, tuple[type[Any], Callable[[Any], bytes], Callable[[bytes], Message]]]] = {
    1: (TxRequest, _encode_tx, _decode_tx),
    2: (Reception, _encode_rx, _decode_rx),
    3: (TxStatus, _encode_status, _decode_status),
    4: (Poses, _encode_poses, _decode_poses),
    5: (Setpoint, _encode_setpoint, _decode_setpoint),
    6: (Gps, sensor_codecs.encode_gps, sensor_codecs.decode_gps),
    7: (WifiScan, sensor_codecs.encode_scan, sensor_codecs.decode_scan),
    8: (MavlinkTap, _encode_tap, _decode_tap),
    9: (TraceBatch, _encode_trace, _decode_trace),
    10: (ClockEpoch, _encode_clock, _decode_clock),
    11: (Report, _encode_report, _decode_report),
    12: (Degrade, _encode_degrade, _decode_degrade),
    13: (Jam, _encode_jam, _decode_jam),
    14: (Cut, _encode_cut, _decode_cut),
    15: (Restore, _encode_restore, _decode_restore),
    16: (LinkStats, _encode_links, _decode_links),
    17: (Obstructions, _encode_obstructions, _decode_obstructions),
    18: (Camera, sensor_codecs.encode_camera, sensor_codecs.decode_camera),
    19: (Voice, sensor_codecs.encode_voice, sensor_codecs.decode_voice),
    20: (Radar, sensor_codecs.encode_radar, sensor_codecs.decode_radar),
    21: (Altimeter, sensor_codecs.encode_altimeter, sensor_codecs.decode_altimeter),
    22: (Inertial, sensor_codecs.encode_inertial, sensor_codecs.decode_inertial),
    23: (Battery, sensor_codecs.encode_battery, sensor_codecs.decode_battery),
    24: (CameraImage, sensor_codecs.encode_image, sensor_codecs.decode_image),
    25: (Partition, _encode_partition, _decode_partition),
    26: (Mishap, _encode_mishap, _decode_mishap),
    27: (Order, _encode_order, _decode_order),
    28: (ClockRequest, _encode_request, _decode_request),
    29: (FlightState, sensor_codecs.encode_flight, sensor_codecs.decode_flight),
    30: (WindEstimate, sensor_codecs.encode_wind, sensor_codecs.decode_wind),
}
HEADS: Final[dict[type[Any], tuple[struct.Struct, ...]]] = {
    TxRequest: (_TX,), Reception: (_RX,), TxStatus: (_STATUS,), Poses: (_POSES,), Setpoint: (_SETPOINT,),
    MavlinkTap: (_INSTANT,), TraceBatch: (), ClockEpoch: (_CLOCK,), ClockRequest: (_PACE,),
    Report: (_INSTANT,), Degrade: (_DEGRADE,),
    Jam: (_JAM,), Cut: (_CUT,), Partition: (_PARTITION,),
    Mishap: (_MISHAP,), Order: (_ORDER,), Restore: (), LinkStats: (_LINKS,), Obstructions: (_OBSTRUCTIONS,),
    **sensor_codecs.HEADS,
}  # fmt: skip
"""The structs of each kind: that of its head, and that of each row for kinds with rows."""
CODES: Final = {kind: code for code, (kind, _, _) in _CODECS.items()}


def layout_of(kinds: Iterable[type[Any]]) -> str:
    """A digest of the codes, names, fields and structs of these kinds of messages."""
    said = [(CODES[k], k.__name__, list(k.__annotations__), [s.format for s in HEADS[k]]) for k in kinds]
    return hashlib.sha256(repr(said).encode()).hexdigest()[:8]


LAYOUT: Final = layout_of(CODES)
"""Stands for the layout of all messages: processes with another one read nonsense in what these put."""
_CODE_OF: Final = {kind: (code, encode) for code, (kind, encode, _) in _CODECS.items()}
_ITEM: Final = struct.Struct("<BI")
_new: Final = tuple.__new__  # for what is made once per message
MAX_ITEMS: Final = 16_384
"""The greatest number of messages in one put: several times what the busiest medium sends at once."""


def encode(messages: Iterable[Message]) -> bytes:
    """The bytes of one put that carries these messages, in order."""
    parts = []
    for message in messages:
        code, encoder = _CODE_OF[type(message)]
        body = encoder(message)
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
    return frozenset(_CODE_OF[kind][0] for kind in kinds)


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


def decode_item(data: bytes, item: Item) -> Message:
    """One message of a put; raises MalformedFrameError for bytes that `encode` could not have made."""
    code, start, end = item
    try:
        return _CODECS[code][2](data[start:end])
    except (struct.error, ValueError, KeyError, OverflowError, RecursionError) as error:
        raise MalformedFrameError(f"bus message malformed at byte {start}: {error}") from error


def decode(data: bytes) -> list[Message]:
    """The messages of one put; raises MalformedFrameError for bytes that `encode` could not have made."""
    return [decode_item(data, item) for item in items(data)]

"""The byte layout of every message on the bus, for the reference page: the fields of the codecs' structs with their
names.

The structs are those that encode and decode (`codecs.HEADS`). A struct whose number of fields differs from that of the
names is an error.
"""

import re
import struct
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from fanet_mw.bus import messages as m
from fanet_mw.bus.codecs import CODES, HEADS
from fanet_mw.bus.link_stats import COUNTS, LOSSES, LinkStats
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, Partition, Restore
from fanet_mw.orders import Order

TYPES: Final = {
    "B": "uint8", "H": "uint16", "I": "uint32", "Q": "uint64", "q": "int64", "f": "float32", "d": "float64",
}  # fmt: skip
"""A readable name for each format character of `struct`."""


class Names(NamedTuple):
    """The names of the fields of a kind of message, which its codec does not know."""

    topic: str
    fields: str
    """The names of the fields of the head, in order; what follows the head is named, too."""
    rest: str = ""
    row: str = ""
    """The names of the fields of each row, for kinds with rows."""


class Field(NamedTuple):
    """One field of a struct."""

    offset: int
    kind: str
    name: str


_VECTOR: Final = "east_m north_m up_m"
_MOVES: Final = "east_m_s north_m_s up_m_s"
NAMED: Final[dict[type[Any], Names]] = {
    m.TxRequest: Names("radio/<id>/tx", "seq start_ns dst wants_status", "the frame, MAVLink, to the end"),
    m.Reception: Names("radio/<id>/rx", "src end_ns rssi_dbm", "the frame, MAVLink, to the end"),
    m.TxStatus: Names("radio/<id>/rx", "seq outcome end_ns attempts"),
    m.Poses: Names(
        "world/pose", "t_ns count", f"`count` x uint16: ids, ascending; `count` x 6 float64: {_VECTOR} {_MOVES}",
    ),
    m.Obstructions: Names(
        "world/obstruction", "t_ns count",
        "`count` x uint16: pairs of node ids, smaller first; then nothing, or `count` / 2 x uint16: losses [1/10 dB]",
    ),
    m.Setpoint: Names("world/<id>/setpoint", f"t_ns {_VECTOR} speed_m_s kind {_MOVES}"),
    m.Gps: Names("world/<id>/sensor/gps", f"t_ns {_VECTOR} {_MOVES}"),
    m.WifiScan: Names("world/<id>/sensor/wifi", "t_ns count", row="survivor rssi_dbm"),
    m.MavlinkTap: Names("mavlink/<id>", "t_ns", "MAVLink frames to the end"),
    m.TraceBatch: Names("trace/<name>", "", "records, UTF-8: one JSON array per line"),
    m.ClockEpoch: Names("clock", "epoch_unix_ns time_scale state epoch_mono_ns machine number ends_ns"),
    m.ClockRequest: Names("clock/control", "time_scale"),
    m.Report: Names("report/<name>", "t_ns", "UTF-8: the name, a line feed, a JSON object"),
    Degrade: Names("radio/control", "src dst both loss_db loss_share for_ns", "the label, UTF-8"),
    Jam: Names("radio/control", f"{_VECTOR} radius_m noise_dbm for_ns", "the label, UTF-8"),
    Cut: Names("radio/control", "node for_ns sends hears", "the label, UTF-8"),
    Partition: Names(
        "radio/control", "east_m north_m other_east_m other_north_m for_ns count",
        "`count` x uint16: the nodes on one side; the label, UTF-8",
    ),
    Mishap: Names("radio/control", f"node what {_VECTOR} for_ns", "the label, UTF-8"),
    Order: Names("ground/order", "kind node east_m north_m radius_m"),
    Restore: Names("radio/control", "", "the label, UTF-8; empty: all faults"),
    LinkStats: Names(
        "radio/links", "t_ns span_ns count",
        f"`count` x 2 uint16: source, destination; `count` x {COUNTS} uint32: received, then lost by "
        f"{', '.join(LOSSES)}; `count` x int64: sum of RSSI [1/1000 dBm], 0 where the channel knows no powers",
    ),
    m.Camera: Names("world/<id>/sensor/camera", "t_ns count", row="bearing_rad elevation_rad pixels"),
    m.CameraImage: Names(
        "world/<id>/sensor/image", "t_ns width height", "3 bytes for each pixel: red, green, blue; rows from the north",
    ),
    m.Voice: Names("world/<id>/sensor/voice", "t_ns count", row="bearing_rad elevation_rad level_db snr_db"),
    m.Radar: Names("world/<id>/sensor/radar", "t_ns count", row="range_m bearing_rad elevation_rad closing_m_s snr_db"),
    m.Altimeter: Names("world/<id>/sensor/altimeter", "t_ns up_m above_ground_m"),
    m.Inertial: Names("world/<id>/sensor/inertial", f"t_ns {_MOVES}"),
    m.Battery: Names("world/<id>/sensor/battery", "t_ns voltage_v current_a charge"),
}  # fmt: skip


def kinds() -> list[type[Any]]:
    """Every kind of message, by its code."""
    return sorted(CODES, key=lambda kind: CODES[kind])


def head(kind: type[Any]) -> list[Field]:
    """The fields at the beginning of a body; empty when it has none of fixed size."""
    structs = HEADS[kind]
    return list(_fields(structs[0], NAMED[kind].fields)) if structs else []


def row(kind: type[Any]) -> list[Field]:
    """The fields of each row after the head; empty when no rows follow."""
    structs = HEADS[kind]
    return list(_fields(structs[1], NAMED[kind].row)) if len(structs) > 1 else []


def _fields(layout: struct.Struct, names: str) -> Iterator[Field]:
    codes = [code for count, code in re.findall(r"(\d*)([a-zA-Z])", layout.format) for _ in range(int(count or 1))]
    found = names.split()
    if len(found) != len(codes):
        raise ValueError(f"{layout.format!r} has {len(codes)} fields, {len(found)} are named: {names}")
    offset = 0
    for code, name in zip(codes, found, strict=True):
        yield Field(offset, TYPES[code], name)
        offset += struct.calcsize(f"<{code}")

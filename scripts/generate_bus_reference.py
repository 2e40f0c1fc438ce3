"""Generate docs/reference/bus.md, topics and bytes of the bus, from the codecs; `--check` compares."""

import re
import struct
import sys
from collections.abc import Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # this tree, not the package that is installed

from fanet_mw.bus import messages as m  # noqa: E402
from fanet_mw.bus.codecs import CODES, HEADS  # noqa: E402
from fanet_mw.bus.link_stats import COUNTS, LOSSES, LinkStats  # noqa: E402
from fanet_mw.bus.messages import ClockState, SetpointKind, TxOutcome  # noqa: E402
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, Partition, Restore  # noqa: E402
from fanet_mw.orders import Order  # noqa: E402
from scripts.generated import write_or_check  # noqa: E402

DOCUMENT = ROOT / "docs" / "reference" / "bus.md"
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
    m.TxRequest: Names("radio/<id>/tx", "seq start_ns dst wants_status until_ns", "the frame, MAVLink, to the end"),
    m.Reception: Names("radio/<id>/rx", "src end_ns rssi_dbm", "the frame, MAVLink, to the end"),
    m.TxStatus: Names("radio/<id>/rx", "seq outcome end_ns attempts"),
    m.Poses: Names(
        "world/pose", "t_ns count", f"`count` x uint16: ids, ascending; `count` x 6 float64: {_VECTOR} {_MOVES}",
    ),
    m.Obstructions: Names(
        "world/obstruction", "t_ns grounds count",
        "`grounds` x float32: the height of the ground below nodes 1, 2, ... [m]; `count` x uint16: pairs of node ids, "
        "smaller first; then nothing, or `count` / 2 x uint16: losses [1/10 dB]",
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
    m.FlightState: Names("world/<id>/sensor/flight", "t_ns roll_rad pitch_rad yaw_rad satellites hdop unix_ns"),
    m.WindEstimate: Names("world/<id>/sensor/wind", f"t_ns {_MOVES}"),
    m.LandingTarget: Names("world/<id>/sensor/pad", f"t_ns {_VECTOR}"),
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


HEAD = """# The bus

<!-- Generated by scripts/generate_bus_reference.py from the codecs in fanet_mw/bus/. -->

A swarm in real time is processes around one Zenoh router. Whoever speaks these bytes belongs to it, in any language
that has Zenoh: a world of your own (`fanet launch --no-world`), a node of your own (`fanet router`), a program that
only looks. [`examples/bus/world.py`](../../examples/bus/world.py) and
[`examples/bus/reader.py`](../../examples/bus/reader.py) use Zenoh alone, in thirty lines each.

All topics begin with `fanet/<swarm>/`; `<id>` is a node id in decimal, `<name>` is `emulator`, `world` or
`agent-<id>`.

## A put

One put is a run of messages: code (uint8), length of the body (uint32), body. Everything is little endian, without
padding. What does not decode is counted and dropped. Instants are nanoseconds of swarm time, from the start of the
clock.

## Joining a swarm

1. Connect to the router as a Zenoh client, scouting off.
2. Ask (`get`) `scenario`: the answer is the resolved scenario as JSON. An answer that is not what you run is a reason
   to leave; so is another `bus` in it, which stands for the layout of the messages below (`codecs.LAYOUT`).
3. Subscribe to what you hear, then declare the liveliness token `alive/<name>`. Processes of fanet-mw declare
   `alive/<name>/<fingerprint>/<instance>` instead: the router names those that are missing, there twice, or of
   another scenario.
4. Ask `clock` every half second until a `ClockEpoch` in state RUNNING is the answer; puts there are only hints to ask
   again: with `--slow-down-to` the launcher announces further epochs with another scale, which give the same instant at
   that moment; the greatest `number` counts. Swarm instant = (unix time - `epoch_unix_ns`) x `time_scale`; on the
   machine of the keeper (`machine` says which) monotonic time and `epoch_mono_ns` are better.
5. When the clock is STOPPED, or `ends_ns` or the scenario's duration is over, send a last report and leave.

A world puts all poses ten times a second (`world.tick_ms`), from instant 0 on, and a fix per node on
`world/<id>/sensor/gps`. A node puts each request one lead (`radio.lead_ms`) before its instant. Puts are best effort,
dropped under congestion; traces, reports, the clock and changes of the air are reliable."""


def page() -> str:
    """The whole page."""
    return "\n".join([HEAD, *_body()])


def _body() -> Iterator[str]:
    yield from ("## Messages", "", "| code | message | topic | what it is |", "|---|---|---|---|")
    for kind in kinds():
        said = " ".join((kind.__doc__ or "").split(".")[0].split())
        name, topic = kind.__name__, NAMED[kind].topic
        yield f"| {CODES[kind]} | [{name}](#{name.lower()}) | `{topic}` | {said} |"
    yield ""
    for kind in kinds():
        yield from _message(kind)
    for values in (TxOutcome, SetpointKind, ClockState):
        yield from _values(values)


def _message(kind: type[Any]) -> Iterator[str]:
    yield from (f"### {kind.__name__}", "")
    if fields := head(kind):
        yield from ("| offset | type | field |", "|---|---|---|")
        yield from (f"| {field.offset} | {field.kind} | `{field.name}` |" for field in fields)
        yield ""
    if rows := row(kind):
        yield f"Then `count` rows: {', '.join(f'{field.kind} `{field.name}`' for field in rows)}."
        yield ""
    if rest := NAMED[kind].rest:
        yield f"Then {rest}."
        yield ""


def _values(values: type[IntEnum]) -> Iterator[str]:
    yield from (
        f"### Values of {values.__name__}",
        "",
        ", ".join(f"{value.value} {value.name}" for value in values),
        "",
    )


def main(arguments: Sequence[str], *, document: Path = DOCUMENT) -> int:
    """Write the page, or with --check say whether it is the one checked in."""
    return write_or_check(arguments, script=Path(__file__).name, wanted=lambda: {document: page()})


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

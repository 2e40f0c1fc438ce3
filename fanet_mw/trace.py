"""The closed registry of trace records: the events of a run, from which metrics, figures and views are made.

A record is a NamedTuple whose first two fields are the instant and the node (0: no node). One record is one line of
JSON in the trace file; `line` and `parse` are inverse. A new kind of record is a new class in `Record` below. `parse`
refuses what no record could hold: each field has its type, integers have 64 bits, numbers are finite.
"""

import itertools
import json
import math
import re
import types
from functools import partial
from typing import Any, Final, NamedTuple, get_args, get_type_hints

from fanet_mw.errors import LocalProtocolError, MalformedFrameError


class Generated(NamedTuple):
    """An application handed a packet to its node; all delays of the packet count from this instant."""

    t_ns: int
    node: int
    seq: int
    app: str
    payload_bytes: int


class LetOut(NamedTuple):
    """The origin announced the first frame with a packet of its own; `t_ns` is when that frame may contend."""

    t_ns: int
    node: int
    seq: int


class BoundStated(NamedTuple):
    """The origin promised, when it accepted a packet, that no copy of its flood is delivered later than this."""

    t_ns: int
    node: int
    seq: int
    bound_ns: int
    """The delay from the hand-over by one application to the receipt by the other."""


class BoundExcludes(NamedTuple):
    """A stated bound or likely delay is not meant for this node, which the origin takes to be gone."""

    t_ns: int
    node: int
    seq: int
    other: int


LIKELY_SHARE: Final = 0.99
"""The share of a packet's copies for which a likely delay is stated."""


class LikelyStated(NamedTuple):
    """The origin stated, when it accepted a packet, a delay within which at least this share of its copies arrive.

    This takes the place of a bound where links lose frames and lost copies are repaired.
    """

    t_ns: int
    node: int
    seq: int
    delay_ns: int
    """The delay from the hand-over by one application to the receipt by the other."""
    share: float


class Delivered(NamedTuple):
    """A packet was handed to the application of a node for which it was meant."""

    t_ns: int
    """The instant at which that application received it."""
    node: int
    origin: int
    seq: int
    delay_ns: int
    """The time from `Generated` to this instant."""
    hops: int
    handover_ns: int = 0
    """The last part of the delay: from the end of the frame on the air to this instant."""


class Dropped(NamedTuple):
    """A packet ended inside a node."""

    t_ns: int
    node: int
    reason: str
    origin: int
    seq: int


class RoleChanged(NamedTuple):
    """A node took a role in a cluster; head 0 means none."""

    t_ns: int
    node: int
    role: str
    cluster: int
    head: int


class Detected(NamedTuple):
    """A UAV first received a survivor's phone."""

    t_ns: int
    node: int
    survivor: int
    rssi_dbm: float


class Located(NamedTuple):
    """A UAV first knew so well where a survivor is that it is worth a departure, here."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    north_m: float


class Approaching(NamedTuple):
    """A UAV changed course towards a survivor; `reporters` different nodes had reported it."""

    t_ns: int
    node: int
    survivor: int
    reporters: int
    east_m: float
    """The position of the survivor, as the UAV believes it."""
    north_m: float


class Arrived(NamedTuple):
    """A UAV reached the neighborhood of a survivor's estimated position."""

    t_ns: int
    node: int
    survivor: int


class Confirmed(NamedTuple):
    """A UAV confirmed a survivor at close range, at the place that it announced."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    north_m: float


class PlacedInside(NamedTuple):
    """A UAV that saw nobody around a building announced that a survivor is inside, at this place."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    north_m: float


class PlacedAmong(NamedTuple):
    """A UAV announced that a survivor is one of several people whom it saw, in whose middle this place is."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    north_m: float


class KnownOnGround(NamedTuple):
    """The post on the ground learned of a survivor, or of a person without a phone, at this place."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    north_m: float


class Ordered(NamedTuple):
    """The post on the ground gave an order, or a UAV learned of it."""

    t_ns: int
    node: int
    serial: int
    order: str
    other: int
    """The UAV that is meant; 0: all."""
    east_m: float
    north_m: float
    radius_m: float


class Refuted(NamedTuple):
    """A UAV took a confirmation back, because what it heard of the survivor since contradicts the announced place."""

    t_ns: int
    node: int
    survivor: int
    east_m: float
    """The place that was announced."""
    north_m: float


class Planned(NamedTuple):
    """A UAV took over a plan of the search, and its place in it; the place is -1 if it has none."""

    t_ns: int
    node: int
    revision: int
    place: int


class Posed(NamedTuple):
    """The true position of a UAV."""

    t_ns: int
    node: int
    east_m: float
    north_m: float
    up_m: float


class FlightModeChanged(NamedTuple):
    """The flight controller of a UAV entered another mode (`FlightMode` in `sim/world/mobility/guidance.py`)."""

    t_ns: int
    node: int
    mode: str


class MissionModeChanged(NamedTuple):
    """A UAV of a planned search decided to do something else (`_mode` in `agents/mission/searcher.py`)."""

    t_ns: int
    node: int
    mode: str
    survivor: int = 0
    """The survivor to whom it responds; 0 for none."""


class Sighted(NamedTuple):
    """A camera or a microphone array noticed a person; `survivor` is the one that it was taken for, 0 for none."""

    t_ns: int
    node: int
    sensor: str
    survivor: int
    east_m: float
    """The place on the ground, as the UAV computed it."""
    north_m: float


class Collided(NamedTuple):
    """Two bodies touched; `other` 0 is the ground."""

    t_ns: int
    node: int
    other: int


class ConflictForeseen(NamedTuple):
    """A UAV learned that it and another UAV will come too near each other if both fly on as they do."""

    t_ns: int
    node: int
    other: int
    closest_ms: int
    """The time until the closest point of approach."""
    distance_m: float
    """The distance between the two at that time."""
    told: bool
    """True if it learned this from the other's warning; false if it foresaw it itself."""


class Warned(NamedTuple):
    """A UAV warned of a collision with another; `seq` names the packet."""

    t_ns: int
    node: int
    other: int
    seq: int


class ConflictOver(NamedTuple):
    """A UAV resumed its course as far as this other UAV is concerned."""

    t_ns: int
    node: int
    other: int


class ProcessEnded(NamedTuple):
    """A process of the run ended before its time."""

    t_ns: int
    node: int
    name: str
    exit_code: int


class ProcessStarted(NamedTuple):
    """A process that had ended was started again (`fanet launch --respawn`)."""

    t_ns: int
    node: int
    name: str


class ClockSampled(NamedTuple):
    """The error of a node's swarm time at a true instant."""

    t_ns: int
    node: int
    ahead_ns: int
    """Swarm time as the node believes it, minus true time."""
    bound_ns: int
    """The bound that the node states for its error against its reference; -1 when it states none."""
    reference: int
    """The node whose clock it follows; 0 when it follows none."""
    hops: int


class RadioFault(NamedTuple):
    """A fault began (`active`) or ended: of `node`, or of the link to `other`; both 0 for an area, or all links.

    `extent` says where a partition or jammed area is: `nodes` on one side, a `line` through two points, a `circle`.
    """

    t_ns: int
    node: int
    other: int
    kind: str
    label: str
    active: bool
    extent: str = ""


class DeadlineMet(NamedTuple):
    """The node's bound meets `traffic.deadline_s` for packets at least `interval_ns` apart."""

    t_ns: int
    node: int
    bound_ns: int
    deadline_ns: int
    interval_ns: int


class DeadlineLost(NamedTuple):
    """The node's bound no longer meets `traffic.deadline_s`, however rarely it sends; with bound 0 it has none."""

    t_ns: int
    node: int
    bound_ns: int
    deadline_ns: int
    interval_ns: int


Record = (
    Generated
    | LetOut
    | BoundStated
    | BoundExcludes
    | LikelyStated
    | Delivered
    | Dropped
    | RoleChanged
    | Detected
    | Located
    | Approaching
    | Arrived
    | Confirmed
    | PlacedInside
    | PlacedAmong
    | KnownOnGround
    | Ordered
    | Refuted
    | Planned
    | Posed
    | FlightModeChanged
    | MissionModeChanged
    | Sighted
    | Collided
    | ConflictForeseen
    | Warned
    | ConflictOver
    | ProcessEnded
    | ProcessStarted
    | RadioFault
    | ClockSampled
    | DeadlineMet
    | DeadlineLost
)

_KINDS: Final[dict[str, type[Any]]] = {
    re.sub(r"\B([A-Z])", r"_\1", kind.__name__).lower(): kind for kind in get_args(Record)
}
_NAMES: Final[dict[type[Any], str]] = {kind: name for name, kind in _KINDS.items()}
DELIVERED_LINE: Final = '["delivered",%d,%d,%d,%d,%d,%d,%d]'
"""The format of the line of `Delivered`, without newline; its fields are all integers."""
RECORDS: Final = frozenset(_NAMES)
"""The classes of records."""
_encoded: Final = json.JSONEncoder(separators=(",", ":")).encode
_JSON_TYPES: Final[dict[object, tuple[type, ...]]] = {
    int: (int,),
    float: (float, int),
    str: (str,),
    bool: (bool,),
    types.NoneType: (types.NoneType,),
}
_LONGEST_TEXT: Final = 256
LONGEST_EXTENT: Final = 4096
"""The longest text in a record of a fault: the ids of a thousand nodes on one side of a partition."""
_LEAST_INT: Final = -(2**63)
_GREATEST_INT: Final = 2**63 - 1


def _rows_of(kind: type[Any]) -> frozenset[tuple[type, ...]]:
    """All rows of JSON types that the fields of a record may have."""
    hints = get_type_hints(kind)
    choices = [
        tuple(found for part in get_args(hints[name]) or (hints[name],) for found in _JSON_TYPES[part])
        for name in kind._fields
    ]
    least = len(choices) - (kind is RadioFault)  # an empty extent is left out
    return frozenset(row for n in range(least, len(choices) + 1) for row in itertools.product(*choices[:n]))


_ROWS: Final = {name: _rows_of(kind) for name, kind in _KINDS.items()}


def _in_bounds(value: object, longest: int = _LONGEST_TEXT) -> bool:
    """True for a field's value that a record could hold."""
    if isinstance(value, int):
        return _LEAST_INT <= value <= _GREATEST_INT
    if isinstance(value, float):
        return math.isfinite(value)
    return not isinstance(value, str) or len(value) <= longest


_BOUNDS: Final = {_NAMES[RadioFault]: partial(_in_bounds, longest=LONGEST_EXTENT)}
"""What the fields of a record are checked by whose texts may be longer."""


def kind_of(record: Record) -> str:
    return _NAMES[type(record)]


def name_of(kind: type[Record]) -> str:
    return _NAMES[kind]


def line(record: Record) -> str:
    """A record as one JSON array, without newline: `["delivered", t_ns, node, ...]` in the order of fields; an empty
    extent is left out.
    """
    if type(record) is Delivered:  # nine lines in ten are such; formatting is four times as fast as JSON's encoder
        return DELIVERED_LINE % record
    fields = record[:-1] if type(record) is RadioFault and not record.extent else record
    return _encoded([_NAMES[type(record)], *fields])


def require_record(record: object, *, who: str) -> None:
    """Raise LocalProtocolError for what no trace could hold."""
    try:
        parse(line(record))  # type: ignore[arg-type]
    except (KeyError, TypeError, ValueError, MalformedFrameError) as error:
        raise LocalProtocolError(f"{who}: record() takes a record of fanet_mw.trace, not {record!r:.120}") from error


def parse(text: str) -> Record:
    """The record of one line; raises MalformedFrameError when the line is no record."""
    try:
        name, *fields = json.loads(text)
        if tuple(map(type, fields)) not in _ROWS[name] or not all(map(_BOUNDS.get(name, _in_bounds), fields)):
            raise ValueError("fields")
        record: Record = _KINDS[name](*fields)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise MalformedFrameError(f"trace line {text[:80]!r} is no record") from error
    return record

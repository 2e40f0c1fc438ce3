"""Faults that can be set while a swarm runs, on the air (`Degrade`, `Jam`, `Cut`, `Partition`) or at a UAV (`Mishap`).

A new fault replaces one with the same label, and `Restore` ends one fault or all. A fault lasts for `for_ns` from the
instant at which the medium receives it; 0 means until it is restored. The same types are the messages on
`fanet/<s>/radio/control` and the entries of a scenario's `[[faults]]`. Not modeled: faults of the bus.
"""

import math
from collections.abc import Iterator
from enum import IntEnum
from typing import Final, NamedTuple, assert_never

from fanet_mw.errors import ConfigError
from fanet_mw.trace import LONGEST_EXTENT
from fanet_mw.units import Enu, NodeId, S

MAX_LABEL: Final = 32
MAX_LOSS_DB: Final = 300.0
MAX_NOISE_DBM: Final = 100.0
MAX_RADIUS_M: Final = 1e7
MAX_FOR_NS: Final = 1_000_000 * S


EVERY: Final = NodeId(0)
"""A degraded link with this id at both ends means every link."""


class Degrade(NamedTuple):
    """The link from `src` to `dst` (0 to 0: every link) is weaker, loses a share of its frames and ACKs, or both."""

    label: str
    src: NodeId
    dst: NodeId
    both: bool
    """True if the link from `dst` to `src` is degraded too."""
    loss_db: float
    """The loss added to the path loss [dB], in [0, 300]. Channel `range` has no SNR: there it lowers the RSSI, and the
    link is gone when the RSSI falls below the sensitivity."""
    loss_share: float
    """The share of lost frames among those that would have been received, in [0, 1]."""
    for_ns: int = 0


class Jam(NamedTuple):
    """Receivers within `radius_m` of a place, at any height, receive noise."""

    label: str
    center: Enu
    radius_m: float
    noise_dbm: float
    """Noise at each receiver inside, added to its own noise [dBm], at most 100; with inf nothing is received. Channel
    `range` has no SNR: there any noise means that nothing is received."""
    for_ns: int = 0


class Cut(NamedTuple):
    """The radio of a node is off: it neither sends nor receives, and no station senses it; or only one of the two."""

    label: str
    node: NodeId
    for_ns: int = 0
    sends: bool = False
    """True if it is deaf only: others receive what it sends."""
    hears: bool = False
    """True if it is mute only: it receives what others send."""


class Partition(NamedTuple):
    """Stations on different sides of a line, or inside and outside of a group, do not receive or sense each other."""

    label: str
    group: tuple[NodeId, ...]
    """The nodes on one side; none if a line on the map parts them."""
    line_m: tuple[float, float, float, float]
    """East and north of two points of that line, wherever the UAVs are at each instant."""
    for_ns: int = 0


class MishapKind(IntEnum):
    """What can befall a UAV; in lower case the kinds of `[[faults]]`, but for `GPS_OFF`."""

    CRASH = 0
    """Its motors stop; its radio dies when it hits the ground."""
    BATTERY = 1
    """Its battery has no more than this share of its charge left."""
    GPS = 2
    """Its receiver is wrong by an offset."""
    GPS_OFF = 3
    """Its receiver gives no position."""
    STOP = 4
    """Its program has ended; it is started anew when the fault ends."""


class Mishap(NamedTuple):
    """Something befalls a UAV other than on the air."""

    label: str
    node: NodeId
    what: MishapKind
    value: Enu
    """East, north and up of an offset [m], or the share of the charge as `east`."""
    for_ns: int = 0


class Restore(NamedTuple):
    """End the fault with this label, or all faults (empty)."""

    label: str


Fault = Degrade | Jam | Cut | Partition | Mishap
Control = Fault | Restore


def kind_of(fault: Fault) -> str:
    """The kind of a fault in the trace, which is that of `[[faults]]`."""
    match fault:
        case Degrade():
            return "degrade"
        case Jam():
            return "jam"
        case Partition():
            return "partition"
        case Mishap():
            return "gps" if fault.what is MishapKind.GPS_OFF else fault.what.name.lower()
        case Cut():
            return "deaf" if fault.sends else "mute" if fault.hears else "cut"
        case _:
            assert_never(fault)


def can_end(fault: Fault) -> bool:
    """False for what befalls a UAV for good: motors do not start again, and a battery gets no charge back."""
    return not (isinstance(fault, Mishap) and fault.what in (MishapKind.CRASH, MishapKind.BATTERY))


def extent_of(fault: Fault) -> str:
    """Where a partition or a jammed area is, as a word and numbers for the trace: `nodes` on one side, a `line` through
    two points, a `circle` with its middle, radius and noise [dBm]. Empty for other faults.
    """
    match fault:
        case Partition() if fault.group:
            text = " ".join(["nodes", *map(str, fault.group)])
            return text if len(text) <= LONGEST_EXTENT else ""
        case Partition():
            return " ".join(["line", *map(str, fault.line_m)])
        case Jam():
            return f"circle {fault.center.east} {fault.center.north} {fault.radius_m} {fault.noise_dbm}"
        case _:
            return ""


def link_label(src: int, dst: int) -> str:
    """The default label of a degraded link, or of all links."""
    return f"link-{src}-{dst}" if src or dst else "links"


def node_label(node: int) -> str:
    """The default label of a cut."""
    return f"node-{node}"


JAM_LABEL: Final = "jam"
"""The default label of a jammed area."""
PARTITION_LABEL: Final = "partition"


def nodes_of(fault: Fault) -> tuple[int, ...]:
    if isinstance(fault, Degrade):
        return () if fault.src == fault.dst == EVERY else (fault.src, fault.dst)
    if isinstance(fault, Partition):
        return fault.group
    return (fault.node,) if isinstance(fault, Cut | Mishap) else ()


def wrong(fault: Fault, *, count: int) -> str | None:
    """Why a fault is not valid in a swarm of `count` nodes, as one word; None when it is valid."""
    label = fault.label
    if not 0 < len(label) <= MAX_LABEL or not (label.isascii() and label.isprintable()):
        return "fault_label"
    if any(not 1 <= node <= count for node in nodes_of(fault)):
        return "fault_unknown_node"
    return "fault_value" if out_of_bounds(fault) else None


def require_valid(fault: Fault, *, count: int) -> None:
    """Raise ConfigError for a fault that is not valid in a swarm of `count` nodes, with the value and its bound."""
    why = wrong(fault, count=count)
    if why == "fault_unknown_node":
        named = " ".join(map(str, nodes_of(fault)))
        raise ConfigError(f"{kind_of(fault)} {named}: the id of a node must be within [1, {count}]")
    if why is not None:
        said = f"a label has 1 to {MAX_LABEL} characters of ASCII" if why == "fault_label" else out_of_bounds(fault)
        raise ConfigError(f"{kind_of(fault)} {fault.label}: {said}")


def out_of_bounds(fault: Fault) -> str | None:
    """A sentence on a value of a fault that is out of its bounds; None when all are within."""
    return next((sentence for holds, sentence in _rules(fault) if not holds), None)


def _rules(fault: Fault) -> Iterator[tuple[bool, str]]:
    """What must hold for the values of a fault, as sentences that name the value and its bound."""
    yield _within("for_s", fault.for_ns / S, 0, MAX_FOR_NS / S)
    if isinstance(fault, Degrade):
        yield fault.src != fault.dst or fault.src == EVERY, "a link has two different ends"
        yield _within("loss_db", fault.loss_db, 0, MAX_LOSS_DB)
        yield _within("loss_share", fault.loss_share, 0, 1)
    elif isinstance(fault, Jam):
        yield fault.radius_m > 0, f"radius_m = {fault.radius_m:g} must be > 0"
        for name, value in (("radius_m", fault.radius_m), *fault.center._asdict().items()):
            yield _within(name, value, -MAX_RADIUS_M, MAX_RADIUS_M)
        if fault.noise_dbm != math.inf:
            yield _within("noise_dbm", fault.noise_dbm, -MAX_LOSS_DB, MAX_NOISE_DBM)
    elif isinstance(fault, Partition) and not fault.group:
        for value in fault.line_m:
            yield _within("line_m", value, -MAX_RADIUS_M, MAX_RADIUS_M)
        yield fault.line_m[:2] != fault.line_m[2:], "a line goes through two different points"
    elif isinstance(fault, Mishap):
        if fault.what is MishapKind.BATTERY:
            yield _within("charge", fault.value.east, 0, 1)
        for value in fault.value:
            yield _within("offset_m", value, -MAX_RADIUS_M, MAX_RADIUS_M)
    elif isinstance(fault, Cut):
        yield not (fault.sends and fault.hears), "a radio that sends and receives is not cut"


def _within(name: str, value: float, least: float, most: float) -> tuple[bool, str]:
    return least <= value <= most, f"{name} = {value:g} must be in [{least:g}, {most:g}]"

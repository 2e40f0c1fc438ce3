"""Changes of the air while a swarm runs: a degraded link, a jammed area, a node cut off; and their end.

A fault has a label; a new one of the same label takes the place of the old, `Restore` ends one or all. Each lasts
`for_ns` from the instant at which the medium takes it, or until it is restored (0). These are messages on
`fanet/<s>/radio/control` and the entries of a scenario's `[[faults]]`. `wrong` is what the medium asks before it obeys.
Does not model: faults of the bus itself, or of a node's processor.
"""

import math
from typing import Final, NamedTuple

from fanet_mw.units import Enu, NodeId, S

MAX_LABEL: Final = 32
MAX_LOSS_DB: Final = 300.0
MAX_NOISE_DBM: Final = 100.0
MAX_RADIUS_M: Final = 1e7
MAX_FOR_NS: Final = 1_000_000 * S


class Degrade(NamedTuple):
    """The link from `src` to `dst` is weaker, or loses a share of its frames (ACKs too), or both."""

    label: str
    src: NodeId
    dst: NodeId
    both: bool
    """Also the link from `dst` to `src`."""
    loss_db: float
    """Added to the path loss [dB], in [0, 300]. Channel `range` knows no SNR: there it lowers the RSSI, and the link is
    gone where that falls below the sensitivity."""
    loss_share: float
    """Of frames that would have been received, in [0, 1]."""
    for_ns: int = 0


class Jam(NamedTuple):
    """Receivers within `radius_m` of a place, at any height, hear noise."""

    label: str
    center: Enu
    radius_m: float
    noise_dbm: float
    """At each receiver inside, added to its own noise [dBm], at most 100; inf: nothing is received. Channel `range`
    knows no SNR: there any noise means that nothing is received."""
    for_ns: int = 0


class Cut(NamedTuple):
    """A node's radio is off: it neither sends nor hears, and nobody senses it."""

    label: str
    node: NodeId
    for_ns: int = 0


class Restore(NamedTuple):
    """End the fault of this label, or all of them (empty)."""

    label: str


Fault = Degrade | Jam | Cut
Control = Degrade | Jam | Cut | Restore


def link_label(src: int, dst: int) -> str:
    """The label of a degraded link that was given none."""
    return f"link-{src}-{dst}"


def node_label(node: int) -> str:
    """The label of a cut that was given none."""
    return f"node-{node}"


JAM_LABEL: Final = "jam"
"""The label of a jammed area that was given none."""


def nodes_of(fault: Fault) -> tuple[int, ...]:
    """The nodes that a fault names."""
    if isinstance(fault, Degrade):
        return fault.src, fault.dst
    return (fault.node,) if isinstance(fault, Cut) else ()


def wrong(fault: Fault, *, count: int) -> str | None:
    """Why a fault cannot be meant in a swarm of `count` nodes, in a word; None when it can."""
    label = fault.label
    if not 0 < len(label) <= MAX_LABEL or not (label.isascii() and label.isprintable()):
        return "fault_label"
    if any(not 1 <= node <= count for node in nodes_of(fault)):
        return "fault_unknown_node"
    if not 0 <= fault.for_ns <= MAX_FOR_NS:
        return "fault_value"
    if isinstance(fault, Degrade):
        fine = 0 <= fault.loss_db <= MAX_LOSS_DB and 0 <= fault.loss_share <= 1 and fault.src != fault.dst
    elif isinstance(fault, Jam):
        noise_dbm = fault.noise_dbm
        fine = (
            0 < fault.radius_m <= MAX_RADIUS_M
            and all(abs(value) <= MAX_RADIUS_M for value in fault.center)
            and (-MAX_LOSS_DB <= noise_dbm <= MAX_NOISE_DBM or noise_dbm == math.inf)
        )
    else:
        fine = True
    return None if fine else "fault_value"

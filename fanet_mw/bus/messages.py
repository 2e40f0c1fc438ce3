"""What travels on the bus. Typed values; their bytes are the business of `fanet_mw.bus.topics`.

The virtual host hands these objects over as they are; the real-time host encodes them per topic. Treat every message
as immutable: in the virtual host the receiver holds the sender's object.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Restore
from fanet_mw.trace import Record
from fanet_mw.units import Enu, NodeId


class TxRequest(NamedTuple):
    """Node -> radio: put `frame` on the air at `start_ns`, announced some milliseconds before (the lead)."""

    seq: int
    """Counts the requests of this node from 0; a gap is a request the bus lost."""
    start_ns: int
    """Swarm instant from which the MAC may contend for the channel."""
    frame: bytes
    """Whole MAVLink frames, routing header first. Its length is the UDP payload charged on the air."""
    dst: NodeId
    """A neighbor (unicast, acknowledged) or BROADCAST."""
    wants_status: bool
    """Ask for a `TxStatus`; unicast senders do, broadcasts usually not."""


class Reception(NamedTuple):
    """Radio -> node: a frame was decoded by this station."""

    frame: bytes
    src: NodeId
    """The transmitting neighbor."""
    end_ns: int
    """Swarm instant at which the last bit arrived."""
    rssi_dbm: float


class TxOutcome(IntEnum):
    """How a transmit request ended. Values are the codes on the bus."""

    SENT = 0
    """A broadcast left the antenna."""
    ACKED = 1
    RETRY_LIMIT = 2
    QUEUE_FULL = 3
    LIFETIME = 4
    LATE = 5


class TxStatus(NamedTuple):
    """Radio -> node: how the request `seq` ended."""

    seq: int
    outcome: TxOutcome
    end_ns: int
    attempts: int


class Poses(NamedTuple):
    """World -> everyone: the true state of all bodies at one instant."""

    t_ns: int
    ids: array[int]
    """`array('H')` of node ids, ascending."""
    states: array[float]
    """`array('d')`, six per node: east, north, up [m], then the velocity [m/s]; row order of `ids`."""


class Obstructions(NamedTuple):
    """World -> medium: the pairs of nodes between which something solid stands at one instant, and no others."""

    t_ns: int
    pairs: array[int]
    """`array('H')`, two node ids per pair, the smaller first, ascending."""


class Setpoint(NamedTuple):
    """UAV -> world: fly to `position` at no more than `speed_m_s`, and hold there."""

    t_ns: int
    position: Enu
    speed_m_s: float


class Gps(NamedTuple):
    """World -> one UAV: where its receiver says it is."""

    t_ns: int
    position: Enu
    velocity: Enu


class WifiScan(NamedTuple):
    """World -> one UAV: the phones it hears, strongest first."""

    t_ns: int
    heard: tuple[tuple[int, float], ...]
    """(survivor id, RSSI dBm)."""


class MavlinkTap(NamedTuple):
    """UAV -> inspectors and ground stations: MAVLink bytes as the node produced or delivered them."""

    t_ns: int
    data: bytes


class TraceBatch(NamedTuple):
    """Any actor -> the collector of the run."""

    records: tuple[Record, ...]


class ClockState(IntEnum):
    """What the swarm clock is doing."""

    RUNNING = 1
    STOPPED = 2


class Clock(NamedTuple):
    """The keeper of the swarm clock -> every host: swarm instant = (clock - epoch) x scale."""

    epoch_unix_ns: int
    time_scale: float
    state: ClockState
    epoch_mono_ns: int = 0
    """The same instant on the monotonic clock of the keeper's machine."""
    machine: int = 0
    """Which machine that is (`Timebase.machine`); 0: unknown, and only unix time counts."""


@dataclass(frozen=True, slots=True)
class Report:
    """Any actor -> the launcher: its cumulative counters as JSON text."""

    name: str
    t_ns: int
    json: str


Message = (
    TxRequest
    | Reception
    | TxStatus
    | Poses
    | Obstructions
    | Setpoint
    | Gps
    | WifiScan
    | MavlinkTap
    | TraceBatch
    | Clock
    | Report
    | Degrade
    | Jam
    | Cut
    | Restore
    | LinkStats
)

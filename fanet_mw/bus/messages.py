"""The messages on the bus, as typed values; their bytes are defined in `fanet_mw.bus.codecs`.

The virtual host hands these objects over as they are; the real-time host encodes them per topic. Every message is to be
treated as immutable: in the virtual host the receiver holds the sender's object.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, Partition, Restore
from fanet_mw.orders import Order
from fanet_mw.trace import Record
from fanet_mw.units import STILL, Enu, NodeId, S


class TxRequest(NamedTuple):
    """Node -> radio: put `frame` on the air at `start_ns`, announced some milliseconds ahead (the lead)."""

    seq: int
    """The number of this request, counted per node from 0; a gap means requests that the bus has lost."""
    start_ns: int
    """Swarm instant from which the MAC may contend for the channel."""
    frame: bytes
    """Whole MAVLink frames, the routing header first. Their total length is that of the UDP payload on the air."""
    dst: NodeId
    """A neighbor (unicast, acknowledged) or BROADCAST."""
    wants_status: bool
    """True if a `TxStatus` is wanted, as it is for unicasts, and usually not for broadcasts."""
    until_ns: int = 0
    """Swarm instant from which the MAC may no longer begin to transmit the frame, and drops it; 0: none is given."""


class Reception(NamedTuple):
    """Radio -> node: this station has decoded a frame."""

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
    """The request came so long after its instant that it was dropped."""
    REFUSED = 6
    """The radio can never send this: no such destination, no bytes or too many, or an absurd instant."""


class TxStatus(NamedTuple):
    """Radio -> node: how the request `seq` ended."""

    seq: int
    outcome: TxOutcome
    end_ns: int
    attempts: int


class Poses(NamedTuple):
    """World -> all: the true state of all bodies at one instant."""

    t_ns: int
    ids: array[int]
    """`array('H')` of node ids, ascending."""
    states: array[float]
    """`array('d')`, six per node: east, north, up [m], then the velocity [m/s]; row order of `ids`."""


class Obstructions(NamedTuple):
    """World -> medium: all pairs of nodes whose link something solid weakens at one instant, and the ground below."""

    t_ns: int
    pairs: array[int]
    """`array('H')`, two node ids per pair, the smaller first, ascending."""
    losses_ddb: array[int] = array("H")
    """`array('H')`, the loss of each pair [1/10 dB]; empty: that of the scenario (`radio.obstruction_loss_db`)."""
    ground_m: array[float] = array("f")
    """`array('f')`, the height of the ground below each node, in order of id; empty: 0."""


class SetpointKind(IntEnum):
    """What a setpoint asks of the flight controller. Values are the codes on the bus."""

    POSITION = 0
    """Fly to `position` at no more than `speed_m_s` and hold there; a speed of 0 or less ends all setpoints."""
    VELOCITY = 1
    """Fly at `velocity`; one that is not renewed within `VELOCITY_LASTS_NS` becomes HOLD."""
    HOLD = 2
    """Stop and stay."""
    TAKEOFF = 3
    """Climb straight up to the height of `position` at `speed_m_s` and hold there."""
    LAND = 4
    """Sink straight down at `speed_m_s`, and stop the motors on the ground."""
    RETURN = 5
    """Climb to its height of return, fly to its start at `speed_m_s` (0 or less: cruising speed), and land; a UAV that
    stands on the ground stays there.
    """


VELOCITY_LASTS_NS: Final = 1 * S
"""A velocity setpoint lasts for this long: a UAV whose computer has died must not fly on for ever."""


class Setpoint(NamedTuple):
    """UAV -> world: what the UAV's flight controller is to do until the next setpoint."""

    t_ns: int
    position: Enu
    speed_m_s: float
    kind: SetpointKind = SetpointKind.POSITION
    velocity: Enu = STILL
    """VELOCITY: the velocity to fly, over the ground."""


class Gps(NamedTuple):
    """World -> one UAV: its position and velocity according to its receiver."""

    t_ns: int
    """The swarm instant of the fix."""
    position: Enu
    """The position [m], with the error of the receiver."""
    velocity: Enu
    """The velocity [m/s], with the error of the receiver."""


class WifiScan(NamedTuple):
    """World -> one UAV: the phones that it receives, strongest first."""

    t_ns: int
    """The swarm instant of the reading."""
    heard: tuple[tuple[int, float], ...]
    """(survivor id, RSSI dBm)."""


class Person(NamedTuple):
    """A person that a camera has recognized, without identification. The angles include the error of the sensor."""

    bearing_rad: float
    """From north, clockwise."""
    elevation_rad: float
    """Above the horizontal; negative below it."""
    pixels: float
    """Across the person: the square root of the area in the image."""


class Camera(NamedTuple):
    """World -> one UAV: the people in one image of its downward camera; an image without any is not told."""

    t_ns: int
    """The swarm instant of the reading."""
    people: tuple[Person, ...]
    """The people in the image, each with bearing and elevation [rad] and size [pixels]."""


class CameraImage(NamedTuple):
    """World -> one UAV: what its downward camera shows, rendered, for a user's own eyes on board."""

    t_ns: int
    """The swarm instant of the reading."""
    width: int
    """Pixels from west to east."""
    height: int
    """Pixels from north to south."""
    rgb: bytes
    """Red, green and blue of each pixel, row by row from the northwest corner."""


class Call(NamedTuple):
    """A voice that a microphone array made out."""

    bearing_rad: float
    """From north, clockwise."""
    elevation_rad: float
    level_db: float
    """Sound pressure level at the array [dB re 20 uPa]."""
    snr_db: float
    """Over rotor and wind noise, after the array's processing."""


class Voice(NamedTuple):
    """World -> one UAV: the voices that its microphones made out; silence is not told."""

    t_ns: int
    """The swarm instant of the reading."""
    calls: tuple[Call, ...]
    """The voices, each with bearing and elevation [rad], level and signal-to-noise ratio [dB]."""


class Echo(NamedTuple):
    """One return of a radar: a UAV, a wall, a hillside, or clutter; a radar cannot tell which."""

    range_m: float
    bearing_rad: float
    """From north, clockwise."""
    elevation_rad: float
    closing_m_s: float
    """The speed at which the range shrinks."""
    snr_db: float


class Radar(NamedTuple):
    """World -> one UAV: the returns of one scan, nearest first; a scan without any is not told."""

    t_ns: int
    """The swarm instant of the reading."""
    echoes: tuple[Echo, ...]
    """The returns, each with range [m], bearing and elevation [rad], closing speed [m/s] and SNR [dB]."""


class Altimeter(NamedTuple):
    """World -> one UAV: its height by air pressure, and its height over whatever is below."""

    t_ns: int
    """The swarm instant of the reading."""
    up_m: float
    """The height by the barometer, which is noisy and drifts slowly."""
    above_ground_m: float | None
    """The height by the rangefinder that looks down; None: nothing is within its range."""


class Inertial(NamedTuple):
    """World -> one UAV: its velocity by inertial sensors and optical flow; needs no GPS, and drifts."""

    t_ns: int
    """The swarm instant of the reading."""
    velocity: Enu
    """The velocity [m/s]."""


class Battery(NamedTuple):
    """World -> one UAV: the state of its battery."""

    t_ns: int
    """The swarm instant of the reading."""
    voltage_v: float
    """The voltage at its terminals."""
    current_a: float
    """The current that is drawn from it."""
    charge: float
    """Share of the capacity that is left, 0 to 1."""


class FlightState(NamedTuple):
    """Flight controller -> the UAV's computer: its attitude, time and quality of GPS; the simulated world has none."""

    t_ns: int
    """The swarm instant of the reading."""
    roll_rad: float
    """To the right."""
    pitch_rad: float
    """Nose up."""
    yaw_rad: float
    """From north, clockwise."""
    satellites: int = 255
    """How many its receiver uses; 255: not known."""
    hdop: float | None = None
    """Horizontal dilution of precision; None: not known."""
    unix_ns: int = 0
    """Unix time at `t_ns` by GPS; 0: not known."""


class WindEstimate(NamedTuple):
    """World -> one UAV: the mean wind by its flight controller, from how far it leans; needs no airspeed sensor."""

    t_ns: int
    """The swarm instant of the reading."""
    velocity: Enu
    """The velocity of the air over ground [m/s]."""


class LandingTarget(NamedTuple):
    """World -> one UAV: its camera sees the marker on its own pad, as MAVLink's LANDING_TARGET tells it."""

    t_ns: int
    """The swarm instant of the image."""
    offset: Enu
    """From the UAV to the pad [m]."""


class MavlinkTap(NamedTuple):
    """UAV -> inspectors and ground stations: MAVLink bytes as the node produced or delivered them."""

    t_ns: int
    data: bytes


class TraceBatch(NamedTuple):
    """Any actor -> the collector of the run: trace records."""

    records: tuple[Record, ...]


class ClockState(IntEnum):
    """The state of the swarm clock."""

    RUNNING = 1
    STOPPED = 2


class ClockEpoch(NamedTuple):
    """The keeper of the swarm clock -> every host: swarm instant = (clock - epoch) x scale."""

    epoch_unix_ns: int
    time_scale: float
    state: ClockState
    epoch_mono_ns: int = 0
    """The same instant as the epoch, on the monotonic clock of the keeper's machine; 0: all were given the epoch
    beforehand, and nobody keeps the clock."""
    machine: int = 0
    """The keeper's machine (`Timebase.machine`); with 0 it is unknown, and only unix time counts."""
    number: int = 0
    """The number of this announcement, counted by the keeper from 0: a later one replaces all earlier ones."""
    ends_ns: int = 0
    """The swarm instant at which all leave before the scenario is over; 0: nobody leaves early."""


class ClockRequest(NamedTuple):
    """An operator -> the keeper of the swarm clock: let the swarm's time pass at another pace."""

    time_scale: float
    """Swarm seconds per second of real time, in [0.001, 100]; at 0.001 the swarm as good as stands still."""


PACE_BOUNDS: Final = (1e-3, 100.0)
"""The bounds of the pace that an operator may ask for."""


@dataclass(frozen=True, slots=True)
class Report:
    """Any actor -> the launcher: its cumulative counters as JSON text."""

    name: str
    t_ns: int
    json: str


SensorReading = (
    WifiScan
    | Camera
    | CameraImage
    | Voice
    | Radar
    | Altimeter
    | Inertial
    | Battery
    | FlightState
    | WindEstimate
    | LandingTarget
)
"""Any reading of a sensor other than the position fix; a new kind of sensor is one more member of this union."""

Message = (
    TxRequest
    | Reception
    | TxStatus
    | Poses
    | Obstructions
    | Setpoint
    | Gps
    | SensorReading
    | MavlinkTap
    | TraceBatch
    | ClockEpoch
    | ClockRequest
    | Report
    | Degrade
    | Jam
    | Cut
    | Partition
    | Mishap
    | Order
    | Restore
    | LinkStats
)

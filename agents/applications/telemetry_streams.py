"""MAVLink telemetry of one UAV: the streams of messages that its flight controller would send, at their rates. Sans-IO.

Without an operator the streams are those that a log needs. An operator who is heard gets all that a ground station
draws, and changes the rate of each by message.

Without a real flight controller the attitude is inferred: a multirotor tilts so that thrust, gravity and the drag of an
Iris add up to its acceleration, and it faces where it flies.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from fanet_mw.application import Application, AppPort
from fanet_mw.bus.messages import Battery, FlightState, Gps, SensorReading, WindEstimate
from fanet_mw.flavors import Mode
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, ORIGIN, Attitude, BatteryState, Encoder, Geodetic, common
from fanet_mw.units import MS, STILL, Enu, NodeId, S

GRAVITY_M_S2: Final = 9.80665
MAX_TILT: Final = math.radians(35)
"""The usual tilt limit of a multirotor's position controller; noise in the velocity must not look like more."""
DRAG_PER_S: Final = 0.14
"""What the rotors of an Iris lose for each m/s of airspeed, and what its frame does for each square of it: 4 lambda w /
m, and c / m of the vehicle that the world flies."""
DRAG_PER_M: Final = 0.0105
TURNING_M_S: Final = 0.5
"""Below this speed the course is noise, and the heading is kept."""

_HOUR_NS: Final = 3600 * S

# `telemetry_hz` also bounds each stream, and sets the rate of the position.
_EVERY_NS: Final = 1 * S
_SELDOM_NS: Final = 5 * S
_RARELY_NS: Final = 10 * S


_FASTEST_NS: Final = 20 * MS
"""No stream comes more often, whatever a ground station asks for."""
_FIX_LASTS_NS: Final = 3 * S
_OPERATORS: Final = {
    common.MAVLINK_MSG_ID_HEARTBEAT: _EVERY_NS, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _EVERY_NS // 2,
    common.MAVLINK_MSG_ID_ATTITUDE: _EVERY_NS, common.MAVLINK_MSG_ID_GPS_RAW_INT: _EVERY_NS,
    common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _EVERY_NS, common.MAVLINK_MSG_ID_SYS_STATUS: _EVERY_NS,
    common.MAVLINK_MSG_ID_BATTERY_STATUS: _SELDOM_NS, common.MAVLINK_MSG_ID_HOME_POSITION: _SELDOM_NS,
    common.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _EVERY_NS, common.MAVLINK_MSG_ID_VFR_HUD: _EVERY_NS,
    common.MAVLINK_MSG_ID_MISSION_CURRENT: _EVERY_NS, common.MAVLINK_MSG_ID_SYSTEM_TIME: _SELDOM_NS,
    common.MAVLINK_MSG_ID_RADIO_STATUS: _EVERY_NS, common.MAVLINK_MSG_ID_ADSB_VEHICLE: _EVERY_NS,
}  # fmt: skip
"""The longest intervals while an operator is there."""

_LOGGED: Final = {
    common.MAVLINK_MSG_ID_HEARTBEAT: _EVERY_NS, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0,
    common.MAVLINK_MSG_ID_ATTITUDE: _EVERY_NS, common.MAVLINK_MSG_ID_GPS_RAW_INT: _EVERY_NS,
    common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _EVERY_NS, common.MAVLINK_MSG_ID_SYS_STATUS: _SELDOM_NS,
    common.MAVLINK_MSG_ID_BATTERY_STATUS: _RARELY_NS, common.MAVLINK_MSG_ID_HOME_POSITION: _RARELY_NS,
}  # fmt: skip
"""The shortest intervals of what is sent without an operator, in the order of sending."""


class Flown(NamedTuple):
    """What the operator's side of the UAV knows of its flight, for telemetry."""

    mode: Mode = Mode.MISSION
    armed: bool = True
    on_ground: bool = False
    critical: bool = False
    mission_at: int = 0
    mission_items: int = 0
    mission_flies: bool = False
    home: Enu = STILL
    fenced: bool = False
    """An operator has uploaded a fence."""
    beyond: bool = False
    """The UAV is where the fence does not want it."""


class Link(NamedTuple):
    """The radio link of the UAV, as a modem would tell it."""

    rssi_dbm: float | None = None
    """The power of the strongest neighbor; None: nobody is heard."""
    lost: int = 0


@dataclass
class _Stream:
    """One kind of message, its interval, and the instant at which it is next due."""

    encode: Callable[[int], bytes]
    interval_ns: int
    due_ns: int
    usual_ns: int = 0
    """The interval that is in force unless an operator asks for another."""


class TelemetryStreams:
    """The telemetry of one UAV."""

    def __init__(self, node: NodeId, *, position: Enu, telemetry_hz: float, origin: Geodetic = ORIGIN) -> None:
        self.position = position
        self.velocity = STILL
        self.flown = Flown(home=position)
        self.link = Link()
        self.finds: dict[int, Enu] = {}
        """Survivors whom this UAV has confirmed, and where; ground stations are shown one of them at a time."""
        self._shown_find = 0
        self.height_off_m = 0.0
        """By how much the receiver is wrong in height; the flight controller tells heights without it."""
        self._acceleration = STILL
        self._wind = STILL
        self.yaw: float | None = None
        """The heading; None until the UAV has flown or was turned: 0 would shorten hellos, as MAVLink drops trailing
        zeros.
        """
        self._fix_ns: int | None = None
        self._flight: FlightState | None = None
        """What a real flight controller said lately."""
        self._battery: BatteryState | None = None
        self._read_ns: int | None = None
        self._consumed_mah = 0.0
        self._encoder = Encoder(node, component=AUTOPILOT_COMPONENT, origin=origin)
        self._beacons = Encoder(node, component=AUTOPILOT_COMPONENT, origin=origin)
        """The encoder of frames for the air, counted apart from telemetry, so that a gap is a loss."""
        self.encoder = self._encoder
        """The encoder of all that the flight controller says, answers to a ground station included."""
        self._node = node
        self._base_ns = max(1, round(S / telemetry_hz)) if telemetry_hz else 0
        self._messages = self._encoders(self._encoder)
        self.air_encoder = Encoder(node, component=AUTOPILOT_COMPONENT, origin=origin)
        """The encoder of what crosses the air to the post: a stream of its own, with its own numbers."""
        self._over_air = self._encoders(self.air_encoder)
        self._streams: dict[int, _Stream] = {}
        for message_id, least_ns in _LOGGED.items() if telemetry_hz else ():
            self._begin(message_id, max(least_ns, self._base_ns), self._phase_ns)
        self._due_ns = self._first_ns()

    def _encoders(self, encoder: Encoder) -> dict[int, Callable[[int], bytes]]:
        """What makes each message that the flight controller sends, by its id."""
        return {
            common.MAVLINK_MSG_ID_HEARTBEAT: lambda _: encoder.vehicle_heartbeat(
                self.flown.mode, armed=self.flown.armed, critical=self.flown.critical
            ),
            common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: lambda now_ns: self._global_position(encoder, now_ns),
            common.MAVLINK_MSG_ID_ATTITUDE: lambda now_ns: encoder.attitude(self.attitude, now_ns=now_ns),
            common.MAVLINK_MSG_ID_GPS_RAW_INT: lambda now_ns: self._gps_raw(encoder, now_ns),
            common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: lambda _: encoder.extended_sys_state(self._landed()),
            common.MAVLINK_MSG_ID_SYS_STATUS: lambda now_ns: encoder.sys_status(
                self._battery,
                has_fix=self._has_fix(now_ns),
                fenced=self.flown.fenced,
                beyond=self.flown.beyond,
            ),
            common.MAVLINK_MSG_ID_BATTERY_STATUS: lambda _: encoder.battery_status(self._battery),
            common.MAVLINK_MSG_ID_HOME_POSITION: lambda _: encoder.home_position(self.flown.home),
            common.MAVLINK_MSG_ID_LOCAL_POSITION_NED: lambda now_ns: encoder.local_position(
                self._estimate, self.velocity, now_ns=now_ns
            ),
            common.MAVLINK_MSG_ID_VFR_HUD: lambda _: encoder.vfr_hud(
                self._estimate, self.velocity, airspeed_m_s=self._airflow.norm(), yaw=self.yaw
            ),
            common.MAVLINK_MSG_ID_MISSION_CURRENT: lambda _: encoder.mission_current(
                self.flown.mission_at, items=self.flown.mission_items, flies=self.flown.mission_flies
            ),
            common.MAVLINK_MSG_ID_SYSTEM_TIME: lambda now_ns: encoder.system_time(
                now_ns, unix_ns=self._unix_ns(now_ns)
            ),
            common.MAVLINK_MSG_ID_RADIO_STATUS: lambda _: encoder.radio_status(self.link.rssi_dbm, self.link.lost),
            common.MAVLINK_MSG_ID_ADSB_VEHICLE: lambda _: self._find(encoder),
            common.MAVLINK_MSG_ID_AUTOPILOT_VERSION: lambda _: encoder.autopilot_version(self._node),
        }

    @property
    def _phase_ns(self) -> int:
        """The phase of the streams depends on the node's id, so that not all nodes send at once."""
        return self._node * 7_919_000 % self._base_ns if self._base_ns else self._node * 7_919_000 % S

    def _begin(self, message_id: int, interval_ns: int, due_ns: int) -> None:
        self._streams[message_id] = _Stream(self._messages[message_id], interval_ns, due_ns, interval_ns)

    def _first_ns(self) -> int | None:
        return min((stream.due_ns for stream in self._streams.values()), default=None)

    def operator(self, now_ns: int) -> None:
        for message_id, interval_ns in _OPERATORS.items():
            stream = self._streams.get(message_id)
            if stream is None:
                self._begin(message_id, interval_ns, now_ns + self._phase_ns % interval_ns)
            elif stream.usual_ns > interval_ns:
                stream.interval_ns = stream.usual_ns = interval_ns
                stream.due_ns = min(stream.due_ns, now_ns + interval_ns)
        self._due_ns = self._first_ns()

    def set_interval(self, message_id: int, interval_ns: int | None, now_ns: int) -> bool:
        """Change how often a message is sent; None: as usual, negative: never. False for one that is never sent."""
        if message_id not in self._messages:
            return False
        stream = self._streams.get(message_id)
        usual_ns = stream.usual_ns if stream else 0
        wanted_ns = usual_ns or _OPERATORS.get(message_id, -1) if interval_ns is None else interval_ns
        if wanted_ns < 0:
            self._streams.pop(message_id, None)
        else:
            wanted_ns = max(_FASTEST_NS, wanted_ns)
            self._begin(message_id, wanted_ns, now_ns + self._phase_ns % wanted_ns)
            self._streams[message_id].usual_ns = usual_ns or wanted_ns
        self._due_ns = self._first_ns()
        return True

    def interval_ns(self, message_id: int) -> int | None:
        """How often a message is sent: 0 for one that is not, None for one that cannot be."""
        stream = self._streams.get(message_id)
        return stream.interval_ns if stream else 0 if message_id in self._messages else None

    def one(self, message_id: int, now_ns: int, *, over_air: bool = False) -> bytes | None:
        """One message now; None for one that is never sent."""
        encode = (self._over_air if over_air else self._messages).get(message_id)
        return None if encode is None else encode(now_ns) or None

    def _landed(self) -> int:
        flown = self.flown
        if flown.on_ground:
            return int(common.MAV_LANDED_STATE_ON_GROUND)
        landed = {Mode.TAKEOFF: common.MAV_LANDED_STATE_TAKEOFF, Mode.LAND: common.MAV_LANDED_STATE_LANDING}
        return int(landed.get(flown.mode, common.MAV_LANDED_STATE_IN_AIR))

    def start(self, now_ns: int) -> None:
        for stream in self._streams.values():
            stream.due_ns += max(0, -((stream.due_ns - now_ns) // stream.interval_ns)) * stream.interval_ns
        self._due_ns = self._first_ns()

    # --- in -------------------------------------------------------------------------------------------------------

    def fix(self, gps: Gps) -> None:
        """A fix; acceleration is the change of velocity since the last one. An older fix is ignored."""
        if self._fix_ns is not None:
            if gps.t_ns <= self._fix_ns:
                return
            per_s = S / (gps.t_ns - self._fix_ns)
            change = gps.velocity.minus(self.velocity)
            self._acceleration = Enu(change.east * per_s, change.north * per_s, change.up * per_s)
        self.position, self.velocity, self._fix_ns = gps.position, gps.velocity, gps.t_ns
        if self._flight is not None and gps.t_ns - self._flight.t_ns > _FIX_LASTS_NS:
            self._flight = None
        if self._flight is None and gps.velocity.horizontal() >= TURNING_M_S:
            self.yaw = math.atan2(gps.velocity.east, gps.velocity.north)

    def face(self, yaw: float) -> None:
        """Turn a UAV that hovers: the vehicles of the world have no heading of their own, so this is told alone."""
        if self.velocity.horizontal() < TURNING_M_S:
            self.yaw = math.remainder(yaw, math.tau)

    def on_flight(self, reading: FlightState) -> None:
        angles = (reading.roll_rad, reading.pitch_rad, reading.yaw_rad)
        roll, pitch, yaw = (math.remainder(angle, math.tau) for angle in angles)
        self._flight = reading._replace(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
        self.yaw = yaw

    def on_wind(self, reading: WindEstimate) -> None:
        self._wind = reading.velocity

    def on_battery(self, reading: Battery) -> None:
        """The sensor of the battery has given a reading; consumption counts from the first reading."""
        if self._read_ns is not None:
            self._consumed_mah += max(0, reading.t_ns - self._read_ns) / _HOUR_NS * 1000 * reading.current_a
        self._read_ns = reading.t_ns
        percent = math.ceil(100 * min(1.0, max(0.0, reading.charge)))
        self._battery = BatteryState(reading.voltage_v, reading.current_a, round(self._consumed_mah), percent)

    # --- out ------------------------------------------------------------------------------------------------------

    @property
    def attitude(self) -> Attitude:
        """That of the flight controller, or the tilt that acceleration and drag need, facing the flight."""
        if self._flight is not None:
            return Attitude(self._flight.roll_rad, self._flight.pitch_rad, self._flight.yaw_rad)
        air = self._airflow
        drag = DRAG_PER_S + DRAG_PER_M * air.norm()
        east, north, up = (a + drag * v for a, v in zip(self._acceleration, (air.east, air.north, 0.0), strict=True))
        yaw = self.yaw or 0.0
        forward = east * math.sin(yaw) + north * math.cos(yaw)
        right = east * math.cos(yaw) - north * math.sin(yaw)
        thrust_up = max(GRAVITY_M_S2 + up, 0.1 * GRAVITY_M_S2)  # propellers push only one way
        wanted, most = math.hypot(forward, right), thrust_up * math.tan(MAX_TILT)
        if wanted > most:
            forward, right = forward * most / wanted, right * most / wanted
        pitch = math.atan2(-forward, thrust_up)
        roll = math.atan2(right, math.hypot(forward, thrust_up))
        return Attitude(roll, pitch, yaw)

    @property
    def _airflow(self) -> Enu:
        return self.velocity.minus(self._wind)

    def next_due_ns(self) -> int | None:
        return self._due_ns

    def telemetry(self, now_ns: int) -> bytes:
        """The frames that are due now: one of each stream, however late, because older telemetry is of no use."""
        if self._due_ns is None or now_ns < self._due_ns:
            return b""
        due = [stream for stream in self._streams.values() if stream.due_ns <= now_ns]
        for stream in due:
            stream.due_ns += ((now_ns - stream.due_ns) // stream.interval_ns + 1) * stream.interval_ns
        self._due_ns = self._first_ns()
        return b"".join(stream.encode(now_ns) for stream in due)

    def beacon_frames(self, now_ns: int) -> bytes:
        return self._beacons.heartbeat() + self._position(self._beacons, now_ns)

    def _global_position(self, encoder: Encoder, now_ns: int) -> bytes:
        return encoder.global_position(
            self._estimate, self.velocity, yaw=self.yaw, now_ns=now_ns, home_m=self.flown.home.up
        )

    def _position(self, encoder: Encoder, now_ns: int) -> bytes:
        return encoder.global_position(self.position, self.velocity, yaw=self.yaw, now_ns=now_ns)

    @property
    def _estimate(self) -> Enu:
        """Where the flight controller believes to be."""
        return self.position._replace(up=self.position.up - self.height_off_m)

    def _find(self, encoder: Encoder) -> bytes:
        """The next of the survivors; nothing if there are none."""
        if not self.finds:
            return b""
        self._shown_find = min((one for one in self.finds if one > self._shown_find), default=min(self.finds))
        return encoder.survivor(self._shown_find, self.finds[self._shown_find])

    def _gps_raw(self, encoder: Encoder, now_ns: int) -> bytes:
        fix_ns = now_ns if self._fix_ns is None else self._fix_ns
        satellites, hdop = (255, None) if self._flight is None else (self._flight.satellites, self._flight.hdop)
        return encoder.gps_raw(
            self.position,
            self.velocity,
            has_fix=self._has_fix(now_ns),
            fix_ns=fix_ns,
            satellites=satellites,
            hdop=hdop,
        )

    def _has_fix(self, now_ns: int) -> bool:
        return self._fix_ns is not None and now_ns - self._fix_ns < _FIX_LASTS_NS

    def _unix_ns(self, now_ns: int) -> int:
        flight = self._flight
        return flight.unix_ns + now_ns - flight.t_ns if flight is not None and flight.unix_ns else 0


class Telemetry(Application):
    """Sends the telemetry frames of one UAV at their rates."""

    name: Final = "telemetry"

    def __init__(self, streams: TelemetryStreams) -> None:
        self._streams = streams

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        self._streams.start(now_ns)

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, Battery):
            self._streams.on_battery(reading)
        elif isinstance(reading, WindEstimate):
            self._streams.on_wind(reading)
        elif isinstance(reading, FlightState):
            self._streams.on_flight(reading)

    def wake(self, now_ns: int) -> None:
        frames = self._streams.telemetry(now_ns)
        if frames:
            self.port.tap(frames)

    def next_wake_ns(self) -> int | None:
        return self._streams.next_due_ns()

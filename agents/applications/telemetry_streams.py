"""MAVLink telemetry of one UAV: the streams of messages that its flight controller would send, at their rates. Sans-IO.

Position and velocity are those of the receiver. The attitude is inferred: a multirotor tilts so that thrust and gravity
add up to its acceleration, and it faces where it flies. The battery is as its sensor reads it; without a sensor nothing
is known of it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from fanet_mw.bus.messages import Battery, Gps
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, ORIGIN, Attitude, BatteryState, Encoder, Geodetic
from fanet_mw.units import STILL, Enu, NodeId, S

GRAVITY_M_S2: Final = 9.80665
MAX_TILT: Final = math.radians(35)
"""The usual tilt limit of a multirotor's position controller; it keeps noise in the velocity from looking like
acrobatics."""
TURNING_M_S: Final = 0.5
"""Below this speed the course is noise, and the heading is kept."""

_HOUR_NS: Final = 3600 * S

# No stream comes more often than this; `telemetry_hz` also bounds each stream, and sets the rate of the position.
_EVERY_NS: Final = 1 * S
_SELDOM_NS: Final = 5 * S
_RARELY_NS: Final = 10 * S


@dataclass
class _Stream:
    """One kind of message, its interval, and the instant at which it is next due."""

    encode: Callable[[int], bytes]
    interval_ns: int
    due_ns: int


class TelemetryStreams:
    """The telemetry of one UAV."""

    def __init__(self, node: NodeId, *, position: Enu, telemetry_hz: float, origin: Geodetic = ORIGIN) -> None:
        self.position = position
        self.velocity = STILL
        self._home = position
        self._acceleration = STILL
        self._yaw: float | None = None
        """The heading; it is unknown until the UAV has flown. A heading of 0 would also shorten hellos, because MAVLink
        drops trailing zeros."""
        self._fix_ns: int | None = None
        self._battery: BatteryState | None = None
        self._read_ns: int | None = None
        self._consumed_mah = 0.0
        self._encoder = Encoder(node, component=AUTOPILOT_COMPONENT, origin=origin)
        self._beacons = Encoder(node, component=AUTOPILOT_COMPONENT, origin=origin)
        """The encoder of frames for the air. It counts them apart from telemetry, so that a gap in their numbers is a
        loss."""
        self._streams = self._plan(node, telemetry_hz) if telemetry_hz else []
        self._due_ns = min((stream.due_ns for stream in self._streams), default=None)

    def _plan(self, node: NodeId, telemetry_hz: float) -> list[_Stream]:
        """The streams in the order of sending. Their phases depend on the node's id, so that not all nodes send at
        once.
        """
        encoder = self._encoder
        base_ns = max(1, round(S / telemetry_hz))
        due_ns = node * 7_919_000 % base_ns
        wanted: list[tuple[int, Callable[[int], bytes]]] = [
            (_EVERY_NS, lambda _: encoder.heartbeat()),
            (0, self._global_position),
            (_EVERY_NS, lambda now_ns: encoder.attitude(self.attitude, now_ns=now_ns)),
            (_EVERY_NS, self._gps_raw),
            (_EVERY_NS, lambda _: encoder.extended_sys_state()),
            (_SELDOM_NS, lambda _: encoder.sys_status(self._battery)),
            (_RARELY_NS, lambda _: encoder.battery_status(self._battery)),
            (_RARELY_NS, lambda _: encoder.home_position(self._home)),
        ]
        return [_Stream(encode, max(interval_ns, base_ns), due_ns) for interval_ns, encode in wanted]

    def start(self, now_ns: int) -> None:
        """Begin telemetry now, in this node's phase."""
        for stream in self._streams:
            stream.due_ns += max(0, -((stream.due_ns - now_ns) // stream.interval_ns)) * stream.interval_ns
        self._due_ns = min((stream.due_ns for stream in self._streams), default=None)

    # --- in -------------------------------------------------------------------------------------------------------

    def fix(self, gps: Gps) -> None:
        """The receiver has given a fix; the acceleration is the change of velocity since the last one. An older fix is
        ignored.
        """
        if self._fix_ns is not None:
            if gps.t_ns <= self._fix_ns:
                return
            per_s = S / (gps.t_ns - self._fix_ns)
            change = gps.velocity.minus(self.velocity)
            self._acceleration = Enu(change.east * per_s, change.north * per_s, change.up * per_s)
        self.position, self.velocity, self._fix_ns = gps.position, gps.velocity, gps.t_ns
        if gps.velocity.horizontal() >= TURNING_M_S:
            self._yaw = math.atan2(gps.velocity.east, gps.velocity.north)

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
        """The tilt that the present acceleration needs, facing the direction of flight."""
        east, north, up = self._acceleration
        yaw = self._yaw or 0.0
        forward = east * math.sin(yaw) + north * math.cos(yaw)
        right = east * math.cos(yaw) - north * math.sin(yaw)
        thrust_up = max(GRAVITY_M_S2 + up, 0.1 * GRAVITY_M_S2)  # propellers push only one way
        wanted, most = math.hypot(forward, right), thrust_up * math.tan(MAX_TILT)
        if wanted > most:
            forward, right = forward * most / wanted, right * most / wanted
        pitch = math.atan2(-forward, thrust_up)
        roll = math.atan2(right, math.hypot(forward, thrust_up))
        return Attitude(roll, pitch, yaw)

    def next_due_ns(self) -> int | None:
        """The instant at which the next telemetry is due; None if there is no telemetry."""
        return self._due_ns

    def telemetry(self, now_ns: int) -> bytes:
        """The frames that are due now: one of each stream, however late, because older telemetry is of no use."""
        if self._due_ns is None or now_ns < self._due_ns:
            return b""
        due = [stream for stream in self._streams if stream.due_ns <= now_ns]
        for stream in due:
            stream.due_ns += ((now_ns - stream.due_ns) // stream.interval_ns + 1) * stream.interval_ns
        self._due_ns = min(stream.due_ns for stream in self._streams)
        return b"".join(stream.encode(now_ns) for stream in due)

    def beacon_frames(self, now_ns: int) -> bytes:
        """The inner frames of a position beacon."""
        return self._beacons.heartbeat() + self._position(self._beacons, now_ns)

    def _global_position(self, now_ns: int) -> bytes:
        return self._position(self._encoder, now_ns)

    def _position(self, encoder: Encoder, now_ns: int) -> bytes:
        return encoder.global_position(self.position, self.velocity, yaw=self._yaw, now_ns=now_ns)

    def _gps_raw(self, now_ns: int) -> bytes:
        fix_ns = now_ns if self._fix_ns is None else self._fix_ns
        return self._encoder.gps_raw(self.position, self.velocity, has_fix=self._fix_ns is not None, fix_ns=fix_ns)

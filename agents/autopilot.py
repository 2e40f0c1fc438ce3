"""What a flight controller says of itself: the last fix, and telemetry frames at their rates. Sans-IO."""

import math

from fanet_mw.mavlink import Encoder
from fanet_mw.messages import Gps
from fanet_mw.units import Enu, NodeId, S

_GRAVITY = 9.81
_STILL = Enu(0.0, 0.0, 0.0)
_ENDURANCE_NS = 25 * 60 * S
"""A small multirotor's flight time; the battery is taken to empty evenly over it."""


class Autopilot:
    """One UAV's flight controller, as seen over MAVLink."""

    def __init__(self, node: NodeId, *, position: Enu, telemetry_hz: float) -> None:
        self.position = position
        self.velocity = _STILL
        self._acceleration = _STILL
        self._fix_ns = 0
        self._encoder = Encoder(node)
        self._interval_ns = round(S / telemetry_hz) if telemetry_hz else 0
        self._due_ns: int | None = node * 7_919_000 % self._interval_ns if self._interval_ns else None
        """Nodes are out of step by their id, so that taps do not come in bursts."""

    def fix(self, gps: Gps) -> None:
        """A position fix; the acceleration is what changed the velocity since the last one."""
        elapsed_s = (gps.t_ns - self._fix_ns) / S
        if elapsed_s > 0:
            change = gps.velocity.minus(self.velocity)
            self._acceleration = Enu(*(component / elapsed_s for component in change))
        self.position, self.velocity, self._fix_ns = gps.position, gps.velocity, gps.t_ns

    def next_due_ns(self) -> int | None:
        """When telemetry is due; None when there is none."""
        return self._due_ns

    def telemetry(self, now_ns: int) -> bytes:
        """The frames that are due now."""
        if self._due_ns is None or now_ns < self._due_ns:
            return b""
        self._due_ns += self._interval_ns
        pitch = math.atan2(-self._acceleration.north, _GRAVITY)
        roll = math.atan2(self._acceleration.east, _GRAVITY)
        yaw = math.atan2(self.velocity.east, self.velocity.north)
        battery = max(0, 100 - 100 * now_ns // _ENDURANCE_NS)
        return (
            self.beacon_frames(now_ns)
            + self._encoder.attitude(roll=roll, pitch=pitch, yaw=yaw, now_ns=now_ns)
            + self._encoder.sys_status(battery_percent=battery, load=0.0)
        )

    def beacon_frames(self, now_ns: int) -> bytes:
        """The inner frames of a position beacon."""
        position = self._encoder.global_position(self.position, self.velocity, now_ns=now_ns)
        return self._encoder.heartbeat() + position

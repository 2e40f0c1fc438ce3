"""Runs the links to flight controllers on asyncio: a UAV's computer beside one, or a world that consists of many."""

import asyncio
from array import array
from collections.abc import Callable, Mapping
from typing import Final

from fanet_mw.autopilot.link import AutopilotLink, Reading
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Battery, FlightState, Gps, Poses, Setpoint, TraceBatch
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.errors import MalformedFrameError
from fanet_mw.gateway.connections import Address, Connection
from fanet_mw.hosts.bus import HostBus, OnSample
from fanet_mw.hosts.timebase import THIS_MACHINE
from fanet_mw.trace import Posed
from fanet_mw.units import MS, STILL, Enu, NodeId, S

_TICK_S: Final = 0.05
_POSE_EVERY: Final = 2
"""Ticks between two reports of all positions."""
_SENSORS: Final = {Gps: "gps", Battery: "battery", FlightState: "flight"}
_CLOCK_OFF_NS: Final = S
"""A computer whose clock differs by more from its flight controller's GPS is told so."""
Tell = Callable[[str], None]


class Autopilot:
    """One flight controller with its connection."""

    def __init__(
        self,
        name: str,
        link: AutopilotLink,
        address: Address,
        *,
        now_ns: Callable[[], int],
        tell: Tell,
        hears: Callable[[], bool] = lambda: True,
    ) -> None:
        """`hears`: False before the swarm's clock runs, when there is no instant to which a reading would belong."""
        self.link = link
        self._name, self._now_ns, self._tell, self._hears = name, now_ns, tell, hears
        self._clock_off = False
        self.connection = Connection(address, lambda _, data: self._hear(data))

    def _hear(self, data: bytes) -> bytes:
        if self._hears():
            self.link.on_bytes(data, self._now_ns())
        return b""

    def tick(self) -> list[Reading]:
        """Send what is due; returns what has been read since the last tick."""
        link = self.link
        link.wake(self._now_ns())
        if link.out:
            out, link.out = link.out, b""
            self.connection.send(out)
        events, link.events = link.events, []
        for event in events:
            self._tell(f"{self._name}: {event}")
        self._compare_clocks()
        readings, link.readings = link.readings, []
        return readings

    def _compare_clocks(self) -> None:
        """Say how far the computer's clock is from GPS, when that begins or ends to matter."""
        if self.link.unix_off_ns is None:
            return
        behind_ns = self._now_ns() + self.link.unix_off_ns - THIS_MACHINE.unix_ns()
        self.link.counts["clock_behind_gps_ms"] = round(behind_ns / MS)
        is_off = abs(behind_ns) > _CLOCK_OFF_NS
        if is_off != self._clock_off:
            self._clock_off = is_off
            how = f"differs by {behind_ns / S:+.1f} s from" if is_off else "agrees with"
            self._tell(f"{self._name}: this computer's clock {how} the flight controller's GPS")


def _setpoints(payload: bytes, link: AutopilotLink) -> list[Setpoint]:
    """The setpoints of one put; one that is malformed has none, and is counted."""
    try:
        return [message for message in codecs.decode(payload) if isinstance(message, Setpoint)]
    except MalformedFrameError:
        link.counts["setpoints_malformed"] += 1
        return []


class AutopilotBus:
    """A bus for one UAV's host, whose sensors and flight controller are at the end of a MAVLink connection."""

    def __init__(self, inner: HostBus, names: Topics, node: NodeId) -> None:
        self._inner = inner
        self._sensors = names.sensors(node)
        self._setpoint = names.setpoint(node)
        self._topics = {kind: names.sensor(node, name) for kind, name in _SENSORS.items()}
        self._on_sensor: OnSample | None = None
        self.autopilot: Autopilot | None = None

    def subscribe(self, expression: str, on_sample: OnSample) -> None:
        if expression == self._sensors:
            self._on_sensor = on_sample
        else:
            self._inner.subscribe(expression, on_sample)

    def put(self, topic: str, payload: bytes, *, reliable: bool = False) -> None:
        if topic != self._setpoint or self.autopilot is None:
            self._inner.put(topic, payload, reliable=reliable)
            return
        for setpoint in _setpoints(payload, self.autopilot.link):
            self.autopilot.link.command(setpoint, setpoint.t_ns)

    def announce(self, topic: str) -> None:
        self._inner.announce(topic)

    def ask(self, topic: str, on_sample: OnSample) -> None:
        self._inner.ask(topic, on_sample)

    def check(self) -> None:
        self._inner.check()

    async def serve(self, autopilot: Autopilot, running: Callable[[], bool]) -> None:
        """Pass on what the flight controller says, as readings of sensors; `running`: the clock of the swarm runs."""
        self.autopilot = autopilot
        await autopilot.connection.open()
        try:
            while True:
                if running():
                    for reading in autopilot.tick():
                        if self._on_sensor is not None:
                            self._on_sensor(self._topics[type(reading)], codecs.encode([reading]))
                await asyncio.sleep(_TICK_S)
        finally:
            autopilot.connection.close()


async def serve_world(
    bus: HostBus,
    names: Topics,
    autopilots: Mapping[NodeId, Autopilot],
    standing: Mapping[NodeId, Enu],
    *,
    now_ns: Callable[[], int],
) -> None:
    """Play the world of a swarm flown by flight controllers; `standing`: nodes that are no UAVs, and where they are."""

    def on_setpoint(topic: str, payload: bytes) -> None:
        autopilot = autopilots.get(NodeId(node_of(topic)))
        if autopilot is not None:
            for setpoint in _setpoints(payload, autopilot.link):
                loop.call_soon_threadsafe(autopilot.link.command, setpoint, now_ns())

    loop = asyncio.get_running_loop()
    bus.subscribe(names.all_setpoints, on_setpoint)
    ticks, recorded_s = 0, 0
    while True:
        for node, autopilot in autopilots.items():
            for reading in autopilot.tick():
                bus.put(names.sensor(node, _SENSORS[type(reading)]), codecs.encode([reading]))
        if ticks % _POSE_EVERY == 0:
            known = {node: (a.link.position, a.link.velocity) for node, a in autopilots.items() if a.link.position}
            known |= {node: (place, STILL) for node, place in standing.items()}
            states = array("d", [part for _, (at, moves) in sorted(known.items()) for part in (*at, *moves)])
            bus.put(names.pose, codecs.encode([Poses(now_ns(), array("H", sorted(known)), states)]))
            if now_ns() // S > recorded_s:
                recorded_s = now_ns() // S
                posed = tuple(
                    Posed(now_ns(), node, *(round(part, 2) for part in at)) for node, (at, _) in known.items()
                )
                bus.put(names.trace("world"), codecs.encode([TraceBatch(posed)]), reliable=True)
            for node, place in standing.items():
                bus.put(names.sensor(node, "gps"), codecs.encode([Gps(now_ns(), place, STILL)]))
        ticks += 1
        bus.check()
        await asyncio.sleep(_TICK_S)

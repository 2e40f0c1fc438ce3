"""The telemetry application: it shows the flight controller's messages on the node's MAVLink tap."""

from typing import Final

from agents.applications.telemetry_streams import TelemetryStreams
from fanet_mw.application import Application, AppPort
from fanet_mw.bus.messages import Battery, SensorReading


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

    def wake(self, now_ns: int) -> None:
        frames = self._streams.telemetry(now_ns)
        if frames:
            self.port.tap(frames)

    def next_wake_ns(self) -> int | None:
        return self._streams.next_due_ns()

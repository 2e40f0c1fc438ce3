"""All sensors that UAVs carry in a scenario, each read when it is due."""

from collections.abc import Iterator, Sequence

from fanet_mw.bus.messages import Battery, Message
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.routing import PROTOCOLS
from fanet_mw.units import S
from sim.world.arrays import Flags
from sim.world.engines.battery_drain import BatteryDrain
from sim.world.engines.contract import Engine
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.sensors.altimeter import AltimeterSensor
from sim.world.sensors.camera import CameraSensor, ImageSensor
from sim.world.sensors.contract import Sensor, Truth
from sim.world.sensors.gps import GpsReceiver, PostReceiver
from sim.world.sensors.inertial import InertialSensor
from sim.world.sensors.pad import PadSensor
from sim.world.sensors.phone import PhoneSensor
from sim.world.sensors.radar import RadarSensor
from sim.world.sensors.voice import VoiceSensor
from sim.world.sensors.wind import WindSensor


class BatterySensor(Sensor):
    """One power module per UAV."""

    kind = "battery"

    def __init__(self, scenario: Scenario, drain: BatteryDrain) -> None:
        self.period_ns = round(S / scenario.sensors.battery_hz)
        self._batteries = drain.batteries

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        batteries = self._batteries
        for row in rows:
            yield (
                row,
                Battery(
                    truth.now_ns,
                    float(batteries.voltage_v[row]),
                    float(batteries.current_a[row]),
                    float(batteries.charge[row]),
                ),
            )


def sensors_of(
    scenario: Scenario,
    survivors: Survivors,
    solids: Solids,
    drain: BatteryDrain | None = None,
    obstacles: Obstacles | None = None,
    gps: GpsReceiver | None = None,
    engine: Engine | None = None,
) -> list[Sensor]:
    """The sensors that a scenario asks for, in the order of their readings. `drain`: None without batteries;
    `obstacles`: those of `solids`, for rendered images; `gps`: which flight controllers use, too; `engine`: for its
    air.
    """
    config = scenario.sensors
    found: list[Sensor] = []
    if uses_fixes(scenario):
        found.append(gps or GpsReceiver(scenario))
    if scenario.mission.survivors:
        found.append(PhoneSensor(scenario, survivors))
    if config.camera_hz and scenario.mission.survivors:
        found.append(CameraSensor(scenario, survivors, solids))
    if config.image_hz:
        found.append(ImageSensor(scenario, survivors, obstacles))
    if config.voice_hz and scenario.mission.survivors:
        found.append(VoiceSensor(scenario, survivors, solids))
    if config.radar_hz:
        found.append(RadarSensor(scenario, solids))
    if config.altimeter_hz:
        found.append(AltimeterSensor(scenario, solids))
    if config.inertial_hz:
        found.append(InertialSensor(scenario))
    if config.battery_hz and drain is not None:
        found.append(BatterySensor(scenario, drain))
    if config.wind_hz and engine is not None:
        found.append(WindSensor(scenario, engine))
    if config.pad_hz and scenario.nodes.on_ground:
        found.append(PadSensor(scenario))
    return found


def uses_fixes(scenario: Scenario) -> bool:
    """True if any application uses position fixes."""
    moves = scenario.mobility.model != "static"
    protocol = scenario.routing.protocol
    by_places = protocol == "geographic" or (protocol in ("clustered", "rounds") and moves) or protocol not in PROTOCOLS
    return (
        scenario.nodes.telemetry_hz > 0
        or scenario.clock.sync == "gps"
        or scenario.mission.collision_horizon_s > 0
        or scenario.mission.survivors > 0
        or by_places
    )


class Suite:
    """The sensors of a swarm and the topics of their readings."""

    def __init__(self, scenario: Scenario, sensors: list[Sensor], topics: Topics) -> None:
        self._sensors = [
            (sensor, [topics.sensor(node, sensor.kind) for node in scenario.uav_ids]) for sensor in sensors
        ]
        self._count = scenario.nodes.count
        self._post: tuple[str, PostReceiver] | None = None
        if scenario.post is not None and scenario.clock.sync == "gps":
            receiver = PostReceiver(scenario, positions(scenario)[-1])
            self._post = topics.sensor(scenario.post, GpsReceiver.kind), receiver

    @property
    def shortest_ns(self) -> int:
        """The shortest period of all sensors but GPS."""
        return min((sensor.period_ns for sensor, _ in self._sensors if sensor.kind != "gps"), default=S)

    def readings(self, truth: Truth, alive: Flags, *, before_ns: int) -> Iterator[tuple[str, Message]]:
        """The topics and readings of all instants in (before, now], for UAVs that are `alive`, and for the post."""
        for sensor, topics in self._sensors:
            rows = [row for row in sensor.due(self._count, now_ns=truth.now_ns, before_ns=before_ns) if alive[row]]
            if rows:
                for row, reading in sensor.read(truth, rows):
                    yield topics[row], reading
        if self._post is not None:
            topic, receiver = self._post
            for fix in receiver.readings(truth.now_ns, before_ns=before_ns):
                yield topic, fix

    def close(self) -> None:
        """Close all sensors; a second call does nothing."""
        for sensor, _ in self._sensors:
            sensor.close()

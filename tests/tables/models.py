"""What models of the world, of sensors and of the air say, beside the published value or law of each."""

import math
from array import array
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from emulator.channel.error_rate import log_success_per_bit
from emulator.channel.link_budget import received_dbm
from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from emulator.channel.shadowing import Shadowing
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB
from emulator.medium import Medium
from fanet_mw.bus.messages import Poses, Radar, Reception, Setpoint, SetpointKind, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.radio_control import Jam, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Radio, Scenario, config
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from sim.scenarios import catalog
from sim.world.arrays import Rows as Places
from sim.world.engines.contract import GRAVITY_M_S2, Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.pybullet import Physics
from sim.world.engines.rotors.power import induced_m_s, trimmed_w
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import AIR_KG_M3, CRAZYFLIE, IRIS
from sim.world.environment.line_of_sight import knife_edge_db
from sim.world.environment.obstacles import Hills, Obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.environment.wind import Wind
from sim.world.sensors.altimeter import AltimeterSensor
from sim.world.sensors.camera import CameraSensor, recognized_share
from sim.world.sensors.contract import Truth
from sim.world.sensors.gps import GpsReceiver
from sim.world.sensors.phone import PhoneSensor
from sim.world.sensors.radar import RadarSensor
from sim.world.sensors.voice import level_db
from sim.world.world import WorldActor
from tests.tables.markdown import Rows

_NAMES: Final = Topics("models")
_PLAIN: Final = Solids(None)
_STEP_S: Final = 0.05


class Row(NamedTuple):
    """One figure: its source, what that says, and what the model gives."""

    what: str
    source: str
    published: str
    here: str


def measured() -> Rows:
    """All of them."""
    rows = [*_ground(), *_contacts(), *_flight(), *_sensors(), *_losses(), *_fading(), *_access()]
    return [["figure", "source", "published", "here"], *([*row] for row in rows)]


def _near(value: float, digits: int = 1) -> str:
    return f"{value:.{digits}f}"


def _drawn(*names: int) -> np.random.Generator:
    return np.random.default_rng([*names, 20])


# --- the world --------------------------------------------------------------------------------------------------------


def _ground() -> Iterator[Row]:
    import pybullet

    worst = {"rays": 0.0, "the mesh of pybullet": 0.0}
    for seed in range(6):
        random = _drawn(1, seed)
        hills = Hills(random.uniform(0, 40, (10, 10)), 17.0)
        solid = Obstacles(hills, ())
        at = random.uniform([-110, -110, 0], [110, 110, 0], (300, 3))
        ground, top = Solids(solid).ground_m(at), at + np.array([0.0, 0, 60])
        ray = 60 - Solids(solid).first_hit_m(top, np.tile([0.0, 0, -1], (300, 1)), 100.0)
        engine = Physics(physics_hz=240, obstacles=solid)
        engine.reset(np.array([[0.0, 0, 500]]))
        hits = pybullet.rayTestBatch(top.tolist(), (at - [0, 0, 1]).tolist(), physicsClientId=engine._client)
        engine.close()
        for name, found in (("rays", ray), ("the mesh of pybullet", np.array([hit[3][2] for hit in hits]))):
            worst[name] = max(worst[name], float(np.abs(found - ground).max()))
    for name, off_m in worst.items():
        yield Row(f"height of random hills by {name}, off by at most [m]", "one ground", "0", _near(off_m, 2))


def _engine(name: str) -> Engine:
    return Physics(physics_hz=240) if name == "pybullet" else Kinematic() if name == "kinematic" else Rotors(IRIS)


def _contacts() -> Iterator[Row]:
    yield Row("reach of the blades of an Iris [m]", "0.256 m to a rotor, propellers of 10 inches", "0.383",
              _near(IRIS.reach_m, 3))  # fmt: skip
    for name in ("kinematic", "rotors", "pybullet"):
        true = seen = 0
        for speed in (5.0, 15.0, 30.0):
            random, pairs = _drawn(2, round(speed)), 60
            away = random.normal(size=(pairs, 3)) * [1, 1, 0.3]
            velocity = speed * away / np.linalg.norm(away, axis=1)[:, None]
            aside = np.cross(velocity, random.normal(size=(pairs, 3)))
            off_m = random.uniform(0, 2 * IRIS.reach_m - 0.03, pairs)
            middle = np.column_stack([300.0 * np.arange(pairs), np.zeros(pairs), np.full(pairs, 900.0)])
            back = velocity * random.uniform(0.5, 0.6, (pairs, 1))
            there = middle + back + aside * (off_m / np.linalg.norm(aside, axis=1))[:, None]
            engine, twin, wanted = _engine(name), _engine(name), np.vstack([velocity, -velocity])
            for each in (engine, twin):
                each.reset(np.vstack([middle - back, there]), wanted)
            least_m = off_m if name == "pybullet" else np.full(pairs, math.inf)  # where bodies bounce
            for _ in range(24):
                engine.advance(_STEP_S, wanted)
                for _ in range(0 if name == "pybullet" else 10):
                    before = twin.positions()
                    twin.advance(_STEP_S / 10, wanted)
                    least_m = np.minimum(least_m, _least_m(before, twin.positions(), pairs))
            met = {a - 1 for a, b in engine.contacts() if b - a == pairs}
            touched = np.flatnonzero(least_m < 2 * IRIS.reach_m - 0.01).tolist()
            true += len(touched)
            seen += len(met & {*touched})
            for each in (engine, twin):
                if isinstance(each, Physics):
                    each.close()
        yield Row(f"head-on contacts at 5 to 30 m/s in any direction that `{name}` counts", "geometry", "1",
                  _near(seen / true, 3))  # fmt: skip


def _least_m(before: Places, after: Places, pairs: int) -> np.ndarray:
    """The least distance of each pair on a fine scan of a step."""
    share = np.linspace(0, 1, 21)[:, None, None]
    at = before + (after - before) * share
    return np.asarray(np.linalg.norm(at[:, :pairs] - at[:, pairs:], axis=2).min(axis=0))


def _flown(engine: Rotors, wanted: Sequence[float], seconds: float) -> Places:
    """Places and velocities of one UAV, every 50 ms."""
    rows = []
    for _ in range(round(seconds / _STEP_S)):
        engine.advance(_STEP_S, np.array([wanted]))
        rows.append(np.hstack([engine.positions()[0], engine.velocities()[0]]))
    return np.array(rows)


def _flight() -> Iterator[Row]:
    thrust, disc = np.array([3.7]), math.pi * IRIS.rotor_radius_m**2
    v = float(induced_m_s(thrust, np.array([12.0]), np.array([3.0]), disc_m2=disc)[0])
    yield Row("induced velocity times inflow, 12 m/s across, 3 m/s through [m2/s2]", "Glauert: T / (2 rho A)",
              _near(3.7 / (2 * AIR_KG_M3 * disc)), _near(v * math.hypot(12.0, 3.0 + v)))  # fmt: skip
    for speed, climb in ((25.0, 0.0), (0.0, 10.0)):
        engine = Rotors(IRIS._replace(tilt_deg=65.0))
        engine.reset(np.array([[0.0, 0, 50]]))
        _flown(engine, (speed, 0, climb), 25)
        reached = engine.velocities()[0]
        yield Row(f"Iris, {speed:g} m/s along, {climb:g} up: power by the table [W]", "that of the rotors flown",
                  _near(float(engine.power_w()[0]), 0),
                  _near(float(trimmed_w(IRIS, reached[:1], reached[2:])[0]), 0))  # fmt: skip
    engine = Rotors(IRIS)
    engine.reset(np.array([[0.0, 0, 50]]))
    cruise = _flown(engine, (15.0, 0, 0), 12)
    stop = _flown(engine, (0.0, 0, 0), 6)
    yield Row("Iris, speed after 12 s when 15 m/s are asked for [m/s]", "asked", "15.0", _near(cruise[-1, 3]))
    least_m = 15**2 / (2 * GRAVITY_M_S2 * math.tan(math.radians(IRIS.tilt_deg)))
    yield Row("Iris, way to a stop from 15 m/s [m]", "v^2 / (2 g tan 35) without drag", _near(least_m),
              _near(stop[:, 0].max() - cruise[-1, 0]))  # fmt: skip
    fallen = Rotors(CRAZYFLIE)
    fallen.reset(np.array([[0.0, 0, 900]]))
    fallen.fall(0)
    terminal = math.sqrt(2 * CRAZYFLIE.mass_kg * GRAVITY_M_S2 / (AIR_KG_M3 * 1.17 * 12e-4))
    yield Row("Crazyflie that falls [m/s]", "Hoerner: 12 cm2, drag coefficient 1.17", _near(terminal),
              _near(-_flown(fallen, (0.0, 0, 0), 15)[-1, 5]))  # fmt: skip
    wind = Wind(_drawn(3), 6000, mean_m_s=(7.0, 0.0), w20_m_s=9.0)
    gusts = wind.advance(0.05, np.full(6000, 30.0), np.zeros((6000, 3))) - [7.0, 0, 0]
    yield Row("gusts 30 m up, W20 = 9 m/s: along, upwards, standard deviation [m/s]", "MIL-F-8785C",
              f"{0.9 / (0.177 + 0.000823 * 30 / 0.3048) ** 0.4:.2f}, 0.90",
              f"{gusts[:, 0].std():.2f}, {gusts[:, 2].std():.2f}")  # fmt: skip


# --- sensors ----------------------------------------------------------------------------------------------------------


def _scenario(*keys: str, nodes: int = 3) -> Scenario:
    given = [f"nodes.count={nodes}", "clusters.count=1", "mission.survivors=8", "world.area_m=400", "seed=77"]
    return catalog.find("quick", [*given, *keys])


def _sensors() -> Iterator[Row]:
    off, still = [], np.zeros((2, 3))
    averaged, late = [], []
    for seed in range(200):
        receiver = GpsReceiver(_scenario(f"seed={1000 + seed}", nodes=2))
        fixes = np.array([receiver.fixes(Truth(s * S, still, still))[0] for s in (*range(11), 611)])
        off.append(fixes[0])
        averaged.append(fixes[:11, 0, 0].mean())
        late += [(fixes[0, 0, axis], fixes[11, 0, axis]) for axis in (0, 1)]
    errors = np.array(off)
    sideways = np.hypot(errors[:, 0, 0], errors[:, 0, 1])
    yield Row("GPS: half of all fixes are nearer than [m]", "u-blox NEO-M8, data sheet", "2.5",
              _near(float(np.median(sideways))))  # fmt: skip
    ratio = np.quantile(np.abs(errors[:, 0, 2]), 0.95) / np.quantile(sideways, 0.95)
    yield Row("GPS: upwards over sideways, 95 % each", "GPS SPS PS 2020: 13 m, 8 m", "1.6", _near(float(ratio)))
    yield Row("GPS: error of the mean of 10 s, one axis [m]", "slow errors stay", "2.1", _near(float(np.std(averaged))))
    first, second = np.array(late).T
    yield Row("GPS: correlation of errors 10 min apart", "Gauss-Markov, 1800 s and 300 s",
              _near((4 * math.exp(-1 / 3) + 0.36 * math.exp(-2)) / 4.45, 2),
              _near(float(np.corrcoef(first, second)[0, 1]), 2))  # fmt: skip
    misses = [_missed_m(seed) for seed in range(16)]
    yield Row("UAV sent to a place: misses it by, median [m]", "its GPS: 2.5", "2.5", _near(float(np.median(misses))))
    hovering = AltimeterSensor(_scenario("sensors.altimeter_hz=1", nodes=400), _PLAIN)
    high = np.tile([0.0, 0, 50], (400, 1))
    told = [reading.up_m - 50 for _, reading in hovering.read(Truth(0, high, high * 0), range(400))]  # type: ignore[union-attr]
    config_of = _scenario().sensors
    yield Row("barometer, standard deviation [m]", "drift and noise of `[sensors]`",
              _near(math.hypot(config_of.barometer_sigma_m, config_of.barometer_drift_m)),
              _near(float(np.std(told))))  # fmt: skip
    yield from _phones()
    yield from _camera_radar_voice()


def _missed_m(seed: int) -> float:
    world = WorldActor(_scenario("mission.survivors=0", 'mobility.model="onboard"', f"seed={seed}"), "models")
    world.start(0)
    order = Setpoint(0, Enu(90.0, 20.0, 40.0), 8.0, SetpointKind.POSITION, Enu(0.0, 0.0, 0.0))
    world.receive(_NAMES.setpoint(1), order, 0)
    at = [0.0] * 3
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= 45 * S:
        world.wake(wake_ns)
        for _, message in world.outbox:
            at = list(message.states[:3]) if isinstance(message, Poses) else at
        world.outbox.clear()
    return math.hypot(at[0] - 90.0, at[1] - 20.0)


def _phones() -> Iterator[Row]:
    sensor = PhoneSensor(_scenario("mission.shadowing_db=6"))
    places = _drawn(4).uniform(-20_000, 20_000, (1500, 3))
    for apart_m in (25.0, 100.0):
        first, second = (
            np.array([sensor._shadowing_db(np.arange(8), at) for at in places + np.array([0.0, shift, 0])]).ravel()
            for shift in (0.0, apart_m)
        )
        yield Row(f"phones: correlation of shadowing {apart_m:g} m apart", "Gudmundson 1991: exp(-d / 50 m)",
                  _near(math.exp(-apart_m / 50), 2), _near(float(np.corrcoef(first, second)[0, 1]), 2))  # fmt: skip
    power = 10 ** (PhoneSensor(_scenario("mission.rssi_sigma_db=0"))._reading_db(100_000) / 10)
    k = 10 ** (_scenario().mission.phone_rice_db / 10)
    yield Row("phones: deviation of a reading's power over its mean", "Rice: sqrt(1 + 2 K) / (1 + K)",
              _near(math.sqrt(1 + 2 * k) / (1 + k), 2), _near(float(power.std() / power.mean()), 2))  # fmt: skip


def _camera_radar_voice() -> Iterator[Row]:
    scenario = _scenario("sensors.camera_hz=1", "sensors.radar_hz=5", "sensors.radar_false_alarm=1e-9")
    cycles = scenario.sensors.camera_cycles
    yield Row("camera: share recognized at N50, at twice N50", "Johnson 1958; Ratches 1975: 0.5, 0.95", "0.50, 0.94",
              ", ".join(_near(float(recognized_share(np.array([2 * n * cycles]), cycles_for_half=cycles)[0]), 2)
                        for n in (1, 2)))  # fmt: skip
    camera, survivors = CameraSensor(scenario, Survivors(scenario), _PLAIN), Survivors(scenario)
    up = 90.0
    over = np.tile(survivors.places[0] + [0, 0, up], (3, 1))
    seen = sum(any(True for _ in camera.read(Truth(s * S, over, over * 0), [0])) for s in range(600))
    pixels = float(camera.pixels(np.array([up]))[0])
    share = float(recognized_share(np.array([pixels]), cycles_for_half=cycles)[0])
    yield Row("camera: a person below, 90 m: share of images", "the same at its pixels", _near(share, 2),
              _near(seen / 600, 2))  # fmt: skip
    for range_m in (50.0, 100.0):
        radar = RadarSensor(scenario, _PLAIN)
        at = np.array([[0.0, 0, 50], [range_m, 0, 50], [0, 5000, 50]])
        scans = [[*radar.read(Truth(s * S // 5, at, at * 0), [0])] for s in range(2000)]
        met = sum(any(isinstance(told, Radar) and told.echoes for _, told in scan) for scan in scans)
        snr = 10 ** ((scenario.sensors.radar_snr_db + 10 * math.log10(0.03) - 40 * math.log10(range_m / 100)) / 10)
        yield Row(f"radar: a UAV of 0.03 m2 at {range_m:g} m: share of scans", "Swerling 1: Pfa^(1 / (1 + SNR))",
                  _near(1e-9 ** (1 / (1 + snr)), 2), _near(met / 2000, 2))  # fmt: skip
    near, far = (float(level_db(np.array([m]), at_1_m_db=88.0)[0]) for m in (10.0, 20.0))
    yield Row("voice: 10 to 20 m [dB]", "sphere, and 5 dB/km (ISO 9613-1)", "-6.07", _near(far - near, 2))


# --- the air ----------------------------------------------------------------------------------------------------------


def _radio(**keys: object) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": keys}).radio


def _loss_db(distance_m: float, first_m: float, second_m: float, **keys: object) -> float:
    radio = _radio(**keys)
    here, there = np.array([[distance_m, 0, first_m]]), np.array([[0.0, 0, second_m]])
    return radio.tx_power_dbm - float(received_dbm(np.linalg.norm(here - there, axis=1), here, there, radio)[0])


def _losses() -> Iterator[Row]:
    wave_m = SPEED_OF_LIGHT_M_S / 5.18e9
    for name, source, published, here in (
        ("`friis`, 1 km, 5180 MHz", "P.525: 32.45 + 20 log f d", 32.45 + 20 * math.log10(5180),
         _loss_db(1000, 50, 50, channel="friis", frequency_mhz=5180)),
        ("`log_distance`, reference at 5180 MHz", "Friis at 1 m", 20 * math.log10(4 * math.pi / wave_m),
         _loss_db(1, 50, 50, channel="log_distance", frequency_mhz=5180)),
        ("`two_ray`, 3 km, 2 m and 1.5 m", "Rappaport 4.6", 40 * math.log10(3000) - 20 * math.log10(3),
         _loss_db(3000, 2, 1.5, channel="two_ray")),
        ("`air_to_ground`, urban, 30 degrees, 200 m, street level", "Al-Hourani 2014", 84.489 + 6.111,
         _loss_db(200 * math.cos(math.pi / 6), 100, 0, channel="air_to_ground", environment="urban",
                  frequency_mhz=2000)),
        ("`uma_av`, 1 km, UAV at 100 m, 2 GHz", "TR 36.777, B-1 and B-2", 0.85332 * 100.0206 + 0.14668 * 116.9625,
         _loss_db(math.sqrt(1e6 - 75**2), 100, 25, channel="uma_av", frequency_mhz=2000)),
    ):  # fmt: skip
        yield Row(f"{name}: loss [dB]", source, _near(published), _near(here))
    up = np.arange(1.0, 99.0, 0.1)
    steps = {}
    for channel in ("air_to_ground", "two_ray", "uma_av"):
        radio, other_m = _radio(channel=channel, environment="dense_urban"), 25.0 if channel == "uma_av" else 1.5
        low, high = np.tile([0.0, 0, other_m], (len(up), 1)), np.column_stack([0 * up + 150.0, 0 * up, up])
        power = received_dbm(np.linalg.norm(high - low, axis=1), high, low, radio)
        steps[channel] = float(np.abs(np.diff(power)).max())
    yield Row("greatest step of the loss while a UAV climbs 0.1 m, below 100 m [dB]", "no step", "0",
              _near(max(steps.values()), 2))  # fmt: skip
    nu = np.array([0.0, 1.0, 2.4])
    yield Row("knife edge, nu = 0, 1, 2.4 [dB]", "ITU-R P.526-15, figure 9", "6.0, 13.9, 20.5",
              ", ".join(_near(db) for db in knife_edge_db(nu).tolist()))  # fmt: skip
    keys, at = _radio(channel="friis", shadowing_db=6, shadowing_corr_m=50), np.zeros((2000, 3))
    at[:1000, 0], at[1000:, 1] = 5.0 * np.arange(1000), 5000.0
    pairs = np.column_stack([np.arange(1000), np.arange(1000, 2000)])
    drawn = [Shadowing(keys, seed=500 + seed).loss_db(at, pairs, np.full(1000, 5000.0)) for seed in range(24)]
    alike = np.mean([np.mean(s[:-10] * s[10:]) for s in drawn]) / 36
    yield Row("shadowing: correlation after 50 m of one end", "Gudmundson 1991", _near(math.exp(-1), 2),
              _near(float(alike), 2))  # fmt: skip
    half = {}
    for model in ("nist", "tables"):
        for rate in (6.0, 54.0):
            table = log_success_per_bit(rate, model)
            index = float(np.interp(math.log(0.5) / (8 * 1458), table, np.arange(len(table))))
            half[model, rate] = ERROR_FLOOR_DB + index / ERROR_STEPS_PER_DB
    yield Row("`tables`: SINR for half of 1,458 bytes at 6, 54 Mb/s [dB]", "ns-3.44, TableBasedErrorRateModel",
              "0.3, 17.5", ", ".join(_near(half["tables", rate]) for rate in (6.0, 54.0)))  # fmt: skip
    yield Row("`nist` needs more, at 6, 54 Mb/s [dB]", "ns-3.44, its two models", "3.1 to 5",
              ", ".join(_near(half["nist", rate] - half["tables", rate]) for rate in (6.0, 54.0)))  # fmt: skip


class _Air:
    """A medium with stations along a line, driven by hand."""

    def __init__(self, scenario: Scenario, east_m: Sequence[float], speed_m_s: float = 0.0) -> None:
        self.medium = Medium(scenario, "models")
        self.medium.start(0)
        states = [value for at in east_m for value in (at, 0.0, 50.0, 0.0, speed_m_s * (at == 0), 0.0)]
        ids = array("H", range(1, len(east_m) + 1))
        self.medium.receive(_NAMES.pose, Poses(0, ids, array("d", states)), 0)
        self._sent = 0

    def send(self, at_ns: int, *, dst: int = BROADCAST, size: int = 1024) -> None:
        request = TxRequest(self._sent, at_ns, bytes(size), NodeId(dst), wants_status=True)
        self._sent += 1
        self.medium.receive(_NAMES.radio_tx(1), request, at_ns - MS)

    def run(self, until_ns: int) -> list[object]:
        told: list[object] = []
        while (wake_ns := self.medium.next_wake_ns()) is not None and wake_ns <= until_ns:
            self.medium.wake(wake_ns)
        told += [message for _, message in self.medium.outbox]
        self.medium.outbox.clear()
        return told


def _on_air(*keys: str, nodes: int = 2) -> Scenario:
    return _scenario("mission.survivors=0", *keys, nodes=nodes)


_RAYLEIGH: Final = ("radio.channel=friis", "radio.fading=nakagami", "radio.nakagami_m=1", "radio.sensitivity_dbm=-80")


def _metres(margin_db: float) -> float:
    """Where 30 dBm have fallen in free space to -80 dBm and a margin."""
    return float(10 ** ((30 + 80 - margin_db - 20 * math.log10(4 * math.pi * 2.412e9 / SPEED_OF_LIGHT_M_S)) / 20))


def _fading() -> Iterator[Row]:
    air = _Air(_on_air(*_RAYLEIGH, "radio.scatterer_speed_m_s=900"), [0.0, _metres(-0.2)])
    for frame in range(3000):
        air.send((2 + 2 * frame) * MS, size=64)
        air.run((2 + 2 * frame) * MS)
    air.run(7000 * MS)
    copies = air.medium.report()["copies"]
    yield Row("Rayleigh, 0.2 dB below the sensitivity: share of copies that arrive", "exp(-threshold / mean)",
              _near(math.exp(-(10**0.02)), 2), _near(copies["received"] / copies["on_air"], 2))  # fmt: skip
    for speed, jakes in ((0.0, "0.61"), (1.0, "0.85"), (10.0, "0.99")):
        acked = 0
        for seed in range(300):
            air = _Air(_on_air(*_RAYLEIGH, f"seed={3000 + seed}"), [0.0, _metres(3.0)], speed)
            air.send(2 * MS, dst=2)
            acked += any(isinstance(m, TxStatus) and m.outcome is TxOutcome.ACKED for m in air.run(900 * MS))
        yield Row(f"Rayleigh, mean 3 dB above it, {speed:g} m/s: unicasts in seven attempts",
                  "Jakes' model at such instants (1974)", jakes, _near(acked / 300, 2))  # fmt: skip


def _access() -> Iterator[Row]:
    for rate, km in ((1, 23.7), (11, 7.4)):
        air = _Air(_on_air("radio.channel=friis", f"radio.rate_mbps={rate}"), [0.0, 1000 * km])
        for frame in range(200):
            air.send((2 + 20 * frame) * MS)
        heard = sum(isinstance(message, Reception) for message in air.run(5000 * MS))
        yield Row(f"{rate} Mb/s, 30 dBm, free space: share of 1,024 bytes at {km} km", "DSSS by Proakis", "0.5",
                  _near(heard / 200))  # fmt: skip
    for standard, far_m in (("b", 3000), ("a", 1350)):
        ends = []
        for offset_m in (-10, 10):
            keys = ("radio.channel=range", "radio.range_m=5000", f"radio.standard={standard}")
            air = _Air(_on_air(*keys), [0.0, float(far_m + offset_m)])
            air.send(2 * MS, dst=2)
            ends += [m.outcome is TxOutcome.ACKED for m in air.run(900 * MS) if isinstance(m, TxStatus)]
        yield Row(f"`{standard}`: ACK in time 10 m before and after {far_m} m", "802.11-2020, 10.3.2.11: 20 or 9 us",
                  "yes, no", ", ".join("yes" if end else "no" for end in ends))  # fmt: skip
    air = _Air(_on_air("radio.channel=range"), [0.0, 100.0])
    sizes = (2268, 2269)
    for size in sizes:
        air.send(2 * MS, size=size)
    told = {m.seq: m.outcome for m in air.run(900 * MS) if isinstance(m, TxStatus)}
    yield Row("frames of 2268 and 2269 bytes sent", "MSDU of 2304 less 36 (9.2.4.8.1)", "yes, no",
              ", ".join("yes" if told[seq] is TxOutcome.SENT else "no" for seq in (0, 1)))  # fmt: skip
    waits = []
    for noise_dbm in (-61.0, -63.0):
        air = _Air(_on_air("radio.channel=friis", "radio.standard=a", "radio.tx_power_dbm=0"), [0.0, 15.0])
        air.medium.receive(_NAMES.radio_control, Jam("jam", Enu(0.0, 0.0, 0.0), 10.0, noise_dbm), 0)
        air.send(2 * MS)
        air.medium.receive(_NAMES.radio_control, Restore("jam"), 30 * MS)
        waits += [m.end_ns > 30 * MS for m in air.run(900 * MS) if isinstance(m, TxStatus)]
    yield Row("OFDM keeps silent at -61, at -63 dBm of noise", "802.11-2020, 17.3.10.6: -62 dBm", "yes, no",
              ", ".join("yes" if waited else "no" for waited in waits))  # fmt: skip

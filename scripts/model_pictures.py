#!/usr/bin/env python
"""Draws models beside the truth, into the documents that explain them (needs matplotlib):

docs/reference/sensors.png                         truth and measurement of each sensor
docs/explanation/channel-distance.png, -height     the loss of each channel over distance and height
docs/explanation/channel-edge.png                  the loss over an edge
docs/explanation/channel-fading.png                fading over time
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from emulator.channel import fading  # noqa: E402  (the tree's root is on the path now)
from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S  # noqa: E402
from emulator.channel.propagation import received_dbm  # noqa: E402
from emulator.kernel import state  # noqa: E402
from emulator.kernel.fading_gain import WAVES, gain  # noqa: E402
from emulator.kernel.state import Reals  # noqa: E402
from fanet_mw.bus.messages import Altimeter, Camera, Inertial, Radar, WindEstimate  # noqa: E402
from fanet_mw.scenario import Radio, Scenario, config  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from sim.figures.colors import BLUE, GRAY, GREEN, RED  # noqa: E402
from sim.figures.style import SERIES, applied, canvas  # noqa: E402
from sim.scenarios import catalog  # noqa: E402
from sim.world.environment.line_of_sight import loss_db as edge_loss_db  # noqa: E402
from sim.world.environment.obstacles import Box, Obstacles, obstacles  # noqa: E402
from sim.world.environment.solids import Solids  # noqa: E402
from sim.world.environment.survivors import Survivors  # noqa: E402
from sim.world.sensors.altimeter import AltimeterSensor  # noqa: E402
from sim.world.sensors.camera import CameraSensor, recognized_share  # noqa: E402
from sim.world.sensors.contract import Truth  # noqa: E402
from sim.world.sensors.gps import GpsReceiver  # noqa: E402
from sim.world.sensors.inertial import InertialSensor  # noqa: E402
from sim.world.sensors.phone import REFERENCE_LOSS_DB, PhoneSensor  # noqa: E402
from sim.world.sensors.position_estimate import PositionEstimate  # noqa: E402
from sim.world.sensors.radar import RadarSensor, detected_share  # noqa: E402
from sim.world.sensors.voice import VoiceSensor, level_db  # noqa: E402
from sim.world.sensors.wind import WindSensor  # noqa: E402
from sim.world.world import make_engine  # noqa: E402

REFERENCE, EXPLANATION = ROOT / "docs" / "reference", ROOT / "docs" / "explanation"
PLAIN = Solids(None)
CHANNELS: Final = ("log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")
ANTENNA_M: Final = {"uma_av": 25.0}
"""The height of the other node; 2 m in the other channels."""


def _scenario(*keys: str) -> Scenario:
    """Three UAVs and one survivor at the origin."""
    given = ["nodes.count=3", "clusters.count=1", "mission.survivors=1", "mission.survivor_positions_m=[[0,0]]"]
    return catalog.find("quick", [*given, *keys])


def _gps(axes: Axes) -> None:
    scenario = _scenario()
    receiver, at = GpsReceiver(scenario), np.zeros((3, 3))
    fixes = np.array([receiver.fixes(Truth(second * S, at, at))[0] for second in range(0, 1800, 2)])
    for row, color in enumerate((BLUE, RED, GREEN)):
        axes.plot(fixes[:, row, 0], fixes[:, row, 1], color=color, linewidth=0.6, label=f"UAV {row + 1}")
    turn = np.linspace(0, 2 * math.pi, 100)
    axes.plot(2.5 * np.cos(turn), 2.5 * np.sin(turn), color=GRAY, linestyle=":", label="2.5 m (CEP)")
    axes.set(title="GPS at rest, 30 min", xlabel="east, off [m]", ylabel="north, off [m]", aspect="equal")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")


def _height(axes: Axes) -> None:
    scenario = _scenario("sensors.altimeter_hz=1")
    sensor, receiver = AltimeterSensor(scenario, PLAIN), GpsReceiver(scenario)
    at, still = np.tile([0.0, 0, 50], (3, 1)), np.zeros((3, 3))
    barometer, gps = [], []
    for second in range(1800):
        (_, told), *_ = sensor.read(Truth(second * S, at, still), [0])
        assert isinstance(told, Altimeter)
        barometer.append(told.up_m)
        gps.append(receiver.fixes(Truth(second * S, at, still))[0][0, 2])
    axes.plot(gps, color=RED, linewidth=0.6, label="GPS")
    axes.plot(barometer, color=BLUE, linewidth=0.6, label="barometer")
    axes.axhline(50, color=GRAY, linestyle=":", label="truth")
    axes.set(title="Height of a UAV that hovers", xlabel="time [s]", ylabel="height [m]")
    axes.legend(loc="best", fontsize="small")


def _phone(axes: Axes) -> None:
    sensor = PhoneSensor(_scenario("mission.detection_dbm=-200"))
    east = np.arange(-300.0, 301.0, 4.0)
    told = [dict(sensor.scan(np.array([x, 30.0, 50.0])))[1] for x in east]
    distance = np.sqrt(east**2 + 30**2 + 50**2)
    axes.plot(east, told, color=BLUE, linewidth=0.8, label="measured")
    axes.plot(east, 15 - REFERENCE_LOSS_DB - 30 * np.log10(distance), color=GRAY, linestyle=":", label="path loss")
    axes.set(title="Phone, on a straight way past it", xlabel="east [m]", ylabel="power [dBm]")
    axes.legend(loc="best", fontsize="small")


def _voice(axes: Axes) -> None:
    keys = ("sensors.voice_hz=1", "sensors.voice_share=1", "sensors.voice_rotor_db=0")
    distances = np.linspace(2.0, 14.0, 120)
    for seed, color in ((1, BLUE), (2, RED), (3, GREEN)):
        scenario = _scenario(*keys, f"seed={seed}")
        sensor = VoiceSensor(scenario, Survivors(scenario), PLAIN)
        levels = []
        for distance in distances:
            at = np.tile([0.0, 0, distance], (3, 1))
            ((_, told),) = sensor.read(Truth(0, at, np.zeros((3, 3))), [0])
            levels.append(told.calls[0].level_db)  # type: ignore[union-attr]
        axes.plot(distances, levels, color=color, linewidth=0.6, label=f"survivor {seed}")
    axes.plot(distances, level_db(distances, at_1_m_db=88.0), color=GRAY, linestyle=":", label="88 dB at 1 m")
    axes.set(title="Level of calls", xlabel="distance [m]", ylabel="level [dB]")
    axes.legend(loc="best", fontsize="small")


def _radar(axes: Axes) -> None:
    sensor = RadarSensor(_scenario("sensors.radar_hz=5"), PLAIN)
    velocity = np.array([[0.0, 0, 0], [-8.0, 0, 0], [0, 0, 0]])
    true, off = [], []
    for step in range(600):
        at = np.array([[0.0, 0, 50], [110 - 0.16 * step, 0, 50], [0, 900, 50]])
        for _, told in sensor.read(Truth(step * S // 5, at, velocity), [0]):
            assert isinstance(told, Radar)
            for echo in told.echoes:
                if abs(echo.range_m - at[1, 0]) < 5:
                    true.append(at[1, 0])
                    off.append(echo.closing_m_s - 8.0)
    axes.plot(true, off, ".", color=BLUE, markersize=2)
    axes.axhline(0, color=GRAY, linestyle=":")
    axes.set(title="Radar: closing speed of a UAV at 8 m/s", xlabel="distance [m]", ylabel="off [m/s]")


def _outage(axes: Axes) -> None:
    for keys, color, name in (((), BLUE, "inertial"), (("sensors.inertial_hz=5",), RED, "with optical flow")):
        scenario = _scenario("nodes.count=200", "sensors.gps_outages=[[0,0,9000,30,9000]]", *keys)
        estimate, at = PositionEstimate(scenario, GpsReceiver(scenario)), np.zeros((200, 3))
        spread = []
        for tick in range(600):
            estimate.advance(Truth(tick * S // 10, at, at))
            spread.append(math.sqrt((estimate.off_m[:, :2] ** 2).sum(axis=1).mean()))
        axes.plot(np.arange(600) / 10, spread, color=color, label=name)
    axes.axvline(30, color=GRAY, linestyle=":", label="GPS is lost")
    axes.axvline(35, color=GRAY, linestyle="--", label="landing, without flow")
    axes.set(title="Estimate of the flight control", xlabel="time [s]", ylabel="off, RMS [m]", ylim=(0, 40))
    axes.legend(loc="upper left", fontsize="small")


def _camera(axes: Axes) -> None:
    scenario = _scenario("sensors.camera_hz=1")
    sensor = CameraSensor(scenario, Survivors(scenario), PLAIN)
    heights = np.arange(10.0, 121.0, 1.0)
    seen: list[tuple[float, float]] = []
    for second, up in enumerate(heights):
        truth = Truth(second * S, np.array([[0.0, 0, up], [500, 500, 50], [500, 500, 50]]), np.zeros((3, 3)))
        for _, told in sensor.read(truth, [0]):
            assert isinstance(told, Camera)
            seen += [(up, person.pixels) for person in told.people]
    axes.plot(*np.array(seen).T, ".", color=BLUE, markersize=3, label="measured")
    axes.plot(heights, sensor.pixels(heights), color=GRAY, linestyle=":", label="truth")
    axes.set(title="Camera: a person straight below", xlabel="height [m]", ylabel="pixels across", yscale="log")
    axes.legend(loc="best", fontsize="small")


def _rangefinder(axes: Axes) -> None:
    """A UAV that climbs slowly on its way over a house 12 m high."""
    house = Solids(Obstacles(None, (Box(60.0, 0.0, 20.0, 20.0, 12.0),)))
    sensor = AltimeterSensor(_scenario("sensors.altimeter_hz=5"), house)
    east = np.arange(0.0, 120.0, 0.6)
    at = np.column_stack([east, east * 0, 20 + east / 30])
    told = []
    for step, place in enumerate(at):
        (_, reading), *_ = sensor.read(Truth(step * S // 5, np.tile(place, (3, 1)), np.zeros((3, 3))), [0])
        assert isinstance(reading, Altimeter)
        told.append(reading.above_ground_m)
    axes.plot(east, told, ".", color=BLUE, markersize=2, label="measured")
    axes.plot(east, at[:, 2] - house.surface_m(at), color=GRAY, linestyle=":", label="truth")
    axes.set(title="Rangefinder, over a house", xlabel="east [m]", ylabel="above what is below [m]")
    axes.legend(loc="best", fontsize="small")


def _directions(axes: Axes) -> None:
    """How far off directions are, beside the laws: of calls, of people straight below, of UAVs."""
    keys = ("sensors.voice_hz=1", "sensors.voice_share=1", "sensors.voice_error_db=0", "sensors.voice_loudness_db=0",
            "sensors.camera_hz=1", "sensors.radar_hz=5", "sensors.radar_false_alarm=1e-9")  # fmt: skip
    scenario = _scenario(*keys)
    config_, people, still = scenario.sensors, Survivors(scenario), np.zeros((3, 3))
    voice, camera = VoiceSensor(scenario, people, PLAIN), CameraSensor(scenario, people, PLAIN)
    radar, beam_deg = RadarSensor(scenario, PLAIN), config_.radar_beam_deg

    def rms_deg(off_rad: list[float]) -> float:
        return math.degrees(math.sqrt(np.mean(np.square(off_rad))))

    rows: list[list[tuple[float, float, float]]] = [[], [], []]
    for far in (3.0, 5.0, 7.0, 9.0, 12.0):
        at = np.array([[0.6 * far, 0, 0.8 * far], [0, 900, 50], [0, 900, 90]])
        told = [call for s in range(300) for _, read in voice.read(Truth(s * S, at, still), [0]) for call in read.calls]  # type: ignore[union-attr]
        off = [call.elevation_rad + math.asin(0.8) for call in told]
        rows[0].append((far, rms_deg(off), config_.voice_sigma_deg * 10 ** (-told[0].snr_db / 20)))
    for far in (15.0, 30.0, 45.0, 60.0, 75.0, 90.0):
        at = np.array([[0.0, 0, far], [far, 0, far], [0, 900, 50]])
        seen = [one for s in range(300) for _, read in camera.read(Truth(s * S, at, still), [0]) for one in read.people]  # type: ignore[union-attr]
        off = [math.pi / 2 + one.elevation_rad for one in seen]
        rows[1].append((far, rms_deg(off) / math.sqrt(2), config_.camera_sigma_deg))
        found = [one for s in range(300) for _, read in radar.read(Truth(s * S, at, still), [0]) for one in read.echoes]  # type: ignore[union-attr]
        laws = [beam_deg / 1.6 / math.sqrt(2 * 10 ** (echo.snr_db / 10)) for echo in found]
        rows[2].append(
            (far, rms_deg([e.bearing_rad - math.pi / 2 for e in found]), math.sqrt(np.mean(np.square(laws))))
        )
    for name, found_, color in zip(("call", "person", "UAV, by radar"), rows, (GREEN, RED, BLUE), strict=True):
        away, off_deg, law = np.array(found_).T
        axes.plot(away, off_deg, ".", color=color, label=name)
        axes.plot(away, law, color=color, linestyle=":")
    axes.set(title="Directions", xlabel="distance [m]", ylabel="off, RMS [degrees]", yscale="log", ylim=(0.05, 20))
    axes.legend(loc="lower right", fontsize="small")


def _inertial(axes: Axes) -> None:
    sensor, told, true = InertialSensor(_scenario("sensors.inertial_hz=5")), [], []
    times = np.arange(0, 120, 0.2)
    for t in times:
        velocity = np.zeros((3, 3))
        velocity[0, 0] = true_m_s = 0.5 * math.sin(t / 10)
        for _, reading in sensor.read(Truth(round(t * S), np.zeros((3, 3)), velocity), [0]):
            assert isinstance(reading, Inertial)
            told.append(reading.velocity.east)
            true.append(true_m_s)
    axes.plot(times, told, color=BLUE, linewidth=0.6, label="measured")
    axes.plot(times, true, color=GRAY, linestyle=":", label="truth")
    axes.set(title="Inertial: velocity to the east", xlabel="time [s]", ylabel="velocity [m/s]")
    axes.legend(loc="best", fontsize="small")


def _wind(axes: Axes) -> None:
    """The mean of the air at a UAV, as it is and as it is told, in gusts."""
    scenario = _scenario("world.engine=rotors", "world.wind_m_s=[5,0]", "world.gusts_m_s=6", "sensors.wind_hz=1")
    engine = make_engine(scenario)
    engine.reset(np.tile([0.0, 0, 50], (3, 1)) + np.arange(3)[:, None] * [60.0, 0, 0])
    sensor, still = WindSensor(scenario, engine), np.zeros((3, 3))
    told, air = [], []
    for second in range(300):
        for _ in range(20):
            engine.advance(0.05, still)
        truth = Truth(second * S, engine.positions(), engine.velocities())
        ((_, reading),) = sensor.read(truth, [0])
        assert isinstance(reading, WindEstimate)
        told.append(reading.velocity.east)
        air.append(engine.air_m_s()[0, 0])
    axes.plot(air, color=GRAY, linewidth=1.2, linestyle=":", label="air")
    axes.plot(told, color=BLUE, linewidth=0.8, label="estimate")
    axes.set(title="Wind to the east, in gusts", xlabel="time [s]", ylabel="velocity [m/s]")
    axes.legend(loc="best", fontsize="small")


def _shares(axes: Axes) -> None:
    """How often a radar detects a UAV and a camera recognizes a person, and what their laws say."""
    far = np.arange(20.0, 131.0, 10.0)
    scenario = _scenario("sensors.radar_hz=5", "sensors.camera_hz=1")
    radar, camera = RadarSensor(scenario, PLAIN), CameraSensor(scenario, Survivors(scenario), PLAIN)
    met, seen = [], []
    for range_m in far:
        at = np.array([[0.0, 0, range_m], [range_m, 0, range_m], [0, 5000, 50]])
        scans = [[*radar.read(Truth(step * S // 5, at, at * 0), [0])] for step in range(400)]
        met.append(np.mean([any(abs(echo.range_m - range_m) < 5 for _, told in scan if isinstance(told, Radar)
                                for echo in told.echoes) for scan in scans]))  # fmt: skip
        seen.append(np.mean([bool([*camera.read(Truth(step * S, at, at * 0), [0])]) for step in range(400)]))
    config_ = scenario.sensors
    snr = 10 ** ((config_.radar_snr_db + 10 * math.log10(config_.radar_uav_m2) - 40 * np.log10(far / 100)) / 10)
    for name, shares, law, color in (
        ("radar, a UAV at this distance", met, detected_share(snr, false_alarm=config_.radar_false_alarm), BLUE),
        ("camera, a person so far below", seen,
         recognized_share(camera.pixels(far), cycles_for_half=config_.camera_cycles), RED),
    ):  # fmt: skip
        axes.plot(far, shares, ".", color=color, label=name)
        axes.plot(far, law, color=color, linestyle=":")
    axes.set(title="Share of scans and images", xlabel="distance [m]", ylabel="detected", ylim=(-0.02, 1.3))
    axes.legend(loc="upper right", fontsize="small")


def radio(**keys: object) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": keys}).radio


def loss_db(channel: str, distance_m: Reals | float, height_m: Reals | float) -> Reals:
    """The loss between a node at `height_m` and one near the ground, `distance_m` apart along the ground."""
    keys = radio(channel=channel, environment="urban")
    along, up = np.broadcast_arrays(np.asarray(distance_m, float), np.asarray(height_m, float))
    here = np.column_stack([along, np.zeros_like(along), up])
    there = np.tile([0.0, 0.0, ANTENNA_M.get(channel, 2.0)], (len(along), 1))
    return keys.tx_power_dbm - received_dbm(np.linalg.norm(here - there, axis=1), here, there, keys)


def panels(title: str, draw: Callable[[Axes, str], None]) -> Figure:
    figure = Figure(figsize=(11, 6.8), layout="constrained")
    grid = figure.subplots(2, 3, sharey=True)
    for axes, channel in zip(grid.flat, CHANNELS, strict=True):
        draw(axes, channel)
        axes.set_title(f"{channel}, other node at {ANTENNA_M.get(channel, 2.0):g} m", fontsize=9)
        axes.set_ylabel("loss [dB]")
    figure.legend(*grid.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    figure.suptitle(title, fontsize=10)
    return figure


def over_distance(axes: Axes, channel: str) -> None:
    along = np.geomspace(10, 10_000, 300)
    for height_m, look in zip((2.0, 10.0, 30.0, 100.0), SERIES, strict=False):
        loss = loss_db(channel, along, height_m)
        axes.semilogx(along, loss, label=f"{height_m:g} m up", color=look.color, linestyle=look.dash)
    axes.set_xlabel("distance along the ground [m]")


def over_height(axes: Axes, channel: str) -> None:
    up = np.linspace(1, 150, 600)
    for along_m, look in zip((50.0, 200.0, 1000.0), SERIES, strict=False):
        loss = loss_db(channel, along_m, up)
        axes.plot(up, loss, label=f"{along_m:g} m away", color=look.color, linestyle=look.dash)
    axes.set_xlabel("height [m]")


def correlation() -> Figure:
    """The correlation of Rayleigh-faded power while one node moves, or both, beside J0^2 and J0^4."""
    keys = radio(channel="friis", fading="nakagami", nakagami_m=1)
    p, pf, g = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS), np.zeros(state.GLOBALS, np.int64)
    p[state.FADING], pf[state.FADING_SHAPE] = fading.law_of(keys)
    wavelength_m, table = SPEED_OF_LIGHT_M_S / (keys.frequency_mhz * 1e6), fading.tables(keys)
    way = np.linspace(0, 2, 81)  # wavelengths, at 1 m/s
    instants = np.rint(way * wavelength_m * 1e9).astype(int).tolist()
    angle = 2 * np.pi * (np.arange(400) + 0.5) / 400
    j0 = np.cos(np.multiply.outer(2 * np.pi * way, np.cos(angle))).mean(axis=1)
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.subplots()
    random = np.random.Generator(np.random.PCG64(1))
    for both, color in ((False, BLUE), (True, RED)):
        drawn = []
        for seed in range(240):
            at, velocity = random.uniform(0, 5000, (60, 3)), np.zeros((60, 3))
            velocity[::2, 0], velocity[1::2, 1] = 1.0, float(both)
            waves = fading.Waves(keys, seed=seed).of(at, velocity, 0)
            drawn += [[gain(g, p, pf, waves, table, i, i + 1, t) - 1 for t in instants] for i in range(0, 60, 2)]
        gains = np.array(drawn)
        who = "both nodes move" if both else "one node moves"
        axes.plot(way, (gains * gains[:, :1]).mean(axis=0) / (gains[:, 0] ** 2).mean(), ".", color=color, label=who)
        law = j0**4 if both else (j0**2 - 1 / WAVES) / (1 - 1 / WAVES)
        axes.plot(way, law, color=color, lw=1, label="J0^4" if both else f"J0^2 (Clarke, Jakes) by {WAVES} waves")
    axes.set(xlabel="way of a node [wavelengths]", ylabel="correlation of the power")
    axes.legend(fontsize=8)
    return figure


def edge() -> Figure:
    """The loss behind a wall and past a tower, as one node rises or moves aside."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    wavelength_m = SPEED_OF_LIGHT_M_S / 2.412e9
    other = np.array([[250.0, 0.0, 20.0]])
    above, beside = figure.subplots(1, 2, sharey=True)
    for axes, building, moves, name in (
        (above, (0, 0, 1, 600, 40), 2, "height of the node [m]"), (beside, (0, 0, 20, 20, 60), 1, "way aside [m]"),
    ):  # fmt: skip
        scenario = _scenario("world.area_m=1000", f"world.buildings=[{list(building)}]", "nodes.spacing_m=400")
        solids = Solids(obstacles(scenario, np.array([[400.0, 400.0, 100.0]])))
        places = np.linspace(1, 100, 400) if moves == 2 else np.linspace(-60, 60, 400)
        at = np.tile([-50.0, 0.0, 20.0], (len(places), 1))
        at[:, moves] = places
        axes.plot(
            places, edge_loss_db(solids, at, np.repeat(other, len(at), axis=0), wavelength_m=wavelength_m), color=BLUE
        )
        axes.set(xlabel=name, ylabel="loss by the edge [dB]")
    above.set_title("behind a wall of 40 m, 50 and 250 m away", fontsize=9)
    beside.set_title("behind a tower 20 m wide", fontsize=9)
    return figure


def main() -> None:
    """All pictures."""
    with applied():
        figure, grid = canvas(2, 6, width=4.0, height=3.4)
        drawn = (
            _gps, _height, _rangefinder, _phone, _voice, _camera,
            _directions, _shares, _radar, _inertial, _wind, _outage,
        )  # fmt: skip
        for draw, axes in zip(drawn, grid, strict=True):
            draw(axes)
        figure.savefig(REFERENCE / "sensors.png", dpi=90, metadata={"Software": None})
        pictures = {
            "distance": panels("Loss over distance, by the height of one node; 2412 MHz, urban", over_distance),
            "height": panels("Loss over the height of one node; 2412 MHz, urban", over_height),
            "edge": edge(),
            "fading": correlation(),
        }
        for name, picture in pictures.items():
            picture.savefig(EXPLANATION / f"channel-{name}.png", dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()

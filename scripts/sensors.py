#!/usr/bin/env python
"""Draw truth and measurement of each sensor into docs/reference/sensors.png: `python scripts/sensors.py`
(needs matplotlib).
"""

import math
import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from fanet_mw.bus.messages import Altimeter, Radar  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.scenario import Scenario  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from sim.figures.colors import BLUE, GRAY, GREEN, RED  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.scenarios import catalog  # noqa: E402
from sim.world.environment.solids import Solids  # noqa: E402
from sim.world.environment.survivors import Survivors  # noqa: E402
from sim.world.mobility.position_estimate import PositionEstimate  # noqa: E402
from sim.world.sensors.altimeter import AltimeterSensor  # noqa: E402
from sim.world.sensors.contract import Truth  # noqa: E402
from sim.world.sensors.gps import GpsReceiver  # noqa: E402
from sim.world.sensors.phone import REFERENCE_LOSS_DB, PhoneSensor  # noqa: E402
from sim.world.sensors.radar import RadarSensor  # noqa: E402
from sim.world.sensors.voice import VoiceSensor, level_db  # noqa: E402

OUT = ROOT / "docs" / "reference" / "sensors.png"
PLAIN = Solids(None)


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
    axes.legend(loc="best", fontsize="small")


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


def main() -> None:
    """All panels in one picture."""
    with applied():
        figure, panels = canvas(2, 3, width=4.0, height=3.4)
        for draw, axes in zip((_gps, _height, _phone, _voice, _radar, _outage), panels, strict=True):
            draw(axes)
        figure.savefig(OUT, dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()

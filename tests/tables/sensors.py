"""What sensors' errors cost a search, and from which height a survivor can be made out."""

import math
import statistics
from collections.abc import Callable
from typing import Final

from sim.scenarios import catalog
from sim.world.sensors.phone import REFERENCE_LOSS_DB
from sim.world.sensors.voice import level_db
from tests.tables.markdown import Rows
from tests.tables.summaries import summarized

_SEARCHES: Final = {
    "3, 300 m, `spiral`": (
        range(1, 9),
        ("nodes.count=3", "clusters.count=1", "nodes.spacing_m=50", "world.area_m=300", "mission.survivors=3",
         "mission.search=spiral", "duration_s=160"),
    ),
    "12, 500 m, `lines`": (
        range(1, 4),
        ("nodes.count=12", "clusters.count=2", "nodes.spacing_m=100", "world.area_m=500", "mission.survivors=3",
         "duration_s=200"),
    ),
}  # fmt: skip
_QUIET: Final = ("nodes.telemetry_hz=0", "traffic.interval_s=4")
_PLAIN: Final = (
    "world.navigation=perfect", "sensors.gps_common_m=0", "sensors.gps_bias_m=0", "sensors.gps_velocity_m_s=0",
    "sensors.gps_delay_s=0", "sensors.gps_vertical=1", "mission.phone_rice_db=100", "mission.rssi_sigma_db=0",
)  # fmt: skip
"""White noise of GPS alone, and flights on the truth: what simulators often take for sensors."""
_HEIGHTS_M: Final = (65, 25, 10)


def errors() -> Rows:
    """Searches with the default sensors, beside white GPS noise of 1.5 m and flights on the truth."""
    head = ["UAVs, area, search", "sensors", "seeds", "confirmed", "error of confirmed people, median [m]",
            "contacts", "least distance [m]"]  # fmt: skip
    rows = [head]
    for name, (seeds, keys) in _SEARCHES.items():
        for sensors, more in (("white noise, flown on the truth", _PLAIN), ("default", ())):
            runs = [summarized("rescue", *keys, *_QUIET, *more, f"seed={seed}") for seed in seeds]
            missions = [run["mission"] for run in runs]
            off_m = [m["confirmed_error_m"] for m in missions if m["confirmed_error_m"] is not None]
            rows.append([
                name, sensors, str(len(runs)),
                f"{sum(m['confirmed'] for m in missions)} of {sum(m['survivors'] for m in missions)}",
                f"{statistics.median(off_m):.1f}", str(sum(m["collisions"] for m in missions)),
                f"{min(m['nearest_m']['least'] for m in missions):.1f}",
            ])  # fmt: skip
    return rows


def heights() -> Rows:
    """How far to the side of a hovering UAV a survivor on flat ground is made out, by the formulas of the sensors."""
    scenario = catalog.find("quick", [])
    sensors, mission = scenario.sensors, scenario.mission
    least_db = sensors.voice_rotor_db - sensors.voice_gain_db + sensors.voice_snr_db

    def call(rubble_db: float) -> float:
        return _reach_m(lambda m: float(level_db(m, at_1_m_db=sensors.voice_level_db)) - rubble_db - least_db)

    def phone(rubble_db: float) -> float:
        budget_db = mission.phone_power_dbm - rubble_db - REFERENCE_LOSS_DB - mission.detection_dbm
        return math.pow(10.0, budget_db / (10 * mission.phone_exponent))

    reaches = (call(0.0), call(sensors.burial_voice_db), phone(0.0), phone(sensors.burial_phone_db))
    head = ["height", "call, in the open", f"call, under rubble ({sensors.burial_voice_db:g} dB)", "phone, in the open",
            f"phone, under rubble ({sensors.burial_phone_db:g} dB)"]  # fmt: skip
    rows = [
        [f"{up} m", *(f"within {math.sqrt(reach**2 - up**2):.0f} m" if reach > up else "no" for reach in reaches)]
        for up in _HEIGHTS_M
    ]
    return [head, *rows, ["range", *(f"{reach:.1f} m" for reach in reaches)]]


def _reach_m(over: Callable[[float], float]) -> float:
    """The distance at which a falling margin is used up."""
    low, high = 0.01, 10_000.0
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if over(middle) > 0 else (low, middle)
    return low

"""What the sensors of a seed say is the same in every release, over hills and among houses, with people below."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from kept_values import kept

from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Truth
from sim.world.sensors.suite import Suite, sensors_of

MakeScenario = Callable[..., Scenario]
EVERY = {f"sensors.{kind}_hz": 2 for kind in ("camera", "voice", "radar", "altimeter", "inertial")}
WORLDS: dict[str, dict[str, Any]] = {
    "plain": {"mission.buried": 0.4},
    "low": {"nodes.altitude_m": 12, "sensors.radar_snr_db": 30, "sensors.gps_outages": [[0, 0, 30, 3, 5]]},
    "houses": {"world.buildings": 12, "sensors.camera_false_per_hour": 3000, "sensors.radar_false_alarm": 1e-4},
    "hills": {"world.terrain_m": 20, "world.navigation": "estimated"},
}


@pytest.mark.parametrize("name", WORLDS)
def test_readings_are_what_they_were_before(make_scenario: MakeScenario, name: str) -> None:
    keys = {
        "nodes.count": 6,
        "nodes.spacing_m": 25,
        "nodes.altitude_m": 40,
        "mission.survivors": 8,
        "world.area_m": 120,
    }
    scenario = make_scenario(**keys | EVERY | WORLDS[name])
    starts = np.array(positions(scenario), dtype=np.float64)
    solids = Solids(obstacles(scenario, starts))
    suite = Suite(scenario, sensors_of(scenario, Survivors(scenario, solids.ground_m), solids), Topics("kept"))

    def values() -> Iterator[Any]:
        velocity = np.linspace(-6, 6, starts.size).reshape(starts.shape) * [1, 1, 0.1]
        for step in range(80):
            truth = Truth(step * S // 10, starts + velocity * step / 10, velocity)
            yield list(suite.readings(truth, np.array([True] * 5 + [step < 40]), before_ns=truth.now_ns - S // 10))

    kept(f"readings, {name}", values())

"""Height sensors: a barometer, and a rangefinder that looks straight down.

The error of the barometer is Gaussian noise for each reading and a Gauss-Markov drift of 300 s: weather, warmth, and
the air that rotors move. No published deviation was found; users tell of 0.5 m in calm and 2 m in gusty air (SiteSee),
and of 1.5 m within ten minutes while an MS5611 warms up (MultiWii). The rangefinder measures to the highest thing
below, with Gaussian noise (a Lightware SF11/C reaches 120 m, to 0.1 m). Not modeled: tilt, water, glass.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from fanet_mw.bus.messages import Altimeter, Message
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.world.environment.solids import Solids
from sim.world.sensors.contract import Drift, Sensor, Truth, generator

DRIFT_S: Final = 300.0


class AltimeterSensor(Sensor):
    """A barometer and a rangefinder per UAV."""

    kind = "altimeter"

    def __init__(self, scenario: Scenario, solids: Solids) -> None:
        self._config = scenario.sensors
        self.period_ns = round(S / self._config.altimeter_hz)
        self._solids = solids
        self._random = generator(scenario.seed, "altimeter")
        slow = generator(scenario.seed, "barometer")
        self._drift = Drift(slow, (scenario.nodes.count,), sigma=self._config.barometer_drift_m, tau_s=DRIFT_S)

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        if not rows:
            return
        config, picked = self._config, list(rows)
        noise = self._random.normal(0.0, 1.0, (len(picked), 2))
        up = truth.at[picked, 2] + self._drift.at(truth.now_ns)[picked] + config.barometer_sigma_m * noise[:, 0]
        above = truth.at[picked, 2] - self._solids.surface_m(truth.at[picked])
        told = above + config.rangefinder_sigma_m * noise[:, 1]
        for index, row in enumerate(picked):
            within = above[index] <= config.rangefinder_m
            yield row, Altimeter(truth.now_ns, float(up[index]), max(0.0, float(told[index])) if within else None)

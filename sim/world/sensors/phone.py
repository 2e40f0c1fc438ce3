"""The Wi-Fi receiver that detects survivors' phones.

    RSSI = power - 40.05 dB - 10 n log10(d / 1 m) + shadowing + fading + noise - loss through rubble     [dBm]

This is log-distance path loss with log-normal shadowing (Rappaport, 2002, ch. 4.9), above a detection threshold, told
in steps of 1 dB as receivers do (IEEE 802.11-2020, 9.4.2.37: RCPI, right within 5 dB in 95 %). Shadowing is a Gaussian
field over the places of both ends, whose correlation falls as exp(-d / d_corr) when either moves (Gudmundson, 1991), as
that of the swarm's own radio (`emulator/channel/shadowing.py`). Fading is Rician and new for each scan, because a UAV
moves many wavelengths in between; Matolak and Sun (IEEE Trans. Veh. Technol. 66(8), 2017) measured K of 12 dB and more
over suburbs in the L band, and a phone lies on the ground. The loss through a collapsed building was measured from 50
MHz to 1.8 GHz by Holloway et al. (IEEE Antennas and Propagation Magazine 56(3), 2014: some 20 to 80 dB). It grows with
the frequency, by 10 to 100 dB for each metre of reinforced concrete (Oestges, EMTS 2013). Not modeled: the phone's own
interval of probe requests, and hills or walls in the way.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from fanet_mw.bus.messages import Message, WifiScan
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import seconds_to_ns
from sim.world.arrays import Values
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Sensor, Truth, generator

REFERENCE_LOSS_DB: Final = 40.05
"""Free-space loss at 1 m and 2.4 GHz."""
_WAVES: Final = 256
"""The plane waves of which shadowing is made; within one seed the correlation differs from the law by 1 / sqrt(2 N)."""


class PhoneSensor(Sensor):
    """The receivers of phones of all UAVs, one for each."""

    kind = "wifi"

    def __init__(self, scenario: Scenario, survivors: Survivors | None = None) -> None:
        self.period_ns = seconds_to_ns(scenario.mission.scan_interval_s)
        self._mission = scenario.mission
        survivors = survivors or Survivors(scenario)
        self._places = survivors.places
        self._power_dbm = scenario.mission.phone_power_dbm - np.where(
            survivors.buried, scenario.sensors.burial_phone_db, 0.0
        )
        random = generator(scenario.seed, "phone_shadowing")
        self._waves = _wave_vectors(random) / scenario.radio.shadowing_corr_m
        phases = self._places @ _wave_vectors(random) / scenario.radio.shadowing_corr_m
        phases += random.uniform(0.0, 2 * math.pi, _WAVES)
        self._cos, self._sin = np.cos(phases), np.sin(phases)
        self._random = generator(scenario.seed, "phone_readings")

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        for row in rows:
            heard = self.scan(truth.at[row])
            if heard:
                yield row, WifiScan(truth.now_ns, heard)

    def scan(self, at: npt.NDArray[np.float64]) -> tuple[tuple[int, float], ...]:
        """(survivor, RSSI dBm) of each phone that is received at a position, the strongest first."""
        mission = self._mission
        if not len(self._places):
            return ()
        offset = self._places - at
        distance2 = np.maximum(1.0, (offset * offset).sum(axis=1))
        mean_dbm = self._power_dbm - REFERENCE_LOSS_DB - 5 * mission.phone_exponent * np.log10(distance2)
        near = np.flatnonzero(mean_dbm >= mission.detection_dbm - 5 * max(mission.shadowing_db, 2.0))
        if not len(near):
            return ()
        told_dbm = np.round(mean_dbm[near] + self._shadowing_db(near, at) + self._reading_db(len(near))).tolist()
        heard = [(i + 1, dbm) for i, dbm in zip(near.tolist(), told_dbm, strict=True) if dbm >= mission.detection_dbm]
        return tuple(sorted(heard, key=lambda h: (-h[1], h[0])))

    def _shadowing_db(self, survivors: npt.NDArray[np.intp], at: npt.NDArray[np.float64]) -> Values:
        """The shadowing between these survivors and a place, each time the same: the cosines of both phases."""
        here = at @ self._waves
        waves = self._cos[survivors] @ np.cos(here) - self._sin[survivors] @ np.sin(here)
        return np.asarray(self._mission.shadowing_db * math.sqrt(2 / _WAVES) * waves)

    def _reading_db(self, count: int) -> Values:
        """Fading and noise of each reading: the power of a direct wave with scattered ones, whose mean is 1."""
        k = math.pow(10.0, self._mission.phone_rice_db / 10)
        scattered = self._random.normal(0.0, math.sqrt(1 / (2 * (k + 1))), (2, count))
        power = (math.sqrt(k / (k + 1)) + scattered[0]) ** 2 + scattered[1] ** 2
        noise_db = self._random.normal(0.0, self._mission.rssi_sigma_db, count)
        return np.asarray(10 * np.log10(np.maximum(power, 1e-9)) + noise_db)


def _wave_vectors(random: np.random.Generator) -> Values:
    """Wave vectors [3, _WAVES] for a correlation distance of 1 m: multivariate Cauchy."""
    return np.asarray(random.normal(size=(3, _WAVES)) / np.abs(random.normal(size=_WAVES)))

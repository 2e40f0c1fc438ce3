"""The Wi-Fi receiver that detects survivors' phones.

    RSSI = power - 40.05 dB - 10 n log10(d / 1 m) + shadowing - loss through rubble     [dBm]

This is log-distance path loss with log-normal shadowing (Rappaport, 2002, ch. 4.9), above a detection threshold. The
loss through a collapsed building was measured from 50 MHz to 1.8 GHz by Holloway et al. (IEEE Antennas and Propagation
Magazine 56(3), 2014: some 20 to 80 dB). It grows with the frequency, by 10 to 100 dB for each metre of reinforced
concrete (Oestges, EMTS 2013). Not modeled: fading in time, and the phone's own interval of probe requests.
"""

import hashlib
import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from fanet_mw.bus.messages import Message, WifiScan
from fanet_mw.rng import stream_seed
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import seconds_to_ns
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Sensor, Truth

REFERENCE_LOSS_DB: Final = 40.05
"""Free-space loss at 1 m and 2.4 GHz."""
KEPT_VALUES: Final = 8192
"""The number of cached values of shadowing (about 1.5 MB), those of the places where UAVs are now."""
_CELL_M: Final = 25.0
"""Shadowing is one value per survivor and ground cell of this size, so it is the same each time a
UAV comes to a place."""


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
        self._seed = stream_seed(scenario.seed, "shadowing")
        self._shadow: dict[tuple[int, int, int], float] = {}

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
        distance = np.maximum(1.0, np.linalg.norm(self._places - at, axis=1))
        mean_dbm = self._power_dbm - REFERENCE_LOSS_DB - 10 * mission.phone_exponent * np.log10(distance)
        near = np.flatnonzero(mean_dbm >= mission.detection_dbm - 4 * mission.shadowing_db)
        heard = [(int(i) + 1, float(mean_dbm[i]) + self._shadowing_db(int(i), at)) for i in near]
        return tuple(sorted((h for h in heard if h[1] >= mission.detection_dbm), key=lambda h: (-h[1], h[0])))

    def _shadowing_db(self, survivor: int, at: npt.NDArray[np.float64]) -> float:
        """The fixed shadowing between a survivor and a ground cell."""
        key = survivor, math.floor(at[0] / _CELL_M), math.floor(at[1] / _CELL_M)
        value = self._shadow.get(key)
        if value is None:
            digest = hashlib.sha256(f"{self._seed}/{key}".encode()).digest()
            u, v = (int.from_bytes(digest[i : i + 6], "big") + 1 for i in (0, 6))
            gauss = math.sqrt(-2 * math.log(u / 2**48)) * math.cos(2 * math.pi * v / 2**48)  # Box and Muller, 1958
            if len(self._shadow) >= KEPT_VALUES:
                self._shadow.clear()  # each value will be computed again, and be the same
            value = self._shadow[key] = max(-3.5, min(3.5, gauss)) * self._mission.shadowing_db
        return value

"""Where the survivors are, and who hears their phones. Ids run from 1."""

import hashlib
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from fanet_mw.rng import stream, stream_seed
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu

REFERENCE_LOSS_DB: Final = 40.05
"""Free-space loss at 1 m and 2.4 GHz."""
KEPT_VALUES: Final = 8192
"""Values of shadowing that are kept, about 1.5 MB: those of the places where UAVs are now."""
_CELL_M: Final = 25.0
"""Shadowing is one value per survivor and ground cell of this size: what a place hides, it hides every time."""


def place(scenario: Scenario) -> list[Enu]:
    """The true positions: uniform over the area, on the ground."""
    random = stream(scenario.seed, "survivors")
    half = scenario.world.area_m / 2
    return [
        Enu(random.uniform(-half, half), random.uniform(-half, half), 0.0) for _ in range(scenario.mission.survivors)
    ]


class PhoneSensor:
    """Received power of survivors' phones: log-distance with log-normal shadowing, above a detection threshold."""

    def __init__(self, scenario: Scenario) -> None:
        self._mission = scenario.mission
        self._places = np.array(place(scenario), dtype=np.float64).reshape(-1, 3)
        self._seed = stream_seed(scenario.seed, "shadowing")
        self._shadow: dict[tuple[int, int, int], float] = {}

    def scan(self, at: npt.NDArray[np.float64]) -> tuple[tuple[int, float], ...]:
        """(survivor, RSSI dBm) of each phone heard from a position, strongest first."""
        mission = self._mission
        if not len(self._places):
            return ()
        distance = np.maximum(1.0, np.linalg.norm(self._places - at, axis=1))
        mean_dbm = mission.phone_power_dbm - REFERENCE_LOSS_DB - 10 * mission.phone_exponent * np.log10(distance)
        near = np.flatnonzero(mean_dbm >= mission.detection_dbm - 4 * mission.shadowing_db)
        heard = [(int(i) + 1, float(mean_dbm[i]) + self._shadowing_db(int(i), at)) for i in near]
        return tuple(sorted((h for h in heard if h[1] >= mission.detection_dbm), key=lambda h: (-h[1], h[0])))

    def _shadowing_db(self, survivor: int, at: npt.NDArray[np.float64]) -> float:
        """The fixed shadowing of a survivor towards a ground cell."""
        key = survivor, math.floor(at[0] / _CELL_M), math.floor(at[1] / _CELL_M)
        value = self._shadow.get(key)
        if value is None:
            digest = hashlib.sha256(f"{self._seed}/{key}".encode()).digest()
            u, v = (int.from_bytes(digest[i : i + 6], "big") + 1 for i in (0, 6))
            gauss = math.sqrt(-2 * math.log(u / 2**48)) * math.cos(2 * math.pi * v / 2**48)  # Box and Muller, 1958
            if len(self._shadow) >= KEPT_VALUES:
                self._shadow.clear()  # each is computed again, to the same value
            value = self._shadow[key] = max(-3.5, min(3.5, gauss)) * self._mission.shadowing_db
        return value

"""Free space in rain: Friis, and the specific attenuation k R^alpha of ITU-R P.838-3.

The coefficients are those of 5 GHz, horizontal polarization, scaled by the square of the frequency, which is coarse
but enough to say that rain is next to nothing at 2.4 GHz.
"""

import math

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field

from fanet_mw.scenario.tables.radio import Radio

Reals = npt.NDArray[np.float64]
_K_5_GHZ = 0.0002162
_ALPHA_5_GHZ = 1.6969
_SPEED_OF_LIGHT_M_S = 299_792_458.0


class Options(BaseModel, extra="forbid"):
    """The table `[radio.options]`."""

    mm_per_hour: float = Field(10, ge=0, le=300)
    """Rain rate."""


class Rain:
    """A channel."""

    Options = Options

    def __init__(self, radio: Radio) -> None:
        rate = Options.model_validate(radio.options).mm_per_hour
        scale = (radio.frequency_mhz / 5000.0) ** 2
        self._db_per_m = scale * _K_5_GHZ * rate**_ALPHA_5_GHZ / 1000
        self._at_1_m = 20 * math.log10(4 * math.pi * radio.frequency_mhz * 1e6 / _SPEED_OF_LIGHT_M_S)

    def loss_db(self, distance_m: Reals, from_m: Reals, to_m: Reals) -> Reals:
        distance = np.maximum(distance_m, 1.0)
        return np.asarray(self._at_1_m + 20 * np.log10(distance) + self._db_per_m * distance)

    def reach_m(self, budget_db: float) -> float:
        return float(10.0 ** max(0.0, (budget_db - self._at_1_m) / 20))  # in dry air, which reaches farthest

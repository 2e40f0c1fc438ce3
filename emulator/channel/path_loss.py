"""Path loss over distance, as equations: arrays in, arrays out, without state and without the scenario.

Equations, sources and ranges of validity: docs/explanation/channel.md. Distances and heights in metres, frequencies in
MHz, losses in dB between isotropic antennas; below 1 m as at 1 m. Not modeled: antenna patterns and airframes, weather,
the curvature of the earth, and the oscillation of two rays before the crossover.
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

Reals = npt.NDArray[np.float64]

SPEED_OF_LIGHT_M_S: Final = 299_792_458.0
LEAST_HEIGHT_M: Final = 0.5
"""The least antenna height in the two-ray model; at height 0 the reflected ray would cancel the direct ray."""
AIR_TO_AIR_EXPONENT: Final = 2.05
"""N. Ahmed, S. Kanhere, S. Jha, "On the importance of link characterization for aerial wireless sensor networks", IEEE
Commun. Mag. 54(5), 2016: between two airborne 2.4 GHz radios."""


class Environment(NamedTuple):
    """An environment on the ground: P(LoS) = 1 / (1 + a exp(-b (elevation - a))), with its excess losses in dB."""

    a: float
    b: float
    los_db: float
    nlos_db: float
    roofs_m: float
    """The scale gamma of roof heights, which have a Rayleigh distribution (ITU-R P.1410)."""


ENVIRONMENTS: Final = {
    "suburban": Environment(4.88, 0.43, 0.1, 21.0, 8.0),
    "urban": Environment(9.61, 0.16, 1.0, 20.0, 15.0),
    "dense_urban": Environment(12.08, 0.11, 1.6, 23.0, 20.0),
    "highrise": Environment(27.23, 0.08, 2.3, 34.0, 50.0),
}
"""A. Al-Hourani, S. Kandeepan, S. Lardner, "Optimal LAP altitude for maximum coverage", IEEE Wireless Commun. Lett.
3(6), 2014; excess losses at 2 GHz from their "Modeling air-to-ground path loss for low altitude platforms in urban
environments", GLOBECOM 2014."""


def friis_db(distance_m: Reals, *, frequency_mhz: float) -> Reals:
    """Loss in free space (H. T. Friis, Proc. IRE 34, 1946)."""
    at_1_m = 20 * math.log10(4 * math.pi * frequency_mhz * 1e6 / SPEED_OF_LIGHT_M_S)
    return log_distance_db(distance_m, reference_db=at_1_m, exponent=2.0)


def log_distance_db(distance_m: Reals, *, reference_db: float, exponent: float) -> Reals:
    return np.asarray(reference_db + 10 * exponent * np.log10(np.maximum(distance_m, 1.0)), dtype=np.float64)


def crossover_m(height_a_m: Reals, height_b_m: Reals, *, frequency_mhz: float) -> Reals:
    """The distance at which the two laws of `two_ray_db` meet."""
    product = np.maximum(height_a_m, LEAST_HEIGHT_M) * np.maximum(height_b_m, LEAST_HEIGHT_M)
    return np.asarray(4 * math.pi * product * frequency_mhz * 1e6 / SPEED_OF_LIGHT_M_S, dtype=np.float64)


def two_ray_db(distance_m: Reals, height_a_m: Reals, height_b_m: Reals, *, frequency_mhz: float) -> Reals:
    """Loss of a direct ray and its ground reflection (T. S. Rappaport, Wireless Communications, 2nd ed., 4.6)."""
    product = np.maximum(height_a_m, LEAST_HEIGHT_M) * np.maximum(height_b_m, LEAST_HEIGHT_M)
    beyond = 40 * np.log10(np.maximum(distance_m, 1.0)) - 20 * np.log10(product)
    near = distance_m < crossover_m(height_a_m, height_b_m, frequency_mhz=frequency_mhz)
    return np.where(near, friis_db(distance_m, frequency_mhz=frequency_mhz), beyond)


def air_to_air_db(distance_m: Reals, *, frequency_mhz: float) -> Reals:
    """Loss between two UAVs that are both clear of the ground."""
    at_1_m = 20 * math.log10(4 * math.pi * frequency_mhz * 1e6 / SPEED_OF_LIGHT_M_S)
    return log_distance_db(distance_m, reference_db=at_1_m, exponent=AIR_TO_AIR_EXPONENT)


def sight_probability(elevation_deg: Reals, environment: Environment) -> Reals:
    """Probability of line of sight between the ground and a UAV at this elevation (Al-Hourani et al. 2014, eq. 5)."""
    return np.asarray(
        1 / (1 + environment.a * np.exp(-environment.b * (elevation_deg - environment.a))), dtype=np.float64
    )


def air_to_ground_db(distance_m: Reals, rise_m: Reals, environment: Environment, *, frequency_mhz: float) -> Reals:
    """Mean loss between a place on the ground and a UAV `rise_m` above it (Al-Hourani et al. 2014, equation 6)."""
    elevation_deg = np.degrees(np.arcsin(np.minimum(1.0, rise_m / np.maximum(distance_m, 1e-9))))
    sight = sight_probability(elevation_deg, environment)
    excess = sight * environment.los_db + (1 - sight) * environment.nlos_db
    return np.asarray(friis_db(distance_m, frequency_mhz=frequency_mhz) + excess, dtype=np.float64)


def share_of_lower_roofs(height_m: Reals, environment: Environment) -> Reals:
    return np.asarray(-np.expm1(-(np.maximum(height_m, 0.0) ** 2) / (2 * environment.roofs_m**2)), dtype=np.float64)


def uma_av_sight_probability(along_m: Reals, height_m: Reals) -> Reals:
    """P(LoS) of an aerial user of an urban macro cell, over the horizontal distance (TR 36.777, table B-1)."""
    height = np.maximum(height_m, 22.5)
    decay_m = 4300 * np.log10(height) - 3800
    near_m = np.maximum(460 * np.log10(height) - 700, 18.0)
    far = near_m / np.maximum(along_m, near_m)
    return np.where((along_m <= near_m) | (height > 100), 1.0, far + np.exp(-along_m / decay_m) * (1 - far))


def uma_av_db(distance_m: Reals, along_m: Reals, height_m: Reals, *, frequency_mhz: float) -> Reals:
    """Mean loss between an antenna at 25 m and a UAV at `height_m` (TR 36.777, tables B-1 and B-2)."""
    ghz, decades = frequency_mhz / 1000, np.log10(np.maximum(distance_m, 1.0))
    seen = 28.0 + 22 * decades + 20 * math.log10(ghz)
    slope = 46 - 7 * np.log10(np.clip(height_m, 22.5, 300.0))
    hidden = np.maximum(seen, -17.5 + slope * decades + 20 * math.log10(40 * math.pi * ghz / 3))
    sight = uma_av_sight_probability(along_m, height_m)
    return np.asarray(sight * seen + (1 - sight) * hidden, dtype=np.float64)

"""A microphone array that detects calls for help in the noise of its own rotors and of the wind.

    level    L1 - 20 log10(d / 1 m) - a d - loss through rubble or a wall      a = 0.005 dB/m
    noise    power sum of the rotors' level at the array, and of the wind's
    SNR      level - noise + gain of the array
    wind     40 log10 V - 23 log10(f D / V) + 15   [dB]     f = 500 Hz, D = 0.1 m

The sound spreads spherically; air absorbs 5 dB/km at 1 kHz, 20 degrees and 50 to 70 % humidity (ISO 9613-1). A shout
has 82 dB at 1 m by ANSI S3.5-1997, and up to 90 dB if it is as loud as possible. A wall in between takes 20 dB
(Maekawa's limit for a single edge). Wind noise is that in a third-octave band behind a windscreen of diameter D at an
airspeed V: Strasberg, J. Acoust. Soc. Am. 83(2), 1988. A call is detected if its SNR exceeds a threshold. The error of
its direction is Gaussian along each of two axes, and falls with the square root of the SNR, as the Cramer-Rao bound
does. Arrays of 12 to 16 microphones were flown on multirotors by Hoshiba et al., Sensors 17(11), 2017. Calls last a
second, survivors call in a share of their seconds, and all UAVs hear the same calls. People differ in how loud they
shout (Pearsons et al., EPA-600/1-77-025, 1977: men louder than women and children; the standard deviation is assumed),
and a level is measured in turbulent air. Not modeled: echoes, calls that mask each other, and the silence of rotors
that stand still on the ground.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from fanet_mw.bus.messages import Call, Message, Voice
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.world.arrays import Flags, Values
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Sensor, Truth, angles, generator, shaken

AIR_DB_PER_M: Final = 0.005
WALL_DB: Final = 20.0
_BAND_HZ: Final = 500.0
_SCREEN_M: Final = 0.1
_LEAST_WIND_M_S: Final = 0.1
_MOUTH_M: Final = 0.3
"""The height above ground from which people call."""
_WORST_SIGMA_RAD: Final = 1.0


def level_db(distance_m: Values, *, at_1_m_db: float | Values) -> Values:
    """Sound pressure level at a distance, in the open [dB re 20 uPa]."""
    distance_m = np.maximum(distance_m, 1.0)
    return np.asarray(at_1_m_db - 20 * np.log10(distance_m) - AIR_DB_PER_M * distance_m)


def wind_noise_db(airspeed_m_s: Values) -> Values:
    """The level of the noise that an airflow makes behind the windscreen."""
    v = np.maximum(airspeed_m_s, _LEAST_WIND_M_S)
    return np.asarray(40 * np.log10(v) - 23 * np.log10(_BAND_HZ * _SCREEN_M / v) + 15)


def power_sum_db(first_db: Values | float, second_db: Values) -> Values:
    return np.asarray(10 * np.log10(10 ** (np.asarray(first_db) / 10) + 10 ** (second_db / 10)))


class VoiceSensor(Sensor):
    """The microphone arrays of all UAVs, one for each."""

    kind = "voice"

    def __init__(self, scenario: Scenario, survivors: Survivors, solids: Solids) -> None:
        self._config = scenario.sensors
        self.period_ns = round(S / self._config.voice_hz)
        self._sigma_rad = math.radians(self._config.voice_sigma_deg)
        self._survivors, self._solids = survivors, solids
        self._wind = np.array([*scenario.world.wind_m_s, 0.0])
        self._buried_db = np.where(survivors.buried, self._config.burial_voice_db, 0.0)
        self._random = generator(scenario.seed, "voice")
        self._seed, self._begin_ns = scenario.seed, generator(scenario.seed, "calls").random(len(survivors.places)) * S
        self._second, self._drawn = -1, [self._begin_ns, self._begin_ns]
        """The last second that was asked for, and what was drawn for the one before and for it."""
        self._loudness_db = generator(scenario.seed, "loudness").normal(
            0.0, self._config.voice_loudness_db, len(survivors.places)
        )

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        config, places = self._config, self._survivors.places
        airspeed = np.linalg.norm(truth.velocity - self._wind, axis=1)
        noise_db = power_sum_db(config.voice_rotor_db, wind_noise_db(airspeed))
        calling = self._calling(truth.now_ns)
        for row in rows:
            offset = places - truth.at[row]
            loud_db = (
                config.voice_level_db + self._loudness_db + self._random.normal(0.0, config.voice_error_db, len(places))
            )
            level = level_db(np.linalg.norm(offset, axis=1), at_1_m_db=loud_db) - self._buried_db
            snr = level - noise_db[row] + config.voice_gain_db
            near = np.flatnonzero(calling & (snr >= config.voice_snr_db))
            if not len(near):
                continue
            mouths = places[near] + [0.0, 0.0, _MOUTH_M]
            walls = self._solids.blocked(np.broadcast_to(truth.at[row], mouths.shape), mouths) * WALL_DB
            calls = tuple(
                self._call(offset[index], float(level[index] - wall), float(snr[index] - wall))
                for index, wall in zip(near.tolist(), walls.tolist(), strict=True)
                if snr[index] - wall >= config.voice_snr_db
            )
            if calls:
                yield row, Voice(truth.now_ns, calls)

    def _calling(self, now_ns: int) -> Flags:
        """Who calls now; each one's seconds begin at an instant of its own."""
        if now_ns // S != self._second:
            self._second = now_ns // S
            self._drawn = [
                generator(self._seed, "calls", str(self._second + part)).random(len(self._begin_ns)) for part in (-1, 0)
            ]
        before, now = self._drawn
        return np.asarray(np.where(now_ns % S < self._begin_ns, before, now) < self._config.voice_share)

    def _call(self, offset: Values, level: float, snr: float) -> Call:
        sigma = min(_WORST_SIGMA_RAD, self._sigma_rad * math.pow(10.0, -snr / 20))
        direction = offset / max(1e-6, float(np.linalg.norm(offset)))
        return Call(*angles(shaken(self._random, direction, sigma)), level, snr)

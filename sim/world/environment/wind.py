"""Wind: a mean that is the same everywhere, and gusts by the Dryden model, independent for each UAV.

    sigma_w = 0.1 W20        sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4
    L_w = h                  L_u = L_v = h / (0.177 + 0.000823 h)^1.2                     h: height in feet, 10 to 1000
    u:    sigma sqrt(2 tau / pi) / (1 + tau s)                           tau = L / V, V: airspeed
    v, w: sigma sqrt(tau / pi) (1 + sqrt(3) tau s) / (1 + tau s)^2

The formulas are those of MIL-F-8785C (1980), 3.7.2, for low altitudes; W20 is the wind 20 feet above ground. u is along
the mean wind, w is upwards. Both filters are advanced exactly for a step of any length: u is an autoregression of first
order; v and w have two states each, whose covariance over a step is known in closed form. Not modeled: gusts that one
UAV meets after another, wind behind buildings and over hills, and a mean that grows with height.

The wind acts on bodies with rotors only: that engine moves them through this air (`engines/rotors/rigid_body.py`).
"""

import math
from typing import Final

import numpy as np

from sim.world.arrays import Rows, Values

_FOOT_M: Final = 0.3048
_LOWEST_FT: Final = 10.0
_HIGHEST_FT: Final = 1000.0
_LEAST_AIRSPEED_M_S: Final = 1.0
_ROOT3: Final = math.sqrt(3.0)


def intensities_m_s(height_m: Values, *, w20_m_s: float) -> tuple[Values, Values]:
    """Standard deviations of the gusts: along each horizontal axis, and upwards."""
    feet = _feet(height_m)
    up = np.full_like(feet, 0.1 * w20_m_s)
    return np.asarray(up / (0.177 + 0.000823 * feet) ** 0.4), up


def lengths_m(height_m: Values) -> tuple[Values, Values]:
    """Scale lengths of the gusts: along each horizontal axis, and upwards."""
    feet = _feet(height_m)
    return np.asarray(feet / (0.177 + 0.000823 * feet) ** 1.2 * _FOOT_M), feet * _FOOT_M


def _feet(height_m: Values) -> Values:
    return np.asarray(np.clip(np.asarray(height_m) / _FOOT_M, _LOWEST_FT, _HIGHEST_FT))


class Wind:
    """The velocity of the air at each UAV."""

    def __init__(
        self, random: np.random.Generator, count: int, *, mean_m_s: tuple[float, float], w20_m_s: float
    ) -> None:
        self._random = random
        self._w20 = w20_m_s
        self._mean = np.array([*mean_m_s, 0.0])
        speed = math.hypot(*mean_m_s)
        along = np.array([mean_m_s[0] / speed, mean_m_s[1] / speed]) if speed else np.array([1.0, 0.0])
        self._axes = np.array([[along[0], along[1], 0.0], [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
        self._state = random.normal(0.0, 1.0, (count, 5))
        """u; first and second state of v; the same of w; all for a standard deviation of 1."""
        self._state[:, [1, 3]] *= math.sqrt(0.5)
        self._state[:, [2, 4]] = 0.5 * self._state[:, [1, 3]] + math.sqrt(0.125) * random.normal(0, 1, (count, 2))

    def advance(self, dt_s: float, above_m: Values, velocity: Rows) -> Rows:
        """The wind after `dt_s`, for bodies so high above the ground [n] that fly at `velocity` [n, 3]."""
        if not self._w20:
            return np.broadcast_to(self._mean, velocity.shape)
        airspeed = np.maximum(np.linalg.norm(velocity - self._mean, axis=1), _LEAST_AIRSPEED_M_S)
        level_m, up_m = lengths_m(above_m)
        state, noise = self._state, self._random.normal(0.0, 1.0, (len(above_m), 5))
        kept = np.exp(-airspeed * dt_s / level_m)
        state[:, 0] = kept * state[:, 0] + np.sqrt(1 - kept * kept) * noise[:, 0]
        for first, length in ((1, level_m), (3, up_m)):
            self._advance_pair(first, airspeed * dt_s / length, noise[:, first : first + 2])
        gust = np.stack([state[:, 0], self._output(1), self._output(3)], axis=1)
        level, up = intensities_m_s(above_m, w20_m_s=self._w20)
        return np.asarray(self._mean + (gust * np.stack([level, level, up], axis=1)) @ self._axes)

    def _advance_pair(self, first: int, d: Values, noise: Values) -> None:
        """Two states in line, driven by white noise, over a time of d time constants."""
        one, two = self._state[:, first].copy(), self._state[:, first + 1]
        decay, twice = np.exp(-d), np.exp(-2 * d)
        q11 = (1 - twice) / 2
        q12 = (1 - twice * (1 + 2 * d)) / 4
        q22 = (1 - twice * (1 + 2 * d + 2 * d * d)) / 4
        root = np.sqrt(q11)
        across = q12 / np.maximum(root, 1e-12)
        rest = np.sqrt(np.maximum(q22 - across * across, 0.0))
        self._state[:, first] = decay * one + root * noise[:, 0]
        self._state[:, first + 1] = decay * (two + d * one) + across * noise[:, 0] + rest * noise[:, 1]

    def _output(self, first: int) -> Values:
        """(1 + sqrt(3) tau s) / (1 + tau s)^2 of the noise, by its two states."""
        return np.asarray(_ROOT3 * self._state[:, first] + (1 - _ROOT3) * self._state[:, first + 1])

"""Locates a phone by least squares over received powers, by the log-distance law (the method of the paper's rule).

    RSSI_i = P - L0 - 10 n log10(d_i)   ->   minimize over (east, north) the sum of (RSSI_i - predicted_i)^2

This is the classic RSS multilateration of Patwari et al., IEEE Signal Processing Magazine 22(4), 2005, with
Gauss-Newton steps from the power-weighted centroid. The paper names triangulation, but does not carry it out.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB
from fanet_mw.units import Enu

_STEPS: Final = 12
_MAX_STEP_M: Final = 80.0


class PowerReading(NamedTuple):
    """A reception of the phone by one node at a position."""

    position: Enu
    rssi_dbm: float


def estimate(readings: Sequence[PowerReading], *, phone_power_dbm: float, exponent: float) -> Enu:
    """The most likely place of a phone on the ground (up = 0); at least one reading is needed."""
    assert readings, "nobody heard the phone"
    east, north = _centroid(readings)
    if len(readings) < 3:
        return Enu(east, north, 0.0)
    slope = 10 * exponent / math.log(10)
    damping = 1e-3
    for _ in range(_STEPS):
        a = b = c = p = q = 0.0
        for position, rssi_dbm in readings:
            dx, dy = east - position.east, north - position.north
            d2 = max(1.0, dx * dx + dy * dy + position.up * position.up)
            residual = rssi_dbm - (phone_power_dbm - REFERENCE_LOSS_DB - 0.5 * slope * math.log(d2))
            jx, jy = slope * dx / d2, slope * dy / d2  # the negative derivative of the prediction
            a, b, c = a + jx * jx, b + jx * jy, c + jy * jy
            p, q = p - jx * residual, q - jy * residual
        a, c = a + damping, c + damping
        determinant = a * c - b * b
        if determinant <= 0:
            break
        step_east, step_north = (c * p - b * q) / determinant, (a * q - b * p) / determinant
        length = math.hypot(step_east, step_north)
        scale = _MAX_STEP_M / max(_MAX_STEP_M, length)
        east, north = east + scale * step_east, north + scale * step_north
        if length < 0.1:
            break
    return Enu(east, north, 0.0)


def _centroid(readings: Sequence[PowerReading]) -> tuple[float, float]:
    """The mean of the places, weighted by received power."""
    weights = [math.pow(10.0, rssi_dbm / 20) for _, rssi_dbm in readings]
    total = math.fsum(weights)
    east = math.fsum(w * s.position.east for w, s in zip(weights, readings, strict=True)) / total
    north = math.fsum(w * s.position.north for w, s in zip(weights, readings, strict=True)) / total
    return east, north

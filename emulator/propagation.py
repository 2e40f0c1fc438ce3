"""Received power over distance, and the links it makes. Distances in metres, powers in dBm and mW.

`range`         every frame within `range_m` is received at the transmit power, nothing beyond (ns-3's range model)
`log_distance`  P - L(1 m) - 10 n log10(d); audible from the sensitivity up, interfering from the floor up
Neither models: terrain, buildings, antenna patterns, fading, Doppler.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from emulator.jit import jit
from emulator.state import AUDIBLE, DELAY, LINK_DST, LINK_POWER, LINK_REALS, LINK_ROWS, LINK_SRC, Ints, Reals
from fanet_mw.scenario import Radio

SPEED_OF_LIGHT_M_S: Final = 299_792_458.0
THERMAL_DBM_PER_HZ: Final = -174.0
BANDWIDTH_HZ: Final = 22e6
"""DSSS channel width."""


def milliwatt(dbm: float) -> float:
    return math.pow(10.0, dbm / 10)


def noise_mw(radio: Radio) -> float:
    """Thermal noise in the channel plus the receiver's noise figure."""
    return milliwatt(THERMAL_DBM_PER_HZ + 10 * math.log10(BANDWIDTH_HZ) + radio.noise_figure_db)


def reach_m(radio: Radio) -> float:
    """Beyond this distance a station does not even interfere."""
    if radio.channel == "range":
        return radio.range_m
    budget_db = radio.tx_power_dbm - radio.reference_loss_db - radio.interference_floor_dbm
    return math.pow(10.0, budget_db / (10 * radio.exponent))


def received_dbm(distance_m: npt.NDArray[np.float64], radio: Radio) -> npt.NDArray[np.float64]:
    """Power at each distance; the law holds from 1 m on."""
    if radio.channel == "range":
        return np.full_like(distance_m, radio.tx_power_dbm)
    loss_db = radio.reference_loss_db + 10 * radio.exponent * np.log10(np.maximum(distance_m, 1.0))
    return np.asarray(radio.tx_power_dbm - loss_db, dtype=np.float64)


@jit
def pairs(at: Reals, reach: float, found: Ints, distance: Reals) -> int:
    """Ordered pairs of stations within reach, by source then destination; returns how many there are.

    Fills `found` (int64 [n, 2]) and `distance` as far as they go: with too little room, call again with more.
    """
    n = 0
    for a in range(at.shape[0]):
        for b in range(at.shape[0]):
            dx = at[a, 0] - at[b, 0]
            if a == b or dx > reach or dx < -reach:
                continue
            dy, dz = at[a, 1] - at[b, 1], at[a, 2] - at[b, 2]
            square = dx * dx + dy * dy + dz * dz
            if not square <= reach * reach:  # also when a position is not known yet
                continue
            if n < found.shape[0]:
                found[n, 0], found[n, 1] = a, b
                distance[n] = math.sqrt(square)
            n += 1
    return n


class Links:
    """All links of one set of positions, as the kernel's arrays, with room for `spare` more."""

    def __init__(self, at: npt.NDArray[np.float64], radio: Radio, *, spare: int) -> None:
        reach = reach_m(radio)
        room = 16 * len(at)
        while True:
            found = np.zeros((room, 2), np.int64)
            distance = np.zeros(room, np.float64)
            count = int(pairs(at, reach, found, distance))
            if count <= room:
                break
            room = count
        found, distance = found[:count], distance[:count]
        power_dbm = received_dbm(distance, radio)
        self.count = count
        self.ints = np.zeros((LINK_ROWS, count + spare + 1), np.int64)  # never empty: numba indexes it
        self.reals = np.zeros((LINK_REALS, count + spare + 1), np.float64)
        self.ints[LINK_SRC, :count] = found[:, 0]
        self.ints[LINK_DST, :count] = found[:, 1]
        self.ints[DELAY, :count] = np.rint(distance / SPEED_OF_LIGHT_M_S * 1e9)
        audible = power_dbm >= radio.sensitivity_dbm if radio.channel != "range" else np.ones(count, bool)
        self.ints[AUDIBLE, :count] = audible
        self.reals[LINK_POWER, :count] = np.power(10.0, power_dbm / 10)
        self.ptr = np.searchsorted(found[:, 0], np.arange(len(at) + 1)).astype(np.int64)

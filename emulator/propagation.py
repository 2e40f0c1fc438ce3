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
from fanet_mw.scenario_radio import Radio, is_ofdm

SPEED_OF_LIGHT_M_S: Final = 299_792_458.0
THERMAL_DBM_PER_HZ: Final = -174.0
DSSS_BANDWIDTH_HZ: Final = 22e6
OFDM_BANDWIDTH_HZ: Final = 20e6


def milliwatt(dbm: float) -> float:
    return math.pow(10.0, dbm / 10)


def noise_mw(radio: Radio) -> float:
    """Thermal noise in the channel plus the receiver's noise figure."""
    bandwidth_hz = OFDM_BANDWIDTH_HZ if is_ofdm(radio.rate_mbps) else DSSS_BANDWIDTH_HZ
    return milliwatt(THERMAL_DBM_PER_HZ + 10 * math.log10(bandwidth_hz) + radio.noise_figure_db)


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
def pairs(
    at: Reals, reach: float, column: Ints, keys: Ints, order: Ints, rows: int, found: Ints, distance: Reals
) -> int:
    """Ordered pairs of stations within reach, by source then destination; returns how many there are.

    `order` lists the stations by cell, `keys` the cells in that order: a neighbor is in the same cell or in one of
    eight around it, and three cells of one column are adjacent. Fills `found` (int64 [n, 2]) and `distance` as far as
    they go: with too little room, call again with more.
    """
    n = 0
    for a in range(at.shape[0]):
        first = n
        for side in range(-1, 2):
            cell = column[a] + side * rows
            i = np.searchsorted(keys, cell - 1)
            while i < keys.shape[0] and keys[i] <= cell + 1:
                b = order[i]
                i += 1
                dx, dy, dz = at[a, 0] - at[b, 0], at[a, 1] - at[b, 1], at[a, 2] - at[b, 2]
                square = dx * dx + dy * dy + dz * dz
                if a == b or not square <= reach * reach:
                    continue
                if n >= found.shape[0]:
                    n += 1
                    continue
                j = n
                while j > first and found[j - 1, 1] > b:  # in order of ids, whatever the cells
                    found[j, 1] = found[j - 1, 1]
                    distance[j] = distance[j - 1]
                    j -= 1
                found[n, 0] = a
                found[j, 1] = b
                distance[j] = math.sqrt(square)
                n += 1
    return n


def neighbors(at: npt.NDArray[np.float64], reach: float) -> tuple[Ints, Reals]:
    """Ordered pairs of stations within reach [n, 2], by source then destination, and their distances [m].

    Stations of unknown position (not finite) have no neighbors.
    """
    known = np.flatnonzero(np.isfinite(at).all(axis=1))
    if not len(known):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.float64)
    here = np.ascontiguousarray(at[known])
    east, north = np.floor((here[:, :2] - here[:, :2].min(axis=0)) / reach).astype(np.int64).T
    rows = int(north.max()) + 3  # one empty cell on either side: columns do not touch
    cell = east * rows + north
    order = np.argsort(cell, kind="stable")
    room = 32 * len(here)
    while True:
        found = np.zeros((room, 2), np.int64)
        distance = np.zeros(room, np.float64)
        count = int(pairs(here, reach, cell, cell[order], order, rows, found, distance))
        if count <= room:
            return known[found[:count]], distance[:count]
        room = count


class Links:
    """All links of one set of positions, as the kernel's arrays, with room for `spare` more."""

    def __init__(self, at: npt.NDArray[np.float64], radio: Radio, *, spare: int) -> None:
        found, distance = neighbors(at, reach_m(radio))
        nearest_first = np.lexsort((found[:, 1], distance, found[:, 0]))
        found, distance = found[nearest_first], distance[nearest_first]
        count = len(found)
        power_dbm = received_dbm(distance, radio)
        self.count = count
        self.ints = np.zeros((LINK_ROWS, count + spare + 1), np.int64)  # never empty: numba indexes it
        self.reals = np.zeros((LINK_REALS, count + spare + 1), np.float64)
        self.ints[LINK_SRC, :count] = found[:, 0]
        self.ints[LINK_DST, :count] = found[:, 1]
        self.ints[DELAY, :count] = np.rint(distance / SPEED_OF_LIGHT_M_S * 1e9)
        audible = power_dbm >= radio.sensitivity_dbm if radio.channel != "range" else np.ones(count, bool)
        self.ints[AUDIBLE, :count] = audible
        self.longest_ns = int((self.ints[DELAY] * self.ints[AUDIBLE]).max())
        """Delay of the longest audible link."""
        self.reals[LINK_POWER, :count] = np.power(10.0, power_dbm / 10)
        self.ptr = np.searchsorted(found[:, 0], np.arange(len(at) + 1)).astype(np.int64)

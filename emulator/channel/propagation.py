"""Links: which station receives which other one, and with what mean power, by their positions [m]. Powers in dBm and
mW.

    path loss of the channel (`link_budget.py`) -> shadowing (`shadowing.py`) -> obstruction -> links above the floor

The channel `range` is not physics: every frame within `range_m` is received at the transmit power, nothing farther away
(ns-3's range model), and nothing through an obstruction. Not modeled: antenna patterns but the gain of the post on the
ground, Doppler shift, interference over links below `interference_floor_dbm`, and delays of DIFS or more
(`longest_delay_ns`).
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from emulator.channel.link_budget import (
    audible_mw,
    carrier_sense_mw,
    energy_mw,
    reach_m,
    reach_with_gain_m,
    received_dbm,
)
from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from emulator.channel.shadowing import Shadowing
from emulator.kernel.jit import jit
from emulator.kernel.state import (
    AUDIBLE,
    DELAY,
    LINK_DST,
    LINK_POWER,
    LINK_REALS,
    LINK_ROWS,
    LINK_SRC,
    SPARED,
    Ints,
    Reals,
)
from fanet_mw.airtime import Timing
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.radio import Radio


@jit
def pairs(
    at: Reals, reach: float, column: Ints, keys: Ints, order: Ints, rows: int, found: Ints, distance: Reals
) -> int:
    """Ordered pairs in reach, into `found` (int64 [n, 2]) and `distance` as far as they have room; returns how many
    there are. `order` lists the stations by cell, `keys` their cells; three cells of one column are adjacent.
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
                while (
                    j > first and found[j - 1, 1] > b
                ):  # keeps the destinations ascending, whichever cells they are in
                    found[j, 1] = found[j - 1, 1]
                    distance[j] = distance[j - 1]
                    j -= 1
                found[n, 0] = a
                found[j, 1] = b
                distance[j] = math.sqrt(square)
                n += 1
    return n


def neighbors(at: npt.NDArray[np.float64], reach: float) -> tuple[Ints, Reals]:
    """Ordered pairs in reach [n, 2], by source then destination, and distances [m]; none for a place not finite."""
    known = np.flatnonzero(np.isfinite(at).all(axis=1))
    if not len(known):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.float64)
    here = np.ascontiguousarray(at[known])
    east, north = np.floor((here[:, :2] - here[:, :2].min(axis=0)) / reach).astype(np.int64).T
    rows = int(north.max()) + 3  # with an empty cell at either end, no column borders on the next one
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


_ROUNDING_DB: Final = 1e-9
"""A tolerance, so that rounding does not remove a link exactly as long as the reach."""
_UNKNOWN_EDGE_DB: Final = 20.0
"""The loss of an obstruction of which a foreign world does not say how much it costs."""


def gains_dbi(scenario: Scenario) -> Mapping[int, float]:
    """The gain of each station whose antenna is not isotropic: of the post on the ground."""
    gain_dbi, post = scenario.ground.gain_dbi, scenario.post
    return {post - 1: gain_dbi} if post is not None and gain_dbi else {}


def pairs_in_reach(at: Reals, radio: Radio, gains: Mapping[int, float]) -> tuple[Ints, Reals]:
    """Ordered pairs [n, 2] that may interfere, and distances; `gains` [dBi] of antennas that are not isotropic."""
    found, distance = neighbors(at, reach_m(radio))
    for station, gain_dbi in gains.items():
        if not np.isfinite(at[station]).all():
            continue
        away = np.linalg.norm(at - at[station], axis=1)
        far = np.flatnonzero((away > reach_m(radio)) & (away <= reach_with_gain_m(radio, gain_dbi)))
        both_ways = np.column_stack([np.full_like(far, station), far])
        found = np.concatenate([found, both_ways, both_ways[:, ::-1]])
        distance = np.concatenate([distance, away[far], away[far]])
    return found, distance


def longest_delay_ns(radio: Radio) -> int:
    """The greatest delay of a link: less than DIFS, the least time between two frames of a station, so that a link
    carries one frame at a time. This is exact up to 8 km (`g` with short slots), 10 km (`a`) or 15 km; 802.11 is not
    made for more.
    """
    return Timing.of(radio).difs_ns - 1


class Blocked(NamedTuple):
    """The obstructed pairs."""

    codes: Ints
    """Their `pair_codes`, ascending."""
    each_db: Reals
    """The loss of each; empty: that of the scenario."""

    def losses_db(self, codes: Ints, radio: Radio) -> Reals:
        """The losses of links by their codes; infinite for obstructed ones of the channel `range`."""
        place = np.minimum(np.searchsorted(self.codes, codes), len(self.codes) - 1)
        lost = self.codes[place] == codes
        if radio.channel == "range":
            return np.where(lost, np.inf, 0.0)
        if len(self.each_db):
            return np.where(lost, self.each_db[place], 0.0)
        known = _UNKNOWN_EDGE_DB if radio.obstruction_loss_db == "knife_edge" else radio.obstruction_loss_db
        return np.where(lost, known, 0.0)


class LinkTable:
    """All links of one set of positions, as the kernel's arrays, with room for `spare` more."""

    def __init__(
        self,
        at: Reals,
        radio: Radio,
        *,
        spare: int,
        ground_m: Reals | float = 0.0,
        shadowing: Shadowing | None = None,
        blocked: Blocked | None = None,
        gains: Mapping[int, float] = {},
    ) -> None:
        """`ground_m`: below each station. `gains` [dBi]: of antennas that are not isotropic, by station."""
        found, distance = pairs_in_reach(at, radio, gains)
        above = np.column_stack([at[:, :2], at[:, 2] - ground_m])
        power_dbm = received_dbm(distance, above[found[:, 0]], above[found[:, 1]], radio)
        for station, gain_dbi in gains.items() if radio.channel != "range" else ():
            power_dbm = power_dbm + gain_dbi * (found == station).any(axis=1)
        if shadowing is not None:
            power_dbm = power_dbm - shadowing.loss_db(at, found, distance)
        lost_db = np.zeros(len(found))
        if blocked is not None and len(blocked.codes):
            lost_db = blocked.losses_db(pair_codes(found, len(at)), radio)
        if radio.channel == "range":
            kept = lost_db == 0
        else:
            power_dbm = power_dbm - lost_db
            kept = power_dbm >= radio.interference_floor_dbm - _ROUNDING_DB
        if not kept.all():
            found, distance, power_dbm = found[kept], distance[kept], power_dbm[kept]
        nearest_first = np.lexsort((found[:, 1], distance, found[:, 0]))
        found, distance, power_dbm = found[nearest_first], distance[nearest_first], power_dbm[nearest_first]
        self._fill(found, distance, power_dbm, radio, stations=len(at), spare=spare)

    def _fill(self, found: Ints, distance: Reals, power_dbm: Reals, radio: Radio, *, stations: int, spare: int) -> None:
        count = len(found)
        self.count = count
        self.ints = np.zeros((LINK_ROWS, count + spare + 1), np.int64)  # one column at least, because numba indexes it
        self.reals = np.zeros((LINK_REALS, count + spare + 1), np.float64)
        self.ints[LINK_SRC, :count] = found[:, 0]
        self.ints[LINK_DST, :count] = found[:, 1]
        delay_ns = np.rint(distance / SPEED_OF_LIGHT_M_S * 1e9)
        self.ints[DELAY, :count] = np.minimum(delay_ns, longest_delay_ns(radio))
        power_mw = np.power(10.0, power_dbm / 10)
        if radio.channel == "range":
            audible = matters = np.ones(count, bool)
        else:
            audible = power_mw >= audible_mw(radio)
            matters = audible | (power_mw >= carrier_sense_mw(radio))
        self.ints[AUDIBLE, :count] = audible
        only_those = radio.fading == "none" and energy_mw(radio) == math.inf
        self.longest_ns = int((self.ints[DELAY, :count] * (matters if only_those else 1)).max(initial=0))
        """The delay of the longest link that is heard or sensed, or of any if fading or sums can raise it."""
        self.reals[LINK_POWER, :count] = power_mw
        self.reals[SPARED, :count] = 1.0
        self.ptr = np.searchsorted(found[:, 0], np.arange(stations + 1)).astype(np.int64)

    def sort_dead_last(self) -> None:
        """Sort links without power behind their transmitter's others, which stay in the order of distance."""
        used = slice(self.count)
        dead = self.reals[LINK_POWER, used] == 0.0
        if dead.any():
            order = np.lexsort((dead, self.ints[LINK_SRC, used]))  # the sort is stable: links with power stay in order
            self.ints[:, used] = self.ints[:, used][:, order]
            self.reals[:, used] = self.reals[:, used][:, order]


def pair_codes(found: Ints, stations: int) -> Ints:
    """One number for each pair [n, 2] of stations, the same for both directions."""
    return np.asarray(np.minimum(*found.T) * stations + np.maximum(*found.T), dtype=np.int64)

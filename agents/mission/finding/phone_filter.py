"""Where a phone is: the posterior over a grid, given received powers, of a phone whose own power is not known either.

    RSSI_i = P + b - L0 - 10 n log10(d_i) + shadowing_i,   b ~ N(0, s_b^2),   shadowing ~ N(0, s^2)
    nothing heard at i:   P(RSSI_i < threshold)

The offset b (burial, antenna, battery) is integrated out in closed form, so a cell needs only the sums of the residuals
and of their squares. A histogram filter as in Thrun, Burgard, Fox: Probabilistic Robotics, 2005, chapter 4: no starting
point, and the mirror image that a straight flight leaves open stays in the posterior until a sample resolves it.
What phones of known places have told of the offset that is common to all shifts and widens that of this one.
Once the owner has been seen, the place is that of the sightings.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import compress
from operator import add, mul
from typing import Final, NamedTuple

from fanet_mw.units import Enu

REFERENCE_LOSS_DB: Final = 40.05
"""Free-space loss at 1 m and 2.4 GHz."""
_CELL_M: Final = 20.0
_HALF_CELLS: Final = 16
"""The grid reaches this many cells to each side of the place from which the phone was first heard."""
_WIDTH: Final = 2 * _HALF_CELLS + 1
_EVERY_CELL: Final = (True,) * (_WIDTH * _WIDTH)
_OFF_CENTER_M: Final = 120.0
"""The grid is laid anew when the strongest sample is this far from its middle."""
DOUBT: Final = 1.5
"""Samples near each other share shadowing, so that each counts for less than an independent one."""
_SILENCE_M: Final = 450.0
"""Silence at a place farther than this from where a phone was heard tells nothing."""
_NEVER: Final = 0.02
"""This share of phones is not heard however near: a receiver misses them, or rubble lies between."""
_STEP_M: Final = 5.0
_SAME_PLACE_M: Final = 25.0
"""Two samples of one node nearer than this share their shadowing, and count as one."""


class Estimate(NamedTuple):
    """An estimated place on the ground, with its covariance."""

    east_m: float
    north_m: float
    east_variance_m2: float
    covariance_m2: float
    north_variance_m2: float

    @property
    def sigma_m(self) -> float:
        """The standard deviation along the worst axis."""
        mean = (self.east_variance_m2 + self.north_variance_m2) / 2
        half = (self.east_variance_m2 - self.north_variance_m2) / 2
        return math.sqrt(mean + math.hypot(half, self.covariance_m2))

    @property
    def at(self) -> Enu:
        """The place itself."""
        return Enu(self.east_m, self.north_m, 0.0)

    def distance_m(self, place: Enu) -> float:
        """The distance of a place from this one, along the ground."""
        return math.hypot(self.east_m - place.east, self.north_m - place.north)


class PhoneModel(NamedTuple):
    """What is known of all phones before any is heard."""

    power_dbm: float
    exponent: float
    shadowing_db: float
    offset_db: float
    """Standard deviation of a phone's own offset."""
    threshold_dbm: float
    """The least power that is heard."""
    half_m: float = math.inf
    """No survivor is farther east, west, north or south of the middle than this."""


class PhoneOffset(NamedTuple):
    """What is known of the offset that is common to the phones of a swarm's search and to its receivers."""

    mean_db: float
    sigma_db: float
    """The standard deviation that is left, beside that of each phone's own offset."""


AS_ASSUMED: Final = PhoneOffset(0.0, 0.0)
"""Phones are taken to be as the model says: nothing is known of them yet."""


class PhoneFilter:
    """The posterior of one phone's place."""

    def __init__(self, model: PhoneModel, offset: PhoneOffset = AS_ASSUMED) -> None:
        """`offset`: what is known of the offset common to all phones."""
        self._assumed, self._model = model, _calibrated(model, offset)
        self._middle: Enu | None = None
        self._silent_at: list[Enu] = []
        self._scores: list[float] = []
        """For each cell, twice the logarithm of how likely the silence was."""
        self._totals: list[float] = []
        """For each cell, twice the logarithm of the posterior, up to a constant."""
        self._best = 0.0
        """The greatest of these totals within the area."""
        self._samples: list[tuple[Enu, float | None]] = []
        """The places of samples with the received powers; None: nothing was heard there."""
        self._pending: list[tuple[Enu, float | None]] = []
        """The samples that the cells do not reckon with yet; they are taken in when an estimate is asked for."""
        self._sums: list[float] = []
        self._squares: list[float] = []
        self._count = 0
        self._taken: dict[int, list[Enu]] = {}
        self._estimate: Estimate | None = None
        self._seen: Estimate | None = None
        """The place at which the owner has been seen."""

    # --- measurements ---------------------------------------------------------------------------------------------

    def on_rssi(self, reporter: int, position: Enu, rssi_dbm: float) -> bool:
        """Take in a power received at a place; False when it tells nothing new."""
        taken = self._taken.setdefault(reporter, [])
        if any(_ground_m(p, position) < _SAME_PLACE_M for p in taken):
            return False
        taken.append(position)
        if self._middle is None:
            self._middle = position
        self._pending.append((position, rssi_dbm))
        return True

    def on_silence(self, position: Enu) -> None:
        """Take in that the receiver of this UAV heard nothing at a place."""
        if self._middle is None or not self.near(position, within_m=_SILENCE_M):
            return
        if any(_ground_m(p, position) < _SAME_PLACE_M for p in self._silent_at):
            return
        self._silent_at.append(position)
        self._pending.append((position, None))

    def on_sighting(self, place: Estimate | None) -> None:
        """Take in where a camera shows the owner; None: no person in view is the owner."""
        self._seen = place

    def calibrate(self, offset: PhoneOffset) -> None:
        """Take in what is known now of the offset common to all phones; what was heard is reckoned with anew."""
        model = _calibrated(self._assumed, offset)
        if model != self._model:
            self._model, self._sums = model, []

    @property
    def is_seen(self) -> bool:
        return self._seen is not None

    @property
    def pending(self) -> int:
        """The number of received powers that the estimate does not reckon with yet."""
        return sum(1 for _, rssi_dbm in self._pending if rssi_dbm is not None)

    @property
    def samples(self) -> int:
        """The number of received powers that have been taken in."""
        return self._count

    @property
    def readings(self) -> list[tuple[Enu, float]]:
        """The received powers with their places, in the order in which they came."""
        return [(at, rssi_dbm) for at, rssi_dbm in (*self._samples, *self._pending) if rssi_dbm is not None]

    # --- the estimate ---------------------------------------------------------------------------------------------

    def estimate(self) -> Estimate | None:
        """The mean and the covariance of the place; None before anything was measured."""
        return self._seen or self.heard_from()

    def heard_from(self) -> Estimate | None:
        """The same estimate by received powers alone, without sightings."""
        self._catch_up()
        return self._estimate

    def _catch_up(self) -> None:
        """Take in what has been heard since the last time; lay the grid anew when its middle was a bad guess."""
        if not self._pending and (self._sums or not self._samples):
            return
        assert self._middle is not None, "something was heard before anything is pending"
        self._samples += self._pending
        fresh, self._pending = self._pending, []
        strongest = max((s for s in self._samples if s[1] is not None), key=lambda s: s[1] or 0.0)[0]
        if not self._sums or _ground_m(self._middle, strongest) > _OFF_CENTER_M:
            self._middle, fresh, self._count = strongest, self._samples, 0
            cells = _WIDTH * _WIDTH
            self._sums, self._squares, self._scores = [0.0] * cells, [0.0] * cells, [0.0] * cells
        for position, rssi_dbm in fresh:
            if rssi_dbm is None:
                self._rule_out(position)
            else:
                self._update(position, rssi_dbm)
                self._count += 1
        self._estimate = self._moments()

    def deficit(self, east_m: float, north_m: float) -> float:
        """How much less likely a place is than the best one: twice the difference of the logarithms."""
        self._catch_up()
        if self._middle is None or not self._totals:
            return 0.0
        i = round((east_m - self._middle.east) / _CELL_M) + _HALF_CELLS
        j = round((north_m - self._middle.north) / _CELL_M) + _HALF_CELLS
        if not (0 <= i <= 2 * _HALF_CELLS and 0 <= j <= 2 * _HALF_CELLS):
            return math.inf
        return self._best - self._totals[j * _WIDTH + i]

    def near(self, place: Enu, *, within_m: float) -> bool:
        """True if the phone was first heard within a distance of a place, or has only been seen; cheap to ask."""
        middle = self._middle
        return middle is None or _ground_m(middle, place) <= within_m

    def _update(self, position: Enu, rssi_dbm: float) -> None:
        assert self._middle is not None, "the grid lies around the first sample"
        model = self._model
        expected_at_1_m = model.power_dbm - REFERENCE_LOSS_DB
        slope = 5 * model.exponent / math.log(10)  # per natural logarithm of the squared distance
        residual_at_1_m = rssi_dbm - expected_at_1_m
        up2 = max(1.0, position.up * position.up)
        log, distances2 = math.log, _squared_distances_m2(self._middle, position, up2)
        residuals = [residual_at_1_m + slope * log(distance2) for distance2 in distances2]
        self._sums = list(map(add, self._sums, residuals))
        self._squares = list(map(add, self._squares, map(mul, residuals, residuals)))

    def _rule_out(self, position: Enu) -> None:
        """Make the cells less likely from which the phone would have been heard."""
        assert self._middle is not None, "the grid lies around the first sample"
        table = _silence_scores(self._model)
        most, sqrt = len(table) - 1, math.sqrt
        up2 = position.up * position.up
        steps = [int(sqrt(d2) / _STEP_M) for d2 in _squared_distances_m2(self._middle, position, up2)]
        if max(steps) > most:
            steps = [min(most, step) for step in steps]
        self._scores = list(map(add, self._scores, map(table.__getitem__, steps)))

    def _inside(self) -> Sequence[bool]:
        """The cells that are in the area; all cells when none is."""
        assert self._middle is not None, "the grid lies around a sample"
        half = self._model.half_m + _CELL_M / 2
        if max(abs(self._middle.east), abs(self._middle.north)) + _HALF_CELLS * _CELL_M <= half:
            return _EVERY_CELL
        east = [abs(self._middle.east + (i - _HALF_CELLS) * _CELL_M) <= half for i in range(_WIDTH)]
        north = [abs(self._middle.north + (j - _HALF_CELLS) * _CELL_M) <= half for j in range(_WIDTH)]
        found = [row and column for row in north for column in east]
        return found if any(found) else _EVERY_CELL

    def _moments(self) -> Estimate:
        assert self._middle is not None, "only what was heard has moments"
        model = self._model
        per = 1 / (DOUBT * max(model.shadowing_db, 1.0) ** 2)
        shrink = per * per / (per * self._count + 1 / max(model.offset_db, 0.1) ** 2)
        scores = [
            shrink * s * s - per * q + silence
            for s, q, silence in zip(self._sums, self._squares, self._scores, strict=True)
        ]
        self._totals = scores
        possible = self._inside()
        self._best = best = max(compress(scores, possible))
        total = mean_i = mean_j = ii = ij = jj = 0.0
        exp, least = math.exp, best - 40.0
        for at in [at for at, score in enumerate(scores) if score >= least]:
            if not possible[at]:
                continue
            weight = exp(0.5 * (scores[at] - best))
            j, i = divmod(at, _WIDTH)
            total += weight
            mean_i += weight * i
            mean_j += weight * j
            ii += weight * i * i
            ij += weight * i * j
            jj += weight * j * j
        mean_i, mean_j = mean_i / total, mean_j / total
        cell2 = _CELL_M * _CELL_M
        quantized = 1 / 12
        return Estimate(
            self._middle.east + (mean_i - _HALF_CELLS) * _CELL_M,
            self._middle.north + (mean_j - _HALF_CELLS) * _CELL_M,
            (max(0.0, ii / total - mean_i * mean_i) + quantized) * cell2,
            (ij / total - mean_i * mean_j) * cell2,
            (max(0.0, jj / total - mean_j * mean_j) + quantized) * cell2,
        )


def _ground_m(a: Enu, b: Enu) -> float:
    return math.hypot(a.east - b.east, a.north - b.north)


def _squared_distances_m2(middle: Enu, position: Enu, up2: float) -> list[float]:
    """The squared distance of every cell of the grid around `middle` from a position; `up2` is that of its height."""
    west = middle.east - _HALF_CELLS * _CELL_M - position.east
    south = middle.north - _HALF_CELLS * _CELL_M - position.north
    span = range(_WIDTH)
    east2 = [(west + i * _CELL_M) ** 2 for i in span]
    return [squared + rest for rest in [(south + j * _CELL_M) ** 2 + up2 for j in span] for squared in east2]


def _calibrated(model: PhoneModel, offset: PhoneOffset) -> PhoneModel:
    """The model of phones whose common offset is known so well."""
    return model._replace(
        power_dbm=model.power_dbm + offset.mean_db, offset_db=math.hypot(model.offset_db, offset.sigma_db)
    )


@lru_cache(maxsize=64)
def _silence_scores(model: PhoneModel) -> tuple[float, ...]:
    """Twice the logarithm of the probability that a phone is not heard, for distances in steps."""
    sigma = math.hypot(max(model.shadowing_db, 1.0), model.offset_db)
    scores = []
    for step in range(200):
        distance_m = max(1.0, (step + 0.5) * _STEP_M)
        margin = model.power_dbm - REFERENCE_LOSS_DB - 10 * model.exponent * math.log10(distance_m)
        chance = 0.5 * math.erfc((margin - model.threshold_dbm) / (sigma * math.sqrt(2)))
        scores.append(2 / DOUBT * math.log(max(chance, _NEVER)))
    return tuple(scores)

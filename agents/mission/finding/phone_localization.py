"""Where a phone is: the posterior probability of each cell of a grid, given the powers received from the phone.

    RSSI_i = P + b - L0 - 10 n log10(d_i) + shadowing_i,   b ~ N(0, s_b^2),   shadowing_i ~ N(0, s^2)

    RSSI_i    power that a UAV receives at place i [dBm]; if it receives nothing there, RSSI_i < threshold
    P, L0, n  assumed transmit power [dBm], path loss at 1 m [dB], path loss exponent
    b         offset of this phone's power, by burial, antenna and battery [dB]
    d_i       distance of the phone from place i [m]

Shadowing at places near each other is nearly the same (Gudmundson, 1991), so each power is compared with what those
received nearest to its place let expect (Vecchia, Journal of the Royal Statistical Society B 50(2), 1988): residuals
are whitened, one after the other, and b is integrated out in closed form. The filter is a histogram filter (Thrun,
Burgard, Fox: Probabilistic Robotics, 2005, chapter 4): both sides of a straight course stay probable until a power from
elsewhere excludes one. A place without reception counts for less the more there are beside it (`_news`): taken as
independent, the many in one shadow drive an estimate to the edge of the area. `calibration.py` estimates an offset
common to all phones; a recognized owner's position replaces the estimate.
"""

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import compress
from operator import add, mul, sub
from typing import Final, NamedTuple

from fanet_mw.units import Enu

REFERENCE_LOSS_DB: Final = 40.05
"""Free-space loss at 1 m and 2.4 GHz."""
CELL_M: Final = 25.0
_HALF_CELLS: Final = 18
"""The grid reaches this many cells to each side of its middle, which is at most `_OFF_CENTER_M` away from the place of
the strongest received power: where shadowing is weak, a phone is first received from up to 400 m."""
_WIDTH: Final = 2 * _HALF_CELLS + 1
_EVERY_CELL: Final = (True,) * (_WIDTH * _WIDTH)
_NUMBERS: Final = tuple(map(float, range(_WIDTH)))
"""The number of each column, or row, of cells."""
_SQUARES: Final = tuple(number * number for number in _NUMBERS)
_OFF_CENTER_M: Final = 120.0
"""A new grid is made when the strongest power was received farther than this from the middle of the present one."""
_CORRELATION_M: Final = 50.0
"""The distance over which the correlation of shadowing falls to 1 / e."""
_READING_DB: Final = 2.5
"""The standard deviation of one reading at a place: fast fading and the receiver's own error."""
_COMPARED: Final = 4
"""The number of earlier powers, those from the nearest places, with which a power is compared."""
_COMPARED_M: Final = 150.0
"""Powers from places farther away than this are independent of it."""
_SILENCE_M: Final = 450.0
"""A place without reception is ignored if it is farther than this from the middle of the grid."""
_NEVER: Final = 0.02
"""The least probability that a phone is not received, however near: missed, or under rubble."""
_OVERLOOKED: Final = 0.03
"""The probability that cameras that have looked at a place have not seen who lies there."""
_CONSIDERED: Final = 16.0
"""`estimate_elsewhere` leaves out places less probable than the most probable one by more than this (twice a log)."""
_STEP_M: Final = 5.0
"""The step of distance in the table of probabilities without reception."""
_VAGUE_M: Final = 50.0
"""The greatest standard deviation of an estimate that is not vague."""
_SAME_PLACE_M: Final = 25.0
"""Two samples of one node nearer to each other than this share their shadowing; the later one is ignored."""


class Estimate(NamedTuple):
    """An estimated position on the ground, with its covariance."""

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
    def is_vague(self) -> bool:
        """True for an estimate too inexact to look for the survivor there: more powers have to be received first."""
        return self.sigma_m > _VAGUE_M

    @property
    def at(self) -> Enu:
        return Enu(self.east_m, self.north_m, 0.0)

    def distance_m(self, place: Enu) -> float:
        return math.hypot(self.east_m - place.east, self.north_m - place.north)


class PhoneModel(NamedTuple):
    """The assumptions about all phones before any has been received."""

    power_dbm: float
    exponent: float
    shadowing_db: float
    offset_db: float
    """The standard deviation of a phone's own offset."""
    threshold_dbm: float
    """The least power that a receiver detects."""
    half_m: float = math.inf
    """Half the side of the square area, whose middle is the origin and in which all survivors lie."""


class PhoneOffset(NamedTuple):
    """The normal distribution of the offset that all phones have in common, receivers' calibration included."""

    mean_db: float
    sigma_db: float
    """The standard deviation of the common offset, without each phone's own (`PhoneModel.offset_db`)."""


AS_ASSUMED: Final = PhoneOffset(0.0, 0.0)
"""The common offset while phones are taken to be as the model says."""


class PhoneFilter:
    """The posterior of one phone's place, given samples: powers received at places, and places without reception."""

    def __init__(self, model: PhoneModel, offset: PhoneOffset = AS_ASSUMED) -> None:
        self._assumed, self._model = model, _calibrated(model, offset)
        self._middle: Enu | None = None
        """The middle of the grid; before the first estimate, the place at which the phone was first received."""
        self._silent_at: dict[Enu, float] = {}
        """The places without reception, those that wait in `_pending` included, and how much each tells (`_news`)."""
        self._scores: list[float] = []
        """For each cell, twice the logarithm of the likelihood of the places without reception."""
        self._totals: list[float] = []
        """For each cell, twice the logarithm of the posterior, up to a constant."""
        self._best = 0.0
        """The greatest of `_totals` within the area."""
        self._samples: list[tuple[Enu, float | None]] = []
        """The samples that the cells include: each place with the power received there, or None for no reception."""
        self._pending: list[tuple[Enu, float | None]] = []
        """The samples that the cells do not include yet; they are added when an estimate is asked for."""
        self._sums: list[float] = []
        """For each cell, the sum of the whitened residuals, each times what the offset adds to it."""
        self._squares: list[float] = []
        """For each cell, the sum of the squared whitened residuals."""
        self._gains = 0.0
        """The sum of the squares of what an offset of 1 dB adds to the whitened residuals."""
        self._received: list[tuple[Enu, float]] = []
        """The received powers that the cells include."""
        self.included_powers = 0
        self._taken: dict[int, list[Enu]] = {}
        """For each node, the places at which it received the phone."""
        self._estimate: Estimate | None = None
        self._seen: Estimate | None = None

    # --- measurements ---------------------------------------------------------------------------------------------

    def on_rssi(self, reporter: int, position: Enu, rssi_dbm: float) -> bool:
        """Take in a power received at a place; False if ignored: the same node has received near there before."""
        taken = self._taken.setdefault(reporter, [])
        if _is_sampled(position, taken):
            return False
        taken.append(position)
        if self._middle is None:
            self._middle = position
        self._pending.append((position, rssi_dbm))
        return True

    def on_silence(self, position: Enu) -> None:
        """The phone was not detected here; ignored far from the grid's middle, or near another such place."""
        if self._middle is None or not self.near(position, within_m=_SILENCE_M):
            return
        if _is_sampled(position, self._silent_at):
            return
        self._silent_at[position] = _news(position, self._silent_at)
        self._pending.append((position, None))

    def on_sighting(self, place: Estimate | None) -> None:
        """Take in the position of the person who is the phone's owner; None: no person is recognized as the owner."""
        self._seen = place

    def calibrate(self, offset: PhoneOffset) -> None:
        """Assume a new offset common to all phones; if it changes the model, the cells are computed anew."""
        model = _calibrated(self._assumed, offset)
        if model != self._model:
            self._model, self._sums = model, []

    @property
    def is_seen(self) -> bool:
        return self._seen is not None

    @property
    def half_m(self) -> float:
        """Half the side of the square area in which the phone is (`PhoneModel.half_m`)."""
        return self._model.half_m

    @property
    def received_powers(self) -> int:
        """The number of received powers, also of those that the cells do not include yet."""
        return sum(map(len, self._taken.values()))

    @property
    def readings(self) -> list[tuple[Enu, float]]:
        return [(at, rssi_dbm) for at, rssi_dbm in (*self._samples, *self._pending) if rssi_dbm is not None]

    # --- the estimate ---------------------------------------------------------------------------------------------

    def estimate(self) -> Estimate | None:
        """The owner's position if recognized, otherwise the estimate by power; None before the phone was received."""
        return self._seen or self.estimate_by_power()

    def estimate_by_power(self) -> Estimate | None:
        """The mean and the covariance of the posterior, without sightings; None before the phone was received."""
        self._catch_up()
        return self._estimate

    def estimate_elsewhere(self, has_shown: Callable[[float, float], bool]) -> Estimate:
        """The estimate by power, which there must be, if cameras have seen nobody at some places (`_OVERLOOKED`)."""
        points = [
            (math.exp(-deficit / 2) * (_OVERLOOKED if has_shown(east_m, north_m) else 1.0), east_m, north_m)
            for east_m, north_m, deficit in self.likely_cells(_CONSIDERED)
        ]
        return weighted(points, grain_m=CELL_M)

    def _catch_up(self) -> None:
        """Add the pending samples, in a new grid if the model or the place of the strongest power has changed."""
        if not self._pending and (self._sums or not self._samples):
            return
        assert self._middle is not None, "a place without reception is a sample only after the first reception"
        self._samples += self._pending
        fresh, self._pending = self._pending, []
        strongest = max((s for s in self._samples if s[1] is not None), key=lambda s: s[1] or 0.0)[0]
        if not self._sums or _ground_m(self._middle, strongest) > _OFF_CENTER_M:
            self._middle, fresh, self.included_powers = strongest, self._samples, 0
            self._gains, self._received = 0.0, []
            cells = _WIDTH * _WIDTH
            self._sums, self._squares, self._scores = [0.0] * cells, [0.0] * cells, [0.0] * cells
        for position, rssi_dbm in fresh:
            if rssi_dbm is None:
                self._rule_out(position)
            else:
                self._update(position, rssi_dbm)
                self.included_powers += 1
        self._estimate = self._moments()

    def deficit(self, east_m: float, north_m: float) -> float:
        """Twice the log of the best cell's probability over this place's, interpolated between cells; 0 before any
        reception, inf off the grid.
        """
        self._catch_up()
        if self._middle is None or not self._totals:
            return 0.0
        last, totals = 2 * _HALF_CELLS, self._totals
        x = (east_m - self._middle.east) / CELL_M + _HALF_CELLS
        y = (north_m - self._middle.north) / CELL_M + _HALF_CELLS
        if not (-0.5 <= x <= last + 0.5 and -0.5 <= y <= last + 0.5):
            return math.inf
        i, j = min(last - 1, max(0, int(x))), min(last - 1, max(0, int(y)))
        x, y = min(1.0, max(0.0, x - i)), min(1.0, max(0.0, y - j))
        south = (1 - x) * totals[at := j * _WIDTH + i] + x * totals[at + 1]
        north = (1 - x) * totals[at + _WIDTH] + x * totals[at + _WIDTH + 1]
        return self._best - (1 - y) * south - y * north

    def likely_cells(self, most_deficit: float) -> Iterator[tuple[float, float, float]]:
        """East, north and `deficit` of each cell whose deficit is at most this; none before reception."""
        self._catch_up()
        if self._middle is None:
            return
        west, south = self._middle.east - _HALF_CELLS * CELL_M, self._middle.north - _HALF_CELLS * CELL_M
        possible = _inside(self._middle, self._model.half_m + CELL_M / 2)
        for cell, (total, inside) in enumerate(zip(self._totals, possible, strict=False)):
            if inside and self._best - total <= most_deficit:
                yield west + cell % _WIDTH * CELL_M, south + cell // _WIDTH * CELL_M, self._best - total

    def near(self, place: Enu, *, within_m: float) -> bool:
        """True if the grid's middle is that near, or without reception; needs no cells, so callers ask it first."""
        middle = self._middle
        return middle is None or _ground_m(middle, place) <= within_m

    def _update(self, position: Enu, rssi_dbm: float) -> None:
        assert self._middle is not None, "the grid has a middle before samples are added"
        middle, model = self._middle, self._model
        compared = sorted((_ground_m(at, position), at, dbm) for at, dbm in self._received)[:_COMPARED]
        beside = [(at, dbm) for away_m, at, dbm in compared if away_m <= _COMPARED_M]
        weights, sigma_db = _expectation(position, [at for at, _ in beside], model.shadowing_db)
        residuals: Iterable[float] = _residuals_db(middle, position, rssi_dbm, model)
        for weight, (at, dbm) in zip(weights, beside, strict=True):
            residuals = map(sub, residuals, [weight * off for off in _residuals_db(middle, at, dbm, model)])
        whitened = [off / sigma_db for off in residuals]
        gain = (1 - math.fsum(weights)) / sigma_db
        self._sums = [total + gain * off for total, off in zip(self._sums, whitened, strict=True)]
        self._squares = list(map(add, self._squares, map(mul, whitened, whitened)))
        self._gains += gain * gain
        self._received.append((position, rssi_dbm))

    def _rule_out(self, position: Enu) -> None:
        """Multiply the likelihood of each cell by the probability that a phone there is not received at a place."""
        assert self._middle is not None, "the grid has a middle before samples are added"
        news = self._silent_at[position]
        table = [news * score for score in _silence_scores(self._model)]
        most, sqrt = len(table) - 1, math.sqrt
        up2 = position.up * position.up
        steps = [int(sqrt(d2) / _STEP_M) for d2 in _squared_distances_m2(self._middle, position, up2)]
        if max(steps) > most:
            steps = [min(most, step) for step in steps]
        self._scores = list(map(add, self._scores, map(table.__getitem__, steps)))

    def _moments(self) -> Estimate:
        assert self._middle is not None, "the grid has a middle before its cells are used"
        model = self._model
        shrink = 1 / (self._gains + 1 / max(model.offset_db, 0.1) ** 2)
        scores = [
            shrink * s * s - q + silence for s, q, silence in zip(self._sums, self._squares, self._scores, strict=True)
        ]
        self._totals = scores
        possible = _inside(self._middle, model.half_m + CELL_M / 2)
        self._best = best = max(compress(scores, possible))
        exp, least = math.exp, best - 40.0
        weights = [exp(0.5 * (score - best)) if score >= least else 0.0 for score in scores]
        if possible is not _EVERY_CELL:
            weights = list(map(mul, weights, possible))
        rows = [weights[first : first + _WIDTH] for first in range(0, len(weights), _WIDTH)]
        by_column, by_row = list(map(math.fsum, zip(*rows, strict=True))), list(map(math.fsum, rows))
        total = math.fsum(by_row)
        mean_i, mean_j = _product(by_column, _NUMBERS) / total, _product(by_row, _NUMBERS) / total
        ii, jj = _product(by_column, _SQUARES) / total, _product(by_row, _SQUARES) / total
        ij = _product([_product(row, _NUMBERS) for row in rows], _NUMBERS) / total
        cell2 = CELL_M * CELL_M
        quantized = 1 / 12
        return Estimate(
            self._middle.east + (mean_i - _HALF_CELLS) * CELL_M,
            self._middle.north + (mean_j - _HALF_CELLS) * CELL_M,
            (max(0.0, ii - mean_i * mean_i) + quantized) * cell2,
            (ij - mean_i * mean_j) * cell2,
            (max(0.0, jj - mean_j * mean_j) + quantized) * cell2,
        )


def weighted(points: Sequence[tuple[float, float, float]], *, grain_m: float) -> Estimate:
    """The mean and the covariance of points on the ground, each given by weight, east and north; every point stands for
    a square with sides of `grain_m`.
    """
    total = math.fsum(weight for weight, _, _ in points)
    east = math.fsum(weight * e for weight, e, _ in points) / total
    north = math.fsum(weight * n for weight, _, n in points) / total
    grain_m2 = grain_m * grain_m / 12
    return Estimate(
        east,
        north,
        math.fsum(weight * (e - east) ** 2 for weight, e, _ in points) / total + grain_m2,
        math.fsum(weight * (e - east) * (n - north) for weight, e, n in points) / total,
        math.fsum(weight * (n - north) ** 2 for weight, _, n in points) / total + grain_m2,
    )


@lru_cache(maxsize=64)
def _inside(middle: Enu, half_m: float) -> Sequence[bool]:
    """For each cell, True if within `half_m` of the origin along both axes; all cells if none is."""
    if max(abs(middle.east), abs(middle.north)) + _HALF_CELLS * CELL_M <= half_m:
        return _EVERY_CELL
    east = [abs(middle.east + (i - _HALF_CELLS) * CELL_M) <= half_m for i in range(_WIDTH)]
    north = [abs(middle.north + (j - _HALF_CELLS) * CELL_M) <= half_m for j in range(_WIDTH)]
    found = tuple(row and column for row in north for column in east)
    return found if any(found) else _EVERY_CELL


def _expectation(position: Enu, beside: Sequence[Enu], shadowing_db: float) -> tuple[list[float], float]:
    """The residual that is expected at a position from those at the places `beside`, as the weight of each of these,
    and the standard deviation of the difference [dB].
    """
    variance = max(shadowing_db, 1.0) ** 2
    own = variance + _READING_DB * _READING_DB

    def shared(a: Enu, b: Enu) -> float:
        return variance * math.exp(-_ground_m(a, b) / _CORRELATION_M)

    towards = [shared(position, at) for at in beside]
    rows = [
        [*(shared(a, b) if i != j else own for j, b in enumerate(beside)), towards[i]] for i, a in enumerate(beside)
    ]
    for i, row in enumerate(rows):  # Gauss and Jordan; a covariance matrix needs no pivots
        pivot = row[i]
        row[:] = [value / pivot for value in row]
        for other in rows:
            if other is not row:
                factor = other[i]
                other[:] = [value - factor * share for value, share in zip(other, row, strict=True)]
    weights = [row[-1] for row in rows]
    return weights, math.sqrt(own - math.fsum(w * c for w, c in zip(weights, towards, strict=True)))


def _ground_m(a: Enu, b: Enu) -> float:
    return math.hypot(a.east - b.east, a.north - b.north)


def _product(values: Iterable[float], factors: Iterable[float]) -> float:
    """The sum of the values, each times its factor."""
    return math.fsum(map(mul, values, factors))


def _news(position: Enu, silent_at: Iterable[Enu]) -> float:
    """The weight of a place without reception: the more earlier such places share its shadowing, the less it tells."""
    return 1 / (1 + math.fsum(math.exp(-_ground_m(position, at) / _CORRELATION_M) for at in silent_at))


def _is_sampled(position: Enu, sampled: Iterable[Enu]) -> bool:
    """True if one of the places of earlier samples is so near to a position that both share their shadowing."""
    east, north, hypot = position.east, position.north, math.hypot
    return any(hypot(east_m - east, north_m - north) < _SAME_PLACE_M for east_m, north_m, _ in sampled)


def _squared_distances_m2(middle: Enu, position: Enu, up2: float) -> list[float]:
    """The squared distance of every cell of the grid around `middle` from a position whose squared height is `up2`."""
    west = middle.east - _HALF_CELLS * CELL_M - position.east
    south = middle.north - _HALF_CELLS * CELL_M - position.north
    span = range(_WIDTH)
    east2 = [(west + i * CELL_M) ** 2 for i in span]
    return [squared + rest for rest in [(south + j * CELL_M) ** 2 + up2 for j in span] for squared in east2]


def _calibrated(model: PhoneModel, offset: PhoneOffset) -> PhoneModel:
    return model._replace(
        power_dbm=model.power_dbm + offset.mean_db, offset_db=math.hypot(model.offset_db, offset.sigma_db)
    )


@lru_cache(maxsize=256)
def _residuals_db(middle: Enu, position: Enu, rssi_dbm: float, model: PhoneModel) -> Sequence[float]:
    """Received less expected power for each cell; kept, as grids of UAVs in one process mostly share a middle, and as
    an array, which takes a quarter of a list's memory.
    """
    residual_at_1_m = rssi_dbm - (model.power_dbm - REFERENCE_LOSS_DB)
    slope = 5 * model.exponent / math.log(10)  # per natural logarithm of the squared distance
    distances2 = _squared_distances_m2(middle, position, max(1.0, position.up * position.up))
    return array("d", [residual_at_1_m + slope * logarithm for logarithm in map(math.log, distances2)])


@lru_cache(maxsize=64)
def _silence_scores(model: PhoneModel) -> tuple[float, ...]:
    """Twice the log-probability of no reception, by distance in steps of `_STEP_M`."""
    sigma = math.hypot(max(model.shadowing_db, 1.0), model.offset_db)
    scores = []
    for step in range(200):
        distance_m = (step + 0.5) * _STEP_M
        margin = model.power_dbm - REFERENCE_LOSS_DB - 10 * model.exponent * math.log10(distance_m)
        chance = 0.5 * math.erfc((margin - model.threshold_dbm) / (sigma * math.sqrt(2)))
        scores.append(2 * math.log(max(chance, _NEVER)))
    return tuple(scores)

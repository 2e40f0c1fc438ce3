"""By how much all phones are stronger or weaker than assumed, estimated from the phones of confirmed survivors.

    RSSI_ij = P + B + b_j - L0 - 10 n log10(d_ij) + shadowing_ij        B: of all phones; b_j ~ N(0, s_b^2): of phone j

Of a confirmed phone the powers tell B + b_j, never B more exactly than s_b. Powers below the threshold are not
reported, so the likelihood is truncated there (Cohen, Annals of Mathematical Statistics 21(4), 1950); it has a floor,
so that no single phone, under rubble or forged, changes the odds by more than a factor of about 200.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from operator import mul, sub
from typing import Final

from agents.mission.finding.phone_localization import (
    AS_ASSUMED,
    REFERENCE_LOSS_DB,
    Estimate,
    PhoneModel,
    PhoneOffset,
)
from fanet_mw.units import Enu

_STEP_DB: Final = 0.5
_MOST_DB: Final = 12.0
"""The greatest common offset that is considered, up or down."""
_COMMON: Final = tuple(_STEP_DB * i for i in range(round(-_MOST_DB / _STEP_DB), round(_MOST_DB / _STEP_DB) + 1))
"""The values of the common offset B for which likelihoods are computed."""
_SINGLE: Final = tuple(
    _STEP_DB * i for i in range(round(-1.5 * _MOST_DB / _STEP_DB), round(1.5 * _MOST_DB / _STEP_DB) + 1)
)
"""The values of one phone's offset B + b_j for which likelihoods are computed."""
_AS_ASSUMED_DB: Final = 0.5
_OTHERWISE_DB: Final = 5.0
"""The standard deviations of B before any survivor is confirmed, in the model of phones as assumed and in the other."""
_EVIDENCE_RATIO: Final = 3.0
"""The common offset is used once the model with a large B is more than this many times as likely as the other:
substantial evidence in the scale of Jeffreys (Theory of Probability, 1961, appendix B)."""
_LIKELIHOOD_FLOOR: Final = 0.005
"""This share of the maximum is added to the likelihood of each phone at all offsets."""
_MOST_READINGS: Final = 40
"""The powers of one phone that are used: those from the nearest places, least often below the threshold."""
_CORRELATION_FACTOR: Final = 1.5
"""Places near each other share shadowing, so that the powers of this many count like one independent one."""
_RARELY_HEARD: Final = 1e-12
"""The least probability of reception in the computation."""
_GRAIN_DB: Final = 0.25
"""The common offset is rounded to a multiple of this: a smaller change makes no filter compute anew."""


def likelihood(place: Estimate, readings: Iterable[tuple[Enu, float]], model: PhoneModel) -> tuple[float, ...]:
    """The likelihood of each common offset, given the powers of one phone at a known place; the maximum is about 1."""
    nearest = sorted(readings, key=lambda reading: (_slant_m(place, reading[0]), reading))[:_MOST_READINGS]
    sigma_db = max(model.shadowing_db, 1.0)
    logs = [0.0] * len(_SINGLE)
    for position, rssi_dbm in nearest:
        expected_dbm = model.power_dbm - REFERENCE_LOSS_DB - 10 * model.exponent * math.log10(_slant_m(place, position))
        logs = list(map(sub, logs, _improbabilities(expected_dbm, rssi_dbm, model.threshold_dbm, sigma_db)))
    most = max(logs)
    single = [math.exp(log - most) for log in logs]
    spread = _spread(max(model.offset_db, _GRAIN_DB))
    common = [math.fsum(map(mul, row, single)) for row in spread]
    greatest = max(common)
    return tuple(value / greatest + _LIKELIHOOD_FLOOR for value in common)


@lru_cache(maxsize=1024)
def _improbabilities(expected_dbm: float, rssi_dbm: float, threshold_dbm: float, sigma_db: float) -> tuple[float, ...]:
    """Negative log-likelihood of a received power for each offset of one phone; kept, as all UAVs ask again."""
    spread_db = sigma_db * math.sqrt(2)
    found = []
    for offset_db in _SINGLE:
        mean_dbm = expected_dbm + offset_db
        heard = 0.5 * math.erfc((threshold_dbm - mean_dbm) / spread_db)
        off = (rssi_dbm - mean_dbm) / sigma_db
        found.append((0.5 * off * off + math.log(max(heard, _RARELY_HEARD))) / _CORRELATION_FACTOR)
    return tuple(found)


def common_offset(phones: Iterable[Sequence[float]]) -> PhoneOffset:
    """The common offset by several phones; `AS_ASSUMED` unless a large one is `_EVIDENCE_RATIO` times as likely."""
    as_assumed, otherwise = _prior(_AS_ASSUMED_DB), _prior(_OTHERWISE_DB)
    for phone in phones:
        as_assumed = [weight * value for weight, value in zip(as_assumed, phone, strict=True)]
        otherwise = [weight * value for weight, value in zip(otherwise, phone, strict=True)]
        most = max(*as_assumed, *otherwise)
        as_assumed = [weight / most for weight in as_assumed]
        otherwise = [weight / most for weight in otherwise]
    total = math.fsum(otherwise)
    if total <= _EVIDENCE_RATIO * math.fsum(as_assumed):
        return AS_ASSUMED
    mean_db = math.fsum(weight * offset_db for weight, offset_db in zip(otherwise, _COMMON, strict=True)) / total
    squared = math.fsum(w * (offset_db - mean_db) ** 2 for w, offset_db in zip(otherwise, _COMMON, strict=True)) / total
    return PhoneOffset(_rounded(mean_db), _rounded(math.sqrt(squared)))


def _rounded(value_db: float) -> float:
    return round(value_db / _GRAIN_DB) * _GRAIN_DB


def _slant_m(place: Estimate, position: Enu) -> float:
    return max(1.0, math.hypot(place.distance_m(position), position.up))


def _normal(value_db: float, sigma_db: float) -> float:
    return math.exp(-0.5 * (value_db / sigma_db) ** 2)


@lru_cache(maxsize=4)
def _spread(sigma_db: float) -> tuple[tuple[float, ...], ...]:
    """For each common offset B, the weight of each offset B + b_j of one phone."""
    return tuple(tuple(_normal(single - common, sigma_db) for single in _SINGLE) for common in _COMMON)


@lru_cache(maxsize=4)
def _prior(sigma_db: float) -> list[float]:
    """The probability of each common offset before any survivor is confirmed."""
    weights = [_normal(offset_db, sigma_db) for offset_db in _COMMON]
    total = math.fsum(weights)
    return [weight / total for weight in weights]

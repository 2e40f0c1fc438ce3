"""By how much phones are stronger or weaker than assumed, from the powers of phones whose owners have been seen.

    RSSI_ij = P + B + b_j - L0 - 10 n log10(d_ij) + shadowing_ij
    B common to all phones (their kind, the receivers' calibration),   b_j ~ N(0, s_b^2) that of one phone

Once a survivor is confirmed, d_ij is known within metres, and the powers of that phone tell B + b_j. Many powers of one
phone are one draw of b_j: what a phone tells of B is never narrower than s_b. A power below the threshold is not heard,
so that the powers of a weak phone are those that shadowing raised: the likelihood is that of a normal distribution cut
off there (Cohen, Annals of Mathematical Statistics 21(4), 1950).

One phone may be off by far (rubble lies over it, its owner was taken for another, its reports are forged). So the
likelihood of a phone is nowhere less than a share of its greatest, and one phone never outweighs several others.

Two models are compared by their evidence: phones are as assumed, or they are not. The filters stay as they are until
the second is clearly more likely, so that a few powers of phones that are as assumed do not shift or widen anything.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final

from agents.mission.finding.phone_filter import AS_ASSUMED, DOUBT, REFERENCE_LOSS_DB, Estimate, PhoneModel, PhoneOffset
from fanet_mw.units import Enu

_STEP_DB: Final = 0.5
_MOST_DB: Final = 12.0
"""The greatest common offset, up or down."""
_COMMON: Final = tuple(_STEP_DB * i for i in range(round(-_MOST_DB / _STEP_DB), round(_MOST_DB / _STEP_DB) + 1))
"""The common offsets that are weighed."""
_SINGLE: Final = tuple(
    _STEP_DB * i for i in range(round(-1.5 * _MOST_DB / _STEP_DB), round(1.5 * _MOST_DB / _STEP_DB) + 1)
)
"""The offsets of one phone that are weighed: the common one and its own."""
_AS_ASSUMED_DB: Final = 0.5
_OTHERWISE_DB: Final = 5.0
"""The standard deviations of the common offset by the model that phones are as assumed, and by the other."""
_ODDS: Final = 3.0
"""The other model is believed when it is so many times as likely: substantial evidence in the scale of Jeffreys
(Theory of Probability, 1961, appendix B)."""
_ODD: Final = 0.005
"""The likelihood of a phone is nowhere less than this share of its greatest."""
_MOST_READINGS: Final = 40
"""So many powers of one phone count, those from the nearest places: they are least often below the threshold."""
_RARELY_HEARD: Final = 1e-12
"""The least probability of being heard that is reckoned with."""
_GRAIN_DB: Final = 0.25
"""What the filters are told is rounded to this, so that they are not computed anew for less."""


def likelihood(place: Estimate, readings: Iterable[tuple[Enu, float]], model: PhoneModel) -> tuple[float, ...]:
    """How likely the powers of one phone at a known place are, for each common offset; the greatest is about 1."""
    nearest = sorted(readings, key=lambda reading: (_slant_m(place, reading[0]), reading))[:_MOST_READINGS]
    sigma_db = max(model.shadowing_db, 1.0)
    logs = [0.0] * len(_SINGLE)
    for position, rssi_dbm in nearest:
        expected_dbm = model.power_dbm - REFERENCE_LOSS_DB - 10 * model.exponent * math.log10(_slant_m(place, position))
        for at, offset_db in enumerate(_SINGLE):
            mean_dbm = expected_dbm + offset_db
            heard = 0.5 * math.erfc((model.threshold_dbm - mean_dbm) / (sigma_db * math.sqrt(2)))
            off = (rssi_dbm - mean_dbm) / sigma_db
            logs[at] -= (0.5 * off * off + math.log(max(heard, _RARELY_HEARD))) / DOUBT
    most = max(logs)
    single = [math.exp(log - most) for log in logs]
    spread = _spread(max(model.offset_db, _GRAIN_DB))
    common = [math.fsum(weight * value for weight, value in zip(row, single, strict=True)) for row in spread]
    greatest = max(common)
    return tuple(value / greatest + _ODD for value in common)


def common_offset(phones: Iterable[Sequence[float]]) -> PhoneOffset:
    """The common offset, given the likelihoods of phones: none while it is more likely that phones are as assumed."""
    as_assumed, otherwise = _prior(_AS_ASSUMED_DB), _prior(_OTHERWISE_DB)
    for phone in phones:
        as_assumed = [weight * value for weight, value in zip(as_assumed, phone, strict=True)]
        otherwise = [weight * value for weight, value in zip(otherwise, phone, strict=True)]
        most = max(*as_assumed, *otherwise)
        as_assumed = [weight / most for weight in as_assumed]
        otherwise = [weight / most for weight in otherwise]
    total = math.fsum(otherwise)
    if total <= _ODDS * math.fsum(as_assumed):
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
    """For each common offset, the weights of the offsets of one phone."""
    return tuple(tuple(_normal(single - common, sigma_db) for single in _SINGLE) for common in _COMMON)


@lru_cache(maxsize=4)
def _prior(sigma_db: float) -> list[float]:
    """The weights of the common offsets, with a sum of 1, before any survivor is confirmed."""
    weights = [_normal(offset_db, sigma_db) for offset_db in _COMMON]
    total = math.fsum(weights)
    return [weight / total for weight in weights]

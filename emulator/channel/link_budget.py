"""The power of a link, and how far it reaches: the path loss of the channel (`path_loss.py`), and all thresholds.

Nothing here is compiled: pages and results of runs ask for a reach without loading numba.
"""

import math
from numbers import Real
from typing import Final, Protocol

import numpy as np

from emulator.channel.fading import lift
from emulator.channel.path_loss import (
    AIR_TO_AIR_EXPONENT,
    ENVIRONMENTS,
    air_to_air_db,
    air_to_ground_db,
    friis_db,
    log_distance_db,
    share_of_lower_roofs,
    two_ray_db,
    uma_av_db,
)
from emulator.kernel.state import Reals
from fanet_mw.errors import LocalProtocolError
from fanet_mw.extensions import make
from fanet_mw.scenario.tables.radio import CHANNELS, UMA_ANTENNA_M, Radio, default_sensitivity_dbm, noise_dbm


def milliwatt(dbm: float) -> float:
    return math.pow(10.0, dbm / 10)


def noise_mw(radio: Radio) -> float:
    """Thermal noise in the channel, raised by the receiver's noise figure."""
    return milliwatt(noise_dbm(radio.rate_mbps, radio.noise_figure_db))


def sensitivities_mw(radio: Radio) -> tuple[float, float]:
    """The weakest frame that is received: of data, and of ACKs, whose rate may be lower."""
    by_rate = radio.sensitivity_dbm == default_sensitivity_dbm(radio, radio.rate_mbps)
    ack_dbm = default_sensitivity_dbm(radio, radio.ack_rate_mbps) if by_rate else radio.sensitivity_dbm
    return milliwatt(radio.sensitivity_dbm), milliwatt(ack_dbm)


def carrier_sense_mw(radio: Radio) -> float:
    """The weakest signal that is sensed."""
    return 0.0 if radio.channel == "range" else milliwatt(radio.carrier_sense_dbm)


def energy_mw(radio: Radio) -> float:
    """The least energy that is sensed, whatever it consists of; infinite if only signals are."""
    if "sums" in radio.as_ns3:
        return milliwatt(radio.carrier_sense_dbm)
    return math.inf if radio.energy_detection_dbm is None else milliwatt(radio.energy_detection_dbm)


def audible_mw(radio: Radio) -> float:
    """The mean power from which frames count as copies: fading must lift one in a thousand to the sensitivity."""
    return milliwatt(radio.sensitivity_dbm) / lift(radio)


_MOST_DECADES: Final = 12.0
"""The greatest reach is 10^12 m, farther than any two nodes can be apart."""


def reach_m(radio: Radio) -> float:
    """The distance beyond which no station can interfere, by the most favorable path loss and 2 sigma of shadowing."""
    if radio.channel == "range":
        return radio.range_m
    return _distance_m(radio, radio.tx_power_dbm - radio.interference_floor_dbm + 2 * radio.shadowing_db)


def reach_with_gain_m(radio: Radio, gain_dbi: float) -> float:
    """The same distance for the links of an antenna with a gain."""
    if radio.channel == "range":
        return radio.range_m * math.pow(10.0, gain_dbi / 20)
    budget_db = radio.tx_power_dbm - radio.interference_floor_dbm + 2 * radio.shadowing_db
    return _distance_m(radio, budget_db + gain_dbi)


def heard_m(radio: Radio, *, gain_dbi: float = 0.0) -> float:
    """The greatest distance of reception without shadowing and fading, if one antenna has a gain; of another package's
    channel `range_m`, which grows with the gain as in free space.
    """
    if radio.channel == "range" or radio.channel not in CHANNELS:
        return radio.range_m * math.pow(10.0, gain_dbi / 20)
    return _distance_m(radio, radio.tx_power_dbm - radio.sensitivity_dbm + gain_dbi)


def _distance_m(radio: Radio, budget_db: float) -> float:
    if radio.channel not in CHANNELS:
        reach: object = _foreign(radio).reach_m(budget_db)
        if not (isinstance(reach, Real) and float(reach) > 0):
            raise LocalProtocolError(
                f"radio.channel = {radio.channel!r}: reach_m({budget_db:g}) = {reach!r} must be > 0"
            )
        return float(reach)
    at_1_m = float(friis_db(np.ones(1), frequency_mhz=radio.frequency_mhz)[0])
    laws = {
        "log_distance": [(radio.reference_loss_db, radio.exponent)],
        "friis": [(at_1_m, 2.0)],
        "two_ray": [(at_1_m, 2.0)],
        "air_to_air": [(at_1_m, AIR_TO_AIR_EXPONENT)],
        "air_to_ground": [(at_1_m, 2.0)],
        "uma_av": [(28.0 + 20 * math.log10(radio.frequency_mhz / 1000), 2.2), (at_1_m, AIR_TO_AIR_EXPONENT)],
    }[radio.channel]
    decades = max((budget_db - at_1_m) / (10 * exponent) for at_1_m, exponent in laws)
    return math.pow(10.0, max(0.0, min(_MOST_DECADES, decades)))


def received_dbm(distance_m: Reals, from_m: Reals, to_m: Reals, radio: Radio) -> Reals:
    """The mean power of each link without shadowing; its ends [n, 3] have heights above ground."""
    if radio.channel == "range":
        return np.full_like(distance_m, radio.tx_power_dbm)
    return np.asarray(radio.tx_power_dbm - _loss_db(distance_m, from_m, to_m, radio), dtype=np.float64)


def _loss_db(distance_m: Reals, from_m: Reals, to_m: Reals, radio: Radio) -> Reals:
    if radio.channel not in CHANNELS:
        return _checked(_foreign(radio).loss_db(distance_m, from_m, to_m), len(distance_m), radio)
    mhz = radio.frequency_mhz
    if radio.channel == "log_distance":
        return log_distance_db(distance_m, reference_db=radio.reference_loss_db, exponent=radio.exponent)
    if radio.channel == "friis":
        return friis_db(distance_m, frequency_mhz=mhz)
    if radio.channel == "two_ray":
        return two_ray_db(distance_m, from_m[:, 2], to_m[:, 2], frequency_mhz=mhz)
    in_the_air = air_to_air_db(distance_m, frequency_mhz=mhz)
    if radio.channel == "air_to_air":
        return in_the_air
    low, high = np.minimum(from_m[:, 2], to_m[:, 2]), np.maximum(from_m[:, 2], to_m[:, 2])
    if radio.channel == "air_to_ground":
        environment = ENVIRONMENTS[radio.environment]
        clear = share_of_lower_roofs(low, environment)
        to_ground = air_to_ground_db(distance_m, high - low, environment, frequency_mhz=mhz)
    else:
        clear = np.clip((low - UMA_ANTENNA_M) / (radio.airborne_m - UMA_ANTENNA_M), 0.0, 1.0)
        along_m = np.hypot(*(from_m - to_m)[:, :2].T)
        user_m = np.where(high > UMA_ANTENNA_M, high, low)
        to_ground = uma_av_db(distance_m, along_m, user_m, frequency_mhz=mhz)
    return np.asarray(clear * in_the_air + (1 - clear) * to_ground, dtype=np.float64)


class Channel(Protocol):
    """The path loss of a channel from another package (`fanet_mw.extensions`): a class that takes `Radio`. It is made
    anew for each computation, and has no state: the same places always give the same losses.
    """

    def loss_db(self, distance_m: Reals, from_m: Reals, to_m: Reals) -> Reals:
        """The loss of each link [n] between its ends [n, 3], whose heights are those above ground."""
        ...

    def reach_m(self, budget_db: float) -> float:
        """A distance beyond which each link loses more than `budget_db`."""
        ...


def _checked(loss_db: object, count: int, radio: Radio) -> Reals:
    """The losses that a channel of another package has computed; NaN would be silence that nobody notices."""
    found = np.asarray(math.nan if loss_db is None else loss_db, dtype=np.float64)
    if found.shape not in ((), (count,)) or np.isnan(found).any():
        raise LocalProtocolError(
            f"radio.channel = {radio.channel!r}: loss_db() must give a number for each of {count} links, "
            f"not {' '.join(repr(loss_db).split()):.120}"
        )
    return found


def _foreign(radio: Radio) -> Channel:
    channel: Channel = make("radio.channel", radio.channel, radio)
    return channel

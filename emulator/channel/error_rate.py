"""Bit error rates under noise and interference: DSSS DBPSK, DQPSK, CCK at 5.5 and 11 Mb/s (OFDM: `ofdm_error_rate`).

DBPSK     1/2 exp(-Eb/N0)                                               Proakis, Digital Communications, 4th ed., 5.2.8
DQPSK     (1+sqrt2)/sqrt(8 pi sqrt2 x) exp(-(2-sqrt2) x), x = Eb/N0        (tight approximation of the same section)
CCK       biorthogonal signalling of 4 (5.5) or 8 (11) dimensions times a DQPSK rotation, per 8-chip symbol (5.2.2)

The SINR is that in the 22 MHz channel. Values are logarithms of the success probability of one bit, by SINR in dB.
"""

import math
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from emulator.channel.ofdm_error_rate import SHORT_BYTES, bit_error, log_success
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB
from fanet_mw.airtime import is_ofdm
from fanet_mw.scenario.tables.radio import DSSS_BANDWIDTH_HZ

_TOP_DB: Final = 35.0
_SYMBOLS_PER_S: Final = 1.375e6
"""Rate of CCK symbols: 11 Mchip/s in symbols of 8 chips."""

Reals = npt.NDArray[np.float64]
__all__ = ["SHORT_BYTES", "header_rates", "log_success_per_bit"]


@cache
def log_success_per_bit(rate_mbps: float, ofdm_errors: str = "nist", *, short: bool = False) -> Reals:
    """ln(1 - bit error rate) by SINR; read-only and kept, as CCK takes 0.3 s. `short`: frames below SHORT_BYTES."""
    found = _log_success_per_bit(rate_mbps, tabled=ofdm_errors == "tables" and is_ofdm(rate_mbps), short=short)
    found.setflags(write=False)
    return found


def _log_success_per_bit(rate_mbps: float, *, tabled: bool, short: bool) -> Reals:
    sinr_db = np.arange(ERROR_FLOOR_DB, _TOP_DB, 1 / ERROR_STEPS_PER_DB)
    sinr = np.power(10.0, sinr_db / 10)
    if tabled:
        return log_success(sinr_db, rate_mbps, short=short)
    if is_ofdm(rate_mbps):
        return np.asarray(np.log(np.maximum(1.0 - bit_error(sinr, rate_mbps), 1e-300)), dtype=np.float64)
    if rate_mbps == 1:
        return _from_bit_error(0.5 * np.exp(-sinr * DSSS_BANDWIDTH_HZ / 1e6))
    if rate_mbps == 2:
        return _from_bit_error(_dqpsk(sinr * DSSS_BANDWIDTH_HZ / 2e6))
    bits = 4 if rate_mbps == 5.5 else 8
    symbol_snr = sinr * DSSS_BANDWIDTH_HZ / _SYMBOLS_PER_S
    success = np.array([_cck_symbol_success(float(snr), bits) for snr in symbol_snr])
    return np.asarray(np.log(np.maximum(success, 1e-300)) / bits, dtype=np.float64)


def header_rates(rate_mbps: float) -> tuple[float, float]:
    """Rate [Mb/s] and mean bits per ns of a header: DSSS at 1 Mb/s; OFDM 24 bits at 6 Mb/s after 16 us of training."""
    return (6.0, 24 / 20_000) if is_ofdm(rate_mbps) else (1.0, 1e-3)


def _from_bit_error(rate: Reals) -> Reals:
    return np.asarray(np.log1p(-np.minimum(rate, 0.5)), dtype=np.float64)


def _dqpsk(per_bit: Reals) -> Reals:
    root = math.sqrt(2.0)
    return np.asarray(
        np.minimum(0.5, (1 + root) / np.sqrt(8 * math.pi * root * per_bit) * np.exp(-(2 - root) * per_bit)),
        dtype=np.float64,
    )


def _cck_symbol_success(symbol_snr: float, bits: int) -> float:
    """P(a symbol is decoded): at 11 Mb/s by two biorthogonal decisions, each with half of one quadrature's energy
    (Es/N0 counts both), at 5.5 Mb/s by one.
    """
    if bits == 8:
        return _biorthogonal_success(symbol_snr / 4, 16) ** 2
    return _biorthogonal_success(symbol_snr / 2, 16)


def _biorthogonal_success(snr: float, signals: int) -> float:
    """Proakis (5.2-34): the probability that the right one of M/2 correlators is the largest, with the right sign."""
    root = math.sqrt(2 * snr)
    v = np.linspace(-root, 10.0, 600) if root < 10 else np.linspace(-10.0, 10.0, 600)
    inner = np.array([math.erf(max(0.0, x + root) / math.sqrt(2.0)) for x in v])
    density = np.exp(-v * v / 2) / math.sqrt(2 * math.pi)
    return float(min(1.0, np.trapezoid(np.power(inner, signals / 2 - 1) * density, v)))

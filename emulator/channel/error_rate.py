"""Bit error rates under noise and interference: DSSS DBPSK, DQPSK, CCK at 5.5 and 11 Mb/s and those of OFDM.

DBPSK     1/2 exp(-Eb/N0)                                               Proakis, Digital Communications, 4th ed., 5.2.8
DQPSK     (1+sqrt2)/sqrt(8 pi sqrt2 x) exp(-(2-sqrt2) x), x = Eb/N0        (tight approximation of the same section)
CCK       biorthogonal signalling of 4 (5.5) or 8 (11) dimensions times a DQPSK rotation, per 8-chip symbol (5.2.2)
OFDM      after Viterbi the union bound over the first terms of the distance spectrum, each bounded by D^d,
          D = sqrt(4 p (1 - p)) (Pei and Henderson, 2010), or the tables of ns-3.44 (docs/explanation/channel.md)

The SINR is that in the 22 MHz channel, 20 MHz with OFDM. Values are logarithms of the success probability of one bit,
by SINR in dB. Other lengths than the tables' follow as 1 - (1 - PER)^(length / table's length), by the table of short
frames below 400 bytes. Not modeled: frequency-selective fading, channel estimation, phase noise, pilots and guard
interval.
"""

import math
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

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


# Distance d: number of information bits in error, over all paths of that weight, for the K = 7 code (133, 171) and its
# punctured forms. Rate 1/2: J. Conan, IEEE Trans. Commun. 32(9), 1984; rates 2/3 and 3/4: D. Haccoun, G. Begin, IEEE
# Trans. Commun. 37(11), 1989, where the sums are per 2 and per 3 information bits.
_HALF: Final = {
    10: 36, 12: 211, 14: 1404, 16: 11633, 18: 77433, 20: 502690, 22: 3322763, 24: 21292910, 26: 134365911,
}  # fmt: skip
_TWO_THIRDS: Final = {
    6: 3, 7: 70, 8: 285, 9: 1276, 10: 6160, 11: 27128, 12: 117019, 13: 498860, 14: 2103891, 15: 8784123,
}  # fmt: skip
_THREE_QUARTERS: Final = {
    5: 42, 6: 201, 7: 1492, 8: 10469, 9: 62935, 10: 379644, 11: 2253373, 12: 13073811, 13: 75152755, 14: 428005675,
}  # fmt: skip

_SCHEMES: Final = {
    6.0: ("bpsk", 1, _HALF),
    9.0: ("bpsk", 3, _THREE_QUARTERS),
    12.0: ("qpsk", 1, _HALF),
    18.0: ("qpsk", 3, _THREE_QUARTERS),
    24.0: ("16-qam", 1, _HALF),
    36.0: ("16-qam", 3, _THREE_QUARTERS),
    48.0: ("64-qam", 2, _TWO_THIRDS),
    54.0: ("64-qam", 3, _THREE_QUARTERS),
}
"""Modulation, information bits per step of the code and spectrum of each rate [Mb/s] (802.11-2020, table 17-4)."""

_SHARE_AND_SCALE: Final = {"bpsk": (1 / 2, 1), "qpsk": (1 / 2, 2), "16-qam": (3 / 8, 10), "64-qam": (7 / 24, 42)}
"""Share and scale in p = share x erfc(sqrt(SINR / scale)), the uncoded error rate, by modulation."""


def bit_error(sinr: Reals, rate_mbps: float) -> Reals:
    """Bit error rate after decoding, at most 1, at each SINR (a ratio, not dB)."""
    modulation, step, spectrum = _SCHEMES[rate_mbps]
    share, scale = _SHARE_AND_SCALE[modulation]
    uncoded = share * np.array([math.erfc(math.sqrt(x / scale)) for x in sinr.tolist()])
    root = np.sqrt(4 * uncoded * (1 - uncoded))
    bound = sum(bits * np.power(root, distance) for distance, bits in spectrum.items()) / (2 * step)
    return np.asarray(np.minimum(bound, 1.0), dtype=np.float64)


SHORT_BYTES: Final = 400
"""Frames below this length have the table of short frames."""
_STEP_DB: Final = 0.5
_BANDWIDTH_HZ: Final = 20e6

# fmt: off
_OF_32_BYTES: Final[dict[float, tuple[float, tuple[float, ...]]]] = {
    6.0: (-3.5, (1, 0.995, 0.9408, 0.8259, 0.5895, 0.3083, 0.1254, 0.0344, 0.0085, 0.0015, 0.00024, 9e-05, 0)),
    12.0: (-0.5, (1, 0.9921, 0.9671, 0.8349, 0.5874, 0.3169, 0.1182, 0.0364, 0.0085, 0.0016, 0.00026, 3e-05, 0)),
    18.0: (2.0, (1, 0.994, 0.9588, 0.8512, 0.599, 0.3125, 0.1171, 0.0339, 0.0078, 0.0016, 0.00028, 8e-05, 0)),
    24.0: (4.0, (1, 0.999, 0.998, 0.969, 0.8843, 0.7409, 0.4651, 0.2571, 0.108, 0.0381, 0.0119, 0.0032,
        0.00076, 0.00017, 3e-05, 0)),
    36.0: (8.0, (1, 0.999, 0.9479, 0.7989, 0.5923, 0.337, 0.1572, 0.0542, 0.0158, 0.004, 0.0011, 0.00027, 9e-05, 0)),
    48.0: (11.5, (1, 0.998, 0.9653, 0.897, 0.7301, 0.5257, 0.3058, 0.1575, 0.0646, 0.0241, 0.0079, 0.0023,
        0.00069, 0.00018, 4e-05, 2e-05, 0)),
    54.0: (13.0, (1, 0.9901, 0.9625, 0.8398, 0.6866, 0.4634, 0.252, 0.1145, 0.0461, 0.0158, 0.0049, 0.0016,
        0.00039, 0.00011, 2e-05, 0)),
}
_OF_1458_BYTES: Final[dict[float, tuple[float, tuple[float, ...]]]] = {
    6.0: (-1.0, (1, 0.994, 0.8185, 0.2908, 0.0663, 0.0112, 0.0015, 0.00015, 1e-05, 0)),
    12.0: (2.0, (1, 0.997, 0.7944, 0.3008, 0.0728, 0.012, 0.0015, 0.00023, 0)),
    18.0: (4.5, (1, 0.998, 0.7578, 0.301, 0.0676, 0.0122, 0.0023, 0.00035, 4e-05, 0)),
    24.0: (7.5, (1, 0.994, 0.8405, 0.4341, 0.1419, 0.0374, 0.0086, 0.0019, 0.00036, 5e-05, 0)),
    36.0: (11.0, (1, 0.9269, 0.5139, 0.1826, 0.0465, 0.011, 0.0026, 0.00041, 0.0001, 0)),
    48.0: (14.5, (1, 0.999, 0.9479, 0.6625, 0.2978, 0.1058, 0.0334, 0.0091, 0.0023, 0.00064, 0.00017, 2e-05, 0)),
    54.0: (16.0, (1, 0.995, 0.8796, 0.5139, 0.2091, 0.0639, 0.0186, 0.0046, 0.0013, 0.00023, 2e-05, 0)),
}
# fmt: on
"""By rate [Mb/s]: the first SINR [dB], and the frame error rates from there on in steps of 0.5 dB."""
_UNTABLED_MBPS: Final = 9.0


def log_success(sinr_db: Reals, rate_mbps: float, *, short: bool) -> Reals:
    """The logarithm of the probability that one bit has no error, at each SINR [dB]."""
    if rate_mbps == _UNTABLED_MBPS:
        return _first_term(np.power(10.0, sinr_db / 10))
    table, size = (_OF_32_BYTES, 32) if short else (_OF_1458_BYTES, 1458)
    first_db, shares = table[rate_mbps]
    lost = np.interp(sinr_db, first_db + _STEP_DB * np.arange(len(shares)), shares)
    return np.asarray(np.log(np.maximum(1.0 - lost, 1e-300)) / (8 * size), dtype=np.float64)


def _first_term(sinr: Reals) -> Reals:
    """The same for BPSK of rate 3/4 (12 Mb/s on the air), by the 8 paths of its code that have the least weight, 5."""
    uncoded = 0.5 * np.array([math.erfc(math.sqrt(x * _BANDWIDTH_HZ / 12e6)) for x in sinr.tolist()])
    wrong = sum(math.comb(5, n) * uncoded**n * (1 - uncoded) ** (5 - n) for n in (3, 4, 5))
    return np.asarray(np.log(np.maximum(1.0 - 8 * wrong, 1e-300)), dtype=np.float64)

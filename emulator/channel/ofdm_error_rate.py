"""Bit error rates of OFDM, 6-54 Mb/s, under noise and interference: the NIST model of Pei and Henderson (2010).

    uncoded       BPSK, QPSK, 16-QAM, 64-QAM with Gray mapping; SINR over the 20 MHz channel is that of a subcarrier
    after Viterbi union bound over the first terms of the distance spectrum, each bounded by D^d, D = sqrt(4 p (1 - p))

G. Pei, T. Henderson, "Validation of OFDM error rate model in ns-3", 2010. Hard decisions: receivers with soft ones are
up to 2 dB better. Not modeled: frequency-selective fading, channel estimation, phase noise, pilots and guard interval.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

Reals = npt.NDArray[np.float64]

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

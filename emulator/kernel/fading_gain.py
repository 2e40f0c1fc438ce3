"""The gain of a link at an instant, from the waves and the table of `emulator/channel/fading.py`."""

import math
from typing import Final

from emulator.kernel.jit import jit
from emulator.kernel.state import FADING, FADING_SHAPE, NAKAGAMI, ROOT, TABLE, WAVES, WAVES_FROM_NS, Ints, Reals

COSINE, SHAPED = 0, 1
"""The rows of the table: cos(2 pi i / TABLE), and by |h| the gain (Rician: what scales h to be normal)."""
_MASK = TABLE - 1
_QUARTER = TABLE // 4
_PER_AMPLITUDE = (TABLE - 1) / ROOT
_K, _K_RATE, _L, _L_RATE, _AT = 0, WAVES, 2 * WAVES, 3 * WAVES, 4 * WAVES
WAVE_COLUMNS: Final = 4 * WAVES + 6
"""Of a station: phases as the lower end and their change per ns [turns], the same as the higher end, position and
velocity per ns [wavelengths]."""


@jit
def gain(g: Ints, p: Ints, pf: Reals, wv: Reals, tb: Reals, a: int, b: int, t: int) -> float:
    """The power gain between two stations at an instant."""
    lo, hi = min(a, b), max(a, b)
    since = float(t - g[WAVES_FROM_NS])
    x = 0.0
    y = 0.0
    for n in range(WAVES):
        turns = wv[lo, _K + n] + wv[hi, _L + n] + (wv[lo, _K_RATE + n] + wv[hi, _L_RATE + n]) * since
        at = int(turns * TABLE)
        x += tb[COSINE, at & _MASK]
        y += tb[COSINE, (at - _QUARTER) & _MASK]
    place = math.sqrt(x * x + y * y) / ROOT * _PER_AMPLITUDE
    i = min(int(place), TABLE - 2)
    shaped = tb[SHAPED, i] + (place - i) * (tb[SHAPED, i + 1] - tb[SHAPED, i])
    if p[FADING] == NAKAGAMI:
        return float(shaped)
    square = 0.0
    for axis in range(3):
        apart = wv[lo, _AT + axis] - wv[hi, _AT + axis] + (wv[lo, _AT + 3 + axis] - wv[hi, _AT + 3 + axis]) * since
        square += apart * apart
    at = int(math.sqrt(square) * TABLE)
    k = pf[FADING_SHAPE]
    direct, scattered = math.sqrt(k / (k + 1.0)), shaped / ROOT / math.sqrt(k + 1.0)
    x = direct * tb[COSINE, at & _MASK] + scattered * x
    y = direct * tb[COSINE, (at - _QUARTER) & _MASK] + scattered * y
    return float(x * x + y * y)

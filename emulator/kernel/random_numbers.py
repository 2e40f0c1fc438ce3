"""The random number generators of stations; their states are rows RANDOM and FAULT_RANDOM of the stations' array."""

from emulator.kernel.jit import jit
from emulator.kernel.state import Ints

MODULUS = 2_147_483_647


@jit
def uniform(st: Ints, row: int, s: int) -> int:
    """The next value, in [1, 2^31 - 2], of a station's generator in `row` (Park and Miller, CACM 31(10), 1988)."""
    x = st[row, s] * 48271 % MODULUS
    st[row, s] = x
    return int(x)

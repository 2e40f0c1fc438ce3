"""Random numbers of a station: a generator is a row of the state, RANDOM or FAULT_RANDOM."""

from emulator.kernel.jit import jit
from emulator.kernel.state import Ints

MODULUS = 2_147_483_647


@jit
def uniform(st: Ints, row: int, s: int) -> int:
    """The next value of the generator in that row, in [1, 2^31 - 2] (Park and Miller, CACM 31(10), 1988)."""
    x = st[row, s] * 48271 % MODULUS
    st[row, s] = x
    return int(x)

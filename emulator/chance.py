"""Random numbers of a station, from its own row of the state."""

from emulator.jit import jit
from emulator.state import RANDOM, Ints

MODULUS = 2_147_483_647


@jit
def uniform(st: Ints, s: int) -> int:
    """The next value of a station's generator, in [1, 2^31 - 2] (Park and Miller, CACM 31(10), 1988)."""
    x = st[RANDOM, s] * 48271 % MODULUS
    st[RANDOM, s] = x
    return int(x)

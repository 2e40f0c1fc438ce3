"""Carrier sense: whether a station takes its medium for busy (clear channel assessment, CCA), over its state.

The medium is busy for as many reasons as CS counts: each frame that is sensed, from its detection to its end, and, if
SENSES_SUMS = 1, the energy of all signals and jammers together while it is above ENERGY_MW (802.11-2020, 17.3.10.6:
-62 dBm with OFDM). NAV is an instant until which a station has no access; `phy.py` sets it.
"""

from emulator.kernel.channel_access import on_busy, on_idle
from emulator.kernel.jit import jit
from emulator.kernel.state import CS, ENERGY, ENERGY_MW, JAMMING, NOTHING, NOW, POWER, SENSES_SUMS, TX_KIND, Ints, Reals


@jit
def busier(p: Ints, st: Ints, r: int, t: int) -> None:
    st[CS, r] += 1
    if st[CS, r] == 1 and st[TX_KIND, r] == NOTHING:
        on_busy(p, st, r, t)


@jit
def quieter(g: Ints, p: Ints, st: Ints, hs: Ints, r: int, t: int) -> None:
    st[CS, r] -= 1
    if st[CS, r] == 0 and st[TX_KIND, r] == NOTHING:
        on_idle(g, p, st, hs, r, t)


@jit
def energy_rose(p: Ints, pf: Reals, st: Ints, sf: Reals, r: int, t: int) -> None:
    """Call the medium busy for all energy together, if that is enough to be sensed."""
    if p[SENSES_SUMS] == 1 and st[ENERGY, r] == 0 and sf[POWER, r] + sf[JAMMING, r] >= pf[ENERGY_MW]:
        st[ENERGY, r] = 1
        busier(p, st, r, t)


@jit
def energy_fell(g: Ints, p: Ints, pf: Reals, st: Ints, sf: Reals, hs: Ints, r: int, t: int) -> None:
    """Call the medium busy for that energy no longer, if it is not enough any more."""
    if st[ENERGY, r] == 1 and sf[POWER, r] + sf[JAMMING, r] < pf[ENERGY_MW]:
        st[ENERGY, r] = 0
        quieter(g, p, st, hs, r, t)


@jit
def sense_jamming(g: Ints, p: Ints, pf: Reals, st: Ints, sf: Reals, hs: Ints) -> None:
    """Sense the energy at all stations anew, because jamming has changed; the heap of starts has room for each."""
    for r in range(st.shape[1]):
        energy_rose(p, pf, st, sf, r, g[NOW])
        energy_fell(g, p, pf, st, sf, hs, r, g[NOW])

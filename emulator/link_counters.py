"""The traffic of each link since the last report: received and lost frames, and the mean power of the received ones.

The kernel counts in its array of links, which new poses replace; `take` moves its counts here before.
"""

from array import array

import numpy as np

from emulator.kernel import state as s
from emulator.kernel.state import Ints, Reals
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.units import S

_ROWS = slice(s.N_RECEIVED, s.N_CUT + 1)


class LinkCounters:
    """The traffic of all links since the last report."""

    def __init__(self, stations: int, *, has_powers: bool) -> None:
        """`has_powers`: the channel knows the powers at which frames arrive."""
        self._stations = stations
        self._has_powers = has_powers
        self._keys: list[Ints] = []
        self._counts: list[Ints] = []
        self._since_ns = 0
        self.next_ns: int | None = None
        """The instant of the next report; None while nothing is transmitted."""

    def begin(self, now_ns: int) -> None:
        self._since_ns = now_ns

    def plan(self, now_ns: int) -> None:
        self.next_ns = (now_ns // S + 1) * S

    def take(self, lk: Ints, lp: Reals) -> None:
        """Move counts here, leaving zeros; power without fading, which raises the mean of those received."""
        used = np.flatnonzero(lk[_ROWS].any(axis=0))
        if len(used):
            self._keys.append(lk[s.LINK_SRC, used] * self._stations + lk[s.LINK_DST, used])
            milliwatt = np.maximum(lp[s.LINK_POWER, used], 1e-30) if self._has_powers else np.ones(len(used))
            millidbm = np.rint(10_000.0 * np.log10(milliwatt)).astype(np.int64)
            self._counts.append(np.vstack([millidbm * lk[s.N_RECEIVED, used], lk[_ROWS, used]]))
            lk[_ROWS, used] = 0

    def close(self, now_ns: int) -> LinkStats | None:
        """The sums since the last report; None if there was no traffic."""
        if not self._keys:
            return None
        since_ns, self._since_ns = self._since_ns, now_ns
        keys, place = np.unique(np.concatenate(self._keys), return_inverse=True)
        sums = np.zeros((len(keys), 1 + COUNTS), np.int64)
        np.add.at(sums, place.reshape(-1), np.concatenate(self._counts, axis=1).T)
        self._keys.clear()
        self._counts.clear()
        ends = np.stack([keys // self._stations + 1, keys % self._stations + 1], axis=1).astype(np.uint16)
        counts = np.minimum(sums[:, 1:], 0xFFFF_FFFF).astype(np.uint32)
        return LinkStats(
            now_ns,
            now_ns - since_ns,
            array("H", ends.tobytes()),
            array("I", counts.tobytes()),
            array("q", np.ascontiguousarray(sums[:, 0]).tobytes()),
        )

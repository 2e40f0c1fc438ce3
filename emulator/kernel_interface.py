"""The interface between the medium and the kernel, in terms of stations and frame slots.

Only the medium knows bytes, topics and node ids.
"""

import struct
from array import array
from typing import Final

import numpy as np
import numpy.typing as npt

from emulator.channel.fading import Waves
from emulator.channel.propagation import Blocked, LinkTable, gains_dbi, pair_codes
from emulator.channel.shadowing import Shadowing
from emulator.faults import Faults
from emulator.kernel import carrier_sense, kernel
from emulator.kernel import state as s
from emulator.kernel.state import Ints, Reals
from emulator.kernel_arrays import MOST_ASKED, arrays_of
from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.scenario import Scenario
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


_ASKED_ROW: Final = struct.Struct(f"={s.ASKED_COLUMNS}q")
_OUT_ROW: Final = struct.Struct(f"={s.OUT_COLUMNS}q")
_pack, _unpack = _ASKED_ROW.pack_into, _OUT_ROW.iter_unpack
_ASKED_N, _OUT_N = s.ASKED_N, s.OUT_N
Rows = list[tuple[int, ...]]


class KernelInterface:
    """The state of the channel and of the MAC of every station."""

    def __init__(self, scenario: Scenario, *, stations: int, faults: Faults, capture: bool = False) -> None:
        self._radio = scenario.radio
        self._gains = gains_dbi(scenario)
        self._shadowing = Shadowing(scenario.radio, seed=scenario.seed) if scenario.radio.shadowing_db else None
        self.at = np.full((stations, 3), np.inf)
        """The positions in force [m]; infinite where a station's place is unknown, as all are at first."""
        self._blocked = Blocked(np.zeros(0, np.int64), np.zeros(0))
        self._ground_m = np.zeros(stations)
        self._sight_changed = False
        self._lifetime_ns = scenario.mac_lifetime_ns
        self.faults = faults
        self.link_counters = LinkCounters(stations, has_powers=scenario.radio.channel != "range")
        self._waves = Waves(scenario.radio, seed=scenario.seed) if scenario.radio.fading != "none" else None
        self.arrays = arrays_of(scenario, self._links(spare=0), stations=stations, capture=capture)
        # These views share memory with numpy arrays; a few numbers are read faster through the buffer protocol.
        self._counts = self.arrays.g.data
        self._asked_bytes = self.arrays.asked.data.cast("B")
        out_bytes = self.arrays.out.data.cast("B")
        self._out_rows = [out_bytes[: count * _OUT_ROW.size] for count in range(len(self.arrays.out) + 1)]
        """The first n rows of `out` as bytes, at index n."""
        self._airtime: dict[int, int] = {}
        self.next_output_ns = s.NEVER
        """A lower bound of the next instant at which `advance` returns rows; NEVER when nothing is planned."""
        self._entry = self.arrays.entry()

    def obstruct(
        self,
        pairs: npt.NDArray[np.int64],
        losses_db: npt.NDArray[np.float64],
        ground_m: npt.NDArray[np.float64] | float = 0.0,
    ) -> None:
        """Set the pairs of stations [n, 2] with something solid between them, and the loss of each, if that is known;
        and the height of the ground below each station. It takes effect at the next `place`.
        """
        codes, first = np.unique(pair_codes(pairs, len(self.at)), return_index=True)
        blocked = Blocked(codes, losses_db[first] if len(losses_db) else losses_db)
        changed = not all(map(np.array_equal, blocked, self._blocked))
        self._sight_changed = self._sight_changed or changed
        self._blocked = blocked
        self._ground_m[:] = ground_m

    def place(self, at: npt.NDArray[np.float64], velocity: npt.NDArray[np.float64], t_ns: int) -> None:
        """Take over positions [m] and velocities [m/s] of an instant; frames in flight go over to the new links."""
        if self._waves is not None:
            self.arrays.wv[:] = self._waves.of(at, velocity, t_ns)
            self.arrays.g[s.WAVES_FROM_NS] = t_ns
        if self._sight_changed or not np.array_equal(at, self.at):
            self._sight_changed = False
            self.at = at
            self.relink()

    def _links(self, *, spare: int) -> LinkTable:
        """The links between the stations, with room for `spare` more."""
        return LinkTable(
            np.ascontiguousarray(self.at), self._radio, spare=spare, ground_m=self._ground_m,
            shadowing=self._shadowing, blocked=self._blocked, gains=self._gains,
        )  # fmt: skip

    def relink(self) -> None:
        a = self.arrays
        self._take_in()
        self.link_counters.take(a.lk, a.lp)
        spare = int(a.lk[s.UNDERWAY].sum())
        links = self._links(spare=spare)
        a.sf[s.NOISE], jamming = self.faults.apply(links, self.at)
        a.g[s.REACH_NS] = max(a.g[s.REACH_NS] if spare else 0, links.longest_ns)
        room = 4 * (links.ints.shape[1] + a.st.shape[1]) + 64
        if a.hr.shape[0] < room + a.g[s.HR_N]:
            a.hr = np.concatenate([a.hr, np.zeros((room, 5), np.int64)])
        if spare:
            kernel.scatter(a.g, a.p, a.lk, a.hr)
            kernel.relink(a.hr, a.g, a.lk, a.lp, a.ptr, a.st[s.LOCK], links.ints, links.reals, links.ptr)
        a.use(links)
        if not np.array_equal(jamming, a.sf[s.JAMMING]):
            a.sf[s.JAMMING] = jamming
            if a.g[s.HS_N] + a.st.shape[1] + kernel.MARGIN > len(a.hs):
                self._more_starts(len(a.hs) + a.st.shape[1])
            carrier_sense.sense_jamming(a.g, a.p, a.pf, a.st, a.sf, a.hs)
        self._entry = a.entry()
        self.next_output_ns = int(kernel.next_output(a.g, a.p, a.st, a.fr, a.hs))

    def links(self, now_ns: int) -> LinkStats | None:
        """The traffic of all links since the previous call; None if there was none."""
        self.link_counters.take(self.arrays.lk, self.arrays.lp)
        return self.link_counters.close(now_ns)

    def copies_under_way(self) -> int:
        """The number of copies of data frames that have been counted as on the air and have not ended yet."""
        a = self.arrays
        frame, to = a.lk[s.LINK_FRAME], a.fr[s.DST, a.lk[s.LINK_FRAME]]
        addressed = (to == s.EVERYONE) | (to == a.lk[s.LINK_DST])
        copies = (a.lk[s.UNDERWAY] == 1) & (a.lk[s.LINK_KIND] == s.DATA) & (a.lk[s.COPY] == 1) & (frame >= 0)
        return int((copies & addressed).sum())

    def slots(self) -> int:
        return int(self.arrays.fr.shape[1])

    def grow(self) -> None:
        more = self.slots()
        self.arrays.fr = np.concatenate([self.arrays.fr, np.zeros_like(self.arrays.fr)], axis=1)
        self._more_starts(2 * more)

    def submit(
        self, slot: int, src: int, dst: int, size: int, start_ns: int, wants_status: bool, until_ns: int
    ) -> None:
        """Announce a frame (`size`: UDP payload) that enters its queue at `start_ns`, and is dropped if not begun by
        `until_ns` (0: none) or within its lifetime. The kernel learns of it at once if it might be the next to end.
        """
        airtime = self._airtime.get(size)
        if airtime is None:
            radio = self._radio
            airtime = self._airtime[size] = airtime_ns(size + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
        counts = self._counts
        asked = counts[_ASKED_N]
        expires_ns = min(start_ns + self._lifetime_ns, until_ns or s.NEVER)
        _pack(
            self._asked_bytes, asked * _ASKED_ROW.size, slot, src, dst, airtime, start_ns, wants_status, expires_ns
        )  # fmt: skip
        counts[_ASKED_N] = asked + 1
        if start_ns + airtime < self.next_output_ns or asked + 1 == MOST_ASKED:
            self._take_in()

    def _take_in(self) -> None:
        counts, a = self._counts, self.arrays
        if counts[s.HS_N] + counts[_ASKED_N] + 2 * kernel.MARGIN > len(a.hs):
            self._more_starts(len(a.hs))
        self.next_output_ns = kernel.take_in(a.g, a.p, a.st, a.fr, a.hs, a.asked, self.next_output_ns)

    def advance(self, until_ns: int) -> Rows:
        """Let time pass until `until_ns`; returns the output rows (`emulator.kernel.state.OUT_*`) in order."""
        rows: Rows = []
        while True:
            bound_ns = self._entry.advance(until_ns)
            count = self._counts[_OUT_N]
            rows += _unpack(self._out_rows[count])
            if bound_ns >= 0:
                self.next_output_ns = bound_ns
                return rows
            if not count:  # the kernel has stopped on the way, not because `out` was full, but `hs`
                self._more_starts(len(self.arrays.hs))

    def _more_starts(self, rows: int) -> None:
        self.arrays.hs = np.concatenate([self.arrays.hs, np.zeros((rows, 5), np.int64)])
        self._entry = self.arrays.entry()

"""The kernel's arrays and the calls into it, in terms of stations and frame slots.

Bytes, topics and node ids are known to the medium only.
"""

import struct
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from emulator.chance import MODULUS
from emulator.channel.error_rate import header_rates, log_success_per_bit
from emulator.channel.fading import law_of, seeds
from emulator.channel.propagation import LinkTable, milliwatt, noise_mw, pair_codes
from emulator.channel.shadowing import Shadowing
from emulator.faults import Faults
from emulator.kernel import kernel
from emulator.kernel import state as s
from emulator.kernel.entry import KernelEntry
from emulator.link_book import LinkBook
from fanet_mw.airtime import DETECT_NS, OVERHEAD_BYTES, Timing, airtime_ns
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.rng import stream_seed
from fanet_mw.scenario import Scenario

_ROW: Final = struct.Struct("=6q")
"""The layout of one row of `asked` and of `out`."""
_pack, _unpack, _ROW_BYTES = _ROW.pack_into, _ROW.iter_unpack, _ROW.size
_MOST_ASKED: Final = 256
"""How many requests may wait to be handed to the kernel."""
_SLOTS: Final = 1000
"""How many frame slots there are at first. The number is no power of two: with a power of two the rows of one frame
would compete for the same few lines of the processor's cache."""
Rows = list[tuple[int, ...]]


@lru_cache(maxsize=8)
def _error_table(rate_mbps: float, ack_rate_mbps: float) -> npt.NDArray[np.float64]:
    """The rows of the kernel's `err`: PLCP header, data, ACK (see `emulator.kernel.state.LOCK_RATE`)."""
    return np.stack([log_success_per_bit(rate) for rate in (header_rates(rate_mbps)[0], rate_mbps, ack_rate_mbps)])


class Air:
    """The state of the channel and of the MAC of every station."""

    def __init__(self, scenario: Scenario, *, stations: int, faults: Faults, capture: bool = False) -> None:
        radio, seed, lifetime_ns = scenario.radio, scenario.seed, scenario.mac_lifetime_ns
        self._radio = radio
        self._stations = stations
        self._faults = faults
        self.book = LinkBook(stations)
        timing = Timing.of(radio)
        as_ns3, sinr = radio.as_ns3, radio.channel != "range"
        fading, shape = law_of(radio)
        self.g = np.zeros(s.GLOBALS, np.int64)
        self._p = np.zeros(s.PARAMETERS, np.int64)
        self._p[:] = (
            timing.slot_ns, timing.sifs_ns, timing.difs_ns, timing.eifs_extra_ns, timing.ack_ns,
            timing.ack_timeout_ns, timing.header_ns, DETECT_NS, radio.cw_min, radio.cw_max, radio.max_attempts,
            radio.queue_frames, lifetime_ns,
            "difs" in as_ns3, "eifs" in as_ns3, sinr and "sums" in as_ns3, sinr and "onset" in as_ns3, sinr, capture,
            timing.extension_ns, radio.capture, fading,
        )  # fmt: skip
        self._pf = np.array(
            [
                milliwatt(radio.preamble_snr_db),
                header_rates(radio.rate_mbps)[1],
                radio.rate_mbps * 1e-3,
                radio.ack_rate_mbps * 1e-3,
                milliwatt(radio.capture_db),
                milliwatt(radio.sensitivity_dbm),
                shape,
            ]
        )
        self.st = np.zeros((s.STATION_ROWS, stations), np.int64)
        for row, value in (
            (s.SCHEDULED, -1), (s.CW, radio.cw_min), (s.TX_FRAME, -1), (s.LOCK, -1), (s.WAITING, -1), (s.ACK_TO, -1),
            (s.HEAD, -1), (s.TAIL, -1), (s.BUSY_SINCE, -1), (s.IDLE_FROM, -timing.difs_ns),
        ):  # fmt: skip
            self.st[row] = value
        self.st[s.RANDOM] = [stream_seed(seed, "backoff", i + 1) % (MODULUS - 1) + 1 for i in range(stations)]
        self.st[s.FADE_A], self.st[s.FADE_B] = np.array(
            [seeds(stream_seed(seed, "fading", i + 1)) for i in range(stations)], np.int64
        ).T
        self._sf = np.zeros((s.STATION_REALS, stations), np.float64)
        self._sf[s.NOISE] = noise_mw(radio)
        self.st[s.FAULT_RANDOM] = [stream_seed(seed, "fault", i + 1) % (MODULUS - 1) + 1 for i in range(stations)]
        self.fr = np.zeros((s.FRAME_ROWS, _SLOTS), np.int64)
        self._hs = np.zeros((8 * stations + 2 * _SLOTS + 64, 5), np.int64)
        self._asked = np.zeros((_MOST_ASKED, s.ASKED_COLUMNS), np.int64)
        self._out = np.zeros((2 * radio.queue_frames + 1024, s.OUT_COLUMNS), np.int64)
        # These views are the same memory by the buffer protocol, which reads a few numbers faster than numpy does.
        self._counts = self.g.data
        self._asked_bytes = self._asked.data.cast("B")
        out_bytes = self._out.data.cast("B")
        self._out_rows = [out_bytes[: count * _ROW_BYTES] for count in range(len(self._out) + 1)]
        """At index n: the first n rows of `out`, as bytes."""
        self._err = _error_table(radio.rate_mbps, radio.ack_rate_mbps) if radio.channel != "range" else np.zeros((3, 1))
        self._airtime: dict[int, int] = {}
        self._shadowing = Shadowing(radio, seed=seed) if radio.shadowing_db else None
        nowhere = LinkTable(np.full((stations, 3), np.inf), radio, spare=0)
        self._lk, self._lp, self._ptr = nowhere.ints, nowhere.reals, nowhere.ptr
        self._hr = np.zeros((64, 5), np.int64)
        self._at = np.full((stations, 3), np.inf)
        self._blocked = np.zeros(0, np.int64)
        self._sight_changed = False
        """True when the obstructions have changed since the links were made."""
        self.next_output_ns = s.NEVER
        """A lower bound of the next instant at which `advance` returns rows; NEVER when nothing is planned."""
        self._renew_entry()

    def obstruct(self, pairs: npt.NDArray[np.int64]) -> None:
        """Set the pairs of stations [n, 2] between which something stands; it counts from the next `place` on."""
        blocked = np.unique(pair_codes(pairs, self._stations))
        self._sight_changed = self._sight_changed or not np.array_equal(blocked, self._blocked)
        self._blocked = blocked

    def place(self, at: npt.NDArray[np.float64]) -> None:
        """Take over new positions [m], one row per station; frames on the way are carried over to the new links."""
        if np.array_equal(at, self._at) and not self._sight_changed:
            return
        self._sight_changed = False
        self._at = at
        self.relink()

    def relink(self) -> None:
        """Make the links anew, because stations have moved or faults have changed."""
        at = self._at
        self._take_in()
        self.book.take(self._lk)
        spare = int(self._lk[s.UNDERWAY].sum())
        links = LinkTable(
            np.ascontiguousarray(at), self._radio, spare=spare, shadowing=self._shadowing, blocked=self._blocked
        )
        self._sf[s.NOISE] = self._faults.apply(links, at)
        self.g[s.REACH_NS] = max(self.g[s.REACH_NS] if spare else 0, links.longest_ns)
        room = 4 * (links.ints.shape[1] + self._stations) + 64
        if self._hr.shape[0] < room + self.g[s.HR_N]:
            self._hr = np.concatenate([self._hr, np.zeros((room, 5), np.int64)])
        if spare:
            kernel.scatter(self.g, self._p, self._lk, self._hr)
            kernel.relink(
                self._hr, self.g, self._lk, self._lp, self._ptr, self.st[s.LOCK], links.ints, links.reals, links.ptr
            )
        self._lk, self._lp, self._ptr = links.ints, links.reals, links.ptr
        self._renew_entry()
        self.next_output_ns = int(kernel.next_output(self.g, self._p, self.st, self.fr, self._hs))

    def links(self, now_ns: int) -> LinkStats | None:
        """What the links have carried since the previous call; None when they have carried nothing."""
        self.book.take(self._lk)
        return self.book.close(now_ns)

    def neighbors(self, station: int) -> int:
        """How many stations are in range of this one."""
        return int(self._lk[s.AUDIBLE, self._ptr[station] : self._ptr[station + 1]].sum())

    def slots(self) -> int:
        """How many frame slots there are."""
        return int(self.fr.shape[1])

    def grow(self) -> None:
        """Double the number of frame slots."""
        more = self.slots()
        self.fr = np.concatenate([self.fr, np.zeros_like(self.fr)], axis=1)
        self._more_starts(2 * more)

    def submit(self, slot: int, src: int, dst: int, size: int, start_ns: int, wants_status: bool) -> None:
        """Announce a frame of `size` bytes (UDP payload) that will enter its station's queue at `start_ns`.

        The kernel learns of it at the next `advance`, or at once if this frame might be the next one to end.
        """
        airtime = self._airtime.get(size)
        if airtime is None:
            radio = self._radio
            airtime = self._airtime[size] = airtime_ns(size + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
        counts = self._counts
        asked = counts[s.ASKED_N]
        _pack(self._asked_bytes, asked * _ROW_BYTES, slot, src, dst, airtime, start_ns, wants_status)
        counts[s.ASKED_N] = asked + 1
        if start_ns + airtime < self.next_output_ns or asked + 1 == _MOST_ASKED:
            self._take_in()

    def _take_in(self) -> None:
        """Hand the requests that wait in `asked` to the kernel."""
        counts = self._counts
        if counts[s.HS_N] + counts[s.ASKED_N] + 2 * kernel.MARGIN > len(self._hs):
            self._more_starts(len(self._hs))
        self.next_output_ns = kernel.take_in(
            self.g, self._p, self.st, self.fr, self._hs, self._asked, self.next_output_ns
        )

    def advance(self, until_ns: int) -> Rows:
        """Let time pass until `until_ns`; returns the output rows (`emulator.kernel.state.OUT_*`) in order."""
        rows: Rows = []
        while True:
            bound_ns = self._entry.advance(until_ns)
            count = self._counts[s.OUT_N]
            if count:
                rows += _unpack(self._out_rows[count])
            if bound_ns >= 0:
                self.next_output_ns = bound_ns
                return rows
            if not count:
                self._more_starts(len(self._hs))

    def _more_starts(self, rows: int) -> None:
        """Make room for `rows` more planned starts."""
        self._hs = np.concatenate([self._hs, np.zeros((rows, 5), np.int64)])
        self._renew_entry()

    def _renew_entry(self) -> None:
        """Make the entry to `kernel.advance` anew, as is needed whenever an array has been replaced."""
        self._entry = KernelEntry(
            self.g, self._p, self._pf, self.st, self._sf, self.fr, self._lk, self._lp, self._ptr, self._hs, self._hr,
            self._asked, self._out, self._err,
        )  # fmt: skip

    def busy_ns(self, now_ns: int) -> int:
        """The time for which the PHY was not idle, summed over all stations."""
        since = self.st[s.BUSY_SINCE]
        return int(self.st[s.BUSY_NS].sum() + np.where(since >= 0, now_ns - since, 0).sum())

"""Makes the kernel's arrays for a scenario: parameters, stations, and room for frames and events."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from emulator.channel.error_rate import SHORT_BYTES, header_rates, log_success_per_bit
from emulator.channel.fading import law_of, tables
from emulator.channel.link_budget import carrier_sense_mw, energy_mw, milliwatt, noise_mw, sensitivities_mw
from emulator.channel.propagation import LinkTable
from emulator.kernel import state as s
from emulator.kernel.entry import KernelEntry
from emulator.kernel.fading_gain import WAVE_COLUMNS
from emulator.kernel.random_numbers import MODULUS
from fanet_mw.airtime import DETECT_NS, Timing, airtime_ns
from fanet_mw.rng import stream_seed
from fanet_mw.scenario import Radio, Scenario

MOST_ASKED: Final = 256
"""The greatest number of requests that wait to be passed to the kernel."""
_SLOTS: Final = 1000
"""No power of two: with one, the rows of a frame would compete for the same few lines of the processor's cache."""


@dataclass(slots=True)
class Arrays:
    """The arrays of `emulator.kernel.state`; one that has become too small is replaced by a larger one."""

    g: s.Ints
    p: s.Ints
    pf: s.Reals
    st: s.Ints
    sf: s.Reals
    fr: s.Ints
    lk: s.Ints
    lp: s.Reals
    ptr: s.Ints
    wv: s.Reals
    tb: s.Reals
    hs: s.Ints
    hr: s.Ints
    asked: s.Ints
    out: s.Ints
    err: s.Reals

    def entry(self) -> KernelEntry:
        """The entry to `kernel.advance`; it is valid until an array is replaced."""
        return KernelEntry(
            self.g, self.p, self.pf, self.st, self.sf, self.fr, self.lk, self.lp, self.ptr, self.wv, self.tb,
            self.hs, self.hr, self.asked, self.out, self.err,
        )  # fmt: skip

    def use(self, links: LinkTable) -> None:
        self.lk, self.lp, self.ptr = links.ints, links.reals, links.ptr

    def busy_ns(self, now_ns: int) -> int:
        since = self.st[s.BUSY_SINCE]
        return int(self.st[s.BUSY_NS].sum() + np.where(since >= 0, now_ns - since, 0).sum())


def arrays_of(scenario: Scenario, links: LinkTable, *, stations: int, capture: bool) -> Arrays:
    """The arrays at the start; with `capture` each start of a transmission is reported."""
    radio = scenario.radio
    return Arrays(
        g=np.zeros(s.GLOBALS, np.int64),
        p=_parameters(scenario, capture=capture),
        pf=_real_parameters(radio),
        st=_stations(scenario, stations),
        sf=_station_reals(radio, stations),
        fr=np.zeros((s.FRAME_ROWS, _SLOTS), np.int64),
        lk=links.ints,
        lp=links.reals,
        ptr=links.ptr,
        wv=np.zeros((stations, WAVE_COLUMNS)),
        tb=tables(radio),
        hs=np.zeros((8 * stations + 2 * _SLOTS + 64, 5), np.int64),
        hr=np.zeros((64, 5), np.int64),
        asked=np.zeros((MOST_ASKED, s.ASKED_COLUMNS), np.int64),
        out=np.zeros((2 * radio.queue_frames + 1024, s.OUT_COLUMNS), np.int64),
        err=_error_table(radio.rate_mbps, radio.ack_rate_mbps, radio.ofdm_errors)
        if radio.channel != "range"
        else np.zeros((4, 1)),
    )


def _parameters(scenario: Scenario, *, capture: bool) -> s.Ints:
    radio, timing = scenario.radio, Timing.of(scenario.radio)
    as_ns3, sinr = radio.as_ns3, radio.channel != "range"
    fading, _ = law_of(radio)
    p = np.zeros(s.PARAMETERS, np.int64)
    p[:] = (
        timing.slot_ns, timing.sifs_ns, timing.difs_ns, timing.eifs_extra_ns, timing.ack_ns,
        timing.ack_timeout_ns, timing.header_ns, DETECT_NS, radio.cw_min, radio.cw_max, radio.max_attempts,
        radio.queue_frames,
        "difs" in as_ns3, "eifs" in as_ns3, sinr and energy_mw(radio) < math.inf, sinr and "onset" in as_ns3,
        "window" in as_ns3, sinr, capture, timing.extension_ns, radio.capture, fading,
        airtime_ns(SHORT_BYTES - 1, radio, rate_mbps=radio.rate_mbps),
    )  # fmt: skip
    return p


def _real_parameters(radio: Radio) -> s.Reals:
    _, shape = law_of(radio)
    data_mw, ack_mw = sensitivities_mw(radio)
    return np.array(
        [
            milliwatt(radio.preamble_snr_db),
            header_rates(radio.rate_mbps)[1],
            radio.rate_mbps * 1e-3,
            radio.ack_rate_mbps * 1e-3,
            radio.rate_mbps * 1e-3,
            data_mw,
            ack_mw,
            data_mw,
            milliwatt(radio.capture_db),
            carrier_sense_mw(radio),
            energy_mw(radio),
            shape,
        ]
    )


def _stations(scenario: Scenario, stations: int) -> s.Ints:
    radio, seed = scenario.radio, scenario.seed
    st = np.zeros((s.STATION_ROWS, stations), np.int64)
    for row, value in (
        (s.SCHEDULED, -1), (s.CW, radio.cw_min), (s.TX_FRAME, -1), (s.LOCK, -1), (s.WAITING, -1), (s.ACK_TO, -1),
        (s.HEAD, -1), (s.TAIL, -1), (s.BUSY_SINCE, -1), (s.IDLE_FROM, -Timing.of(radio).difs_ns),
    ):  # fmt: skip
        st[row] = value
    st[s.RANDOM] = [stream_seed(seed, "backoff", i + 1) % (MODULUS - 1) + 1 for i in range(stations)]
    st[s.FAULT_RANDOM] = [stream_seed(seed, "fault", i + 1) % (MODULUS - 1) + 1 for i in range(stations)]
    return st


def _station_reals(radio: Radio, stations: int) -> s.Reals:
    sf = np.zeros((s.STATION_REALS, stations), np.float64)
    sf[s.NOISE] = noise_mw(radio)
    return sf


@lru_cache(maxsize=8)
def _error_table(rate_mbps: float, ack_rate_mbps: float, model: str) -> npt.NDArray[np.float64]:
    """The rows of the kernel's `err`: PLCP header, data, ACK, short data (see `emulator.kernel.state.LOCK_RATE`)."""
    rows = (
        (header_rates(rate_mbps)[0], True),
        (rate_mbps, False),
        (ack_rate_mbps, True),
        (rate_mbps, True),
    )
    return np.stack([log_success_per_bit(rate, model, short=short) for rate, short in rows])

"""Airtimes and MAC timing by standard: `b` (DSSS, HR/DSSS), `g` (`b`, and OFDM at 2.4 GHz), `a` (OFDM at 5 GHz).

    DSSS   PLCP preamble and header + payload bits / rate, rounded up to 1 us
    OFDM   preamble 16 us + SIGNAL 4 us + 4 us per symbol of (SERVICE 16 + payload + tail 6) bits, + 6 us at 2.4 GHz

Clauses are of IEEE 802.11-2020: 15 and 16 (DSSS), 17 (OFDM), 18 (ERP). Not modeled: protection of OFDM frames from
stations that know only DSSS, 5 and 10 MHz channels, QoS access categories.
"""

import math
from typing import Final, NamedTuple, Protocol

from fanet_mw.units import US

OVERHEAD_BYTES: Final = 8 + 20 + 8 + 24 + 4
"""The bytes around each frame of this project, the UDP payload: UDP, IPv4, LLC/SNAP, MAC header, FCS."""
ACK_BYTES: Final = 14
OFDM_RATES_MBPS: Final = (6.0, 9.0, 12.0, 18.0, 24.0, 36.0, 48.0, 54.0)
DETECT_NS: Final = 4 * US
"""From a frame's first bit at a station until it detects it and senses the medium busy (as in ns-3)."""
OFDM_HEADER_NS: Final = 20 * US  # 17.3.2.4 and table 17-5: two training fields of 8 us, SIGNAL of 4 us
SYMBOL_NS: Final = 4 * US  # table 17-5 (T_SYM)
SIGNAL_EXTENSION_NS: Final = 6 * US  # table 18-5 (aSignalExtension), ERP-OFDM only
_SERVICE_AND_TAIL_BITS: Final = 16 + 6  # 17.3.5.2, 17.3.5.3


def is_ofdm(rate_mbps: float) -> bool:
    """True if a rate is sent by OFDM (clauses 17 and 18 of IEEE 802.11-2020) and not by DSSS."""
    return rate_mbps in OFDM_RATES_MBPS


def plcp_ns(*, short: bool) -> int:
    """The duration of PLCP preamble and header: 144 + 48 us, or 72 + 24 us when short (16.2.2)."""
    return 96 * US if short else 192 * US


def frame_ns(size: int, *, rate_mbps: float, short: bool) -> int:
    """Airtime of `size` bytes, FCS included; payload rounded up to us (16.3.4); no short preamble at 1 Mb/s."""
    return plcp_ns(short=short and rate_mbps > 1) + math.ceil(8 * size / rate_mbps - 1e-9) * US


def ofdm_frame_ns(size: int, *, rate_mbps: float, extension_ns: int = 0) -> int:
    """Airtime of a MAC frame of `size` bytes at an OFDM rate (17.4.3, equation 17-29; with the extension, 18.5.3)."""
    bits_per_symbol = round(rate_mbps * SYMBOL_NS / US)
    return OFDM_HEADER_NS + -(-(_SERVICE_AND_TAIL_BITS + 8 * size) // bits_per_symbol) * SYMBOL_NS + extension_ns


class RadioTiming(Protocol):
    """What airtimes depend on: the table `[radio]` of a scenario."""

    @property
    def standard(self) -> str: ...
    @property
    def rate_mbps(self) -> float: ...
    @property
    def ack_rate_mbps(self) -> float: ...
    @property
    def preamble(self) -> str: ...
    @property
    def slot(self) -> str: ...
    @property
    def coverage_class(self) -> int: ...
    @property
    def cw_min(self) -> int: ...


class Timing(NamedTuple):
    """The durations that the DCF needs, in ns."""

    slot_ns: int
    sifs_ns: int
    difs_ns: int
    ack_ns: int
    ack_timeout_ns: int
    eifs_extra_ns: int
    header_ns: int
    extension_ns: int
    """The last part of a frame, in which nothing is transmitted but the medium counts as busy."""

    @classmethod
    def of(cls, radio: RadioTiming) -> "Timing":
        """The values that follow from the scenario's standard, rates and preamble."""
        short = radio.preamble == "short"
        ofdm = is_ofdm(radio.rate_mbps)
        extension_ns = SIGNAL_EXTENSION_NS if ofdm and radio.standard == "g" else 0
        sifs_ns = 16 * US if radio.standard == "a" else 10 * US  # tables 17-21, 15-5, 18-5 (aSIFSTime)
        slot_ns = 9 * US if radio.standard == "a" or radio.slot == "short" else 20 * US  # tables as above (aSlotTime)
        slot_ns += 3 * US * radio.coverage_class  # aAirPropagationTime, table 9-101
        header_ns = OFDM_HEADER_NS if ofdm else plcp_ns(short=short)
        if radio.standard == "a":
            lowest_ack_ns = ofdm_frame_ns(ACK_BYTES, rate_mbps=6)
        else:
            lowest_ack_ns = frame_ns(ACK_BYTES, rate_mbps=1, short=False)
        return cls(
            slot_ns=slot_ns,
            sifs_ns=sifs_ns,
            difs_ns=sifs_ns + 2 * slot_ns,  # 10.3.7
            ack_ns=airtime_ns(ACK_BYTES, radio, rate_mbps=radio.ack_rate_mbps),
            ack_timeout_ns=sifs_ns + slot_ns + header_ns,  # 10.3.2.11: ACKTimeout interval
            eifs_extra_ns=sifs_ns + lowest_ack_ns,  # 10.3.7: EIFS - DIFS, an ACK at the lowest mandatory rate
            header_ns=header_ns,
            extension_ns=extension_ns,
        )


def airtime_ns(size: int, radio: RadioTiming, *, rate_mbps: float) -> int:
    """Airtime of a MAC frame of `size` bytes, FCS included, at one of the rates of the scenario's standard."""
    if is_ofdm(rate_mbps):
        extension_ns = SIGNAL_EXTENSION_NS if radio.standard == "g" else 0
        return ofdm_frame_ns(size, rate_mbps=rate_mbps, extension_ns=extension_ns)
    return frame_ns(size, rate_mbps=rate_mbps, short=radio.preamble == "short")


def longest_access_ns(size: int, radio: RadioTiming) -> int:
    """The longest time of such a frame at an idle medium: DIFS, an earlier frame's longest backoff, airtime."""
    return _access_ns(size, radio, backoff_slots=radio.cw_min)


def mean_access_ns(size: int, radio: RadioTiming) -> int:
    """The time that such a frame takes at an idle medium on average: DIFS, a mean backoff, and its airtime."""
    return _access_ns(size, radio, backoff_slots=radio.cw_min / 2)


def _access_ns(size: int, radio: RadioTiming, *, backoff_slots: float) -> int:
    timing = Timing.of(radio)
    air_ns = airtime_ns(size + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return air_ns + timing.difs_ns + int(backoff_slots * timing.slot_ns)

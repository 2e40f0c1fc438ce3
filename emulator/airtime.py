"""How long things take: IEEE 802.11-2020 clause 15 (DSSS, 1 and 2 Mb/s) and clause 16 (HR/DSSS, 5.5 and 11 Mb/s)."""

import math
from typing import Final, NamedTuple

from fanet_mw.scenario import Radio
from fanet_mw.units import MS, US

OVERHEAD_BYTES: Final = 8 + 20 + 8 + 24 + 4
"""UDP + IPv4 + LLC/SNAP + MAC header + FCS: what surrounds our frame, which is the UDP payload."""
ACK_BYTES: Final = 14
SLOT_NS: Final = 20 * US  # table 15-5 (aSlotTime)
SIFS_NS: Final = 10 * US  # table 15-5 (aSIFSTime)
DIFS_NS: Final = SIFS_NS + 2 * SLOT_NS  # 10.3.7
DETECT_NS: Final = 4 * US
"""From the first bit at a station until the preamble is found and the medium sensed busy (as ns-3 has it)."""


def plcp_ns(*, short: bool) -> int:
    """PLCP preamble and header: 144 + 48 us, or 72 + 24 us short (16.2.2)."""
    return 96 * US if short else 192 * US


def frame_ns(size: int, *, rate_mbps: float, short: bool) -> int:
    """Airtime of a MAC frame of `size` bytes, FCS included; payload time is rounded up to whole us (16.3.4).

    The short preamble does not exist at 1 Mb/s.
    """
    return plcp_ns(short=short and rate_mbps > 1) + math.ceil(8 * size / rate_mbps - 1e-9) * US


class Timing(NamedTuple):
    """Everything the DCF needs, in ns."""

    ack_ns: int
    ack_timeout_ns: int
    eifs_extra_ns: int
    header_ns: int

    @classmethod
    def of(cls, radio: Radio) -> "Timing":
        short = radio.preamble == "short"
        header_ns = plcp_ns(short=short)
        return cls(
            ack_ns=frame_ns(ACK_BYTES, rate_mbps=radio.ack_rate_mbps, short=short),
            ack_timeout_ns=SIFS_NS + SLOT_NS + header_ns,  # 10.3.2.11: ACKTimeout interval
            eifs_extra_ns=SIFS_NS + frame_ns(ACK_BYTES, rate_mbps=1, short=False),  # 10.3.7: EIFS - DIFS
            header_ns=header_ns,
        )


def lifetime_ns(radio: Radio) -> int:
    return round(radio.lifetime_ms * MS)

"""The constants of an 802.11 MAC that decide how long a frame contends for the channel."""

from typing import NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import US


class Dcf(NamedTuple):
    """The constants of a MAC; by default 802.11b, long preamble, ACK at 11 Mb/s (IEEE 802.11-2020, clauses 15, 16)."""

    slot_ns: int = 20 * US
    sifs_ns: int = 10 * US
    eifs_ns: int = 364 * US
    ack_ns: int = 203 * US
    ack_timeout_ns: int = 222 * US
    cw_min: int = 31
    cw_max: int = 1023
    attempts: int = 7

    @classmethod
    def of(cls, radio: Radio) -> "Dcf":
        """The constants that follow from a scenario's standard, rates and preamble."""
        timing = Timing.of(radio)
        return cls(
            slot_ns=timing.slot_ns,
            sifs_ns=timing.sifs_ns,
            eifs_ns=timing.difs_ns + timing.eifs_extra_ns,
            ack_ns=timing.ack_ns,
            ack_timeout_ns=timing.ack_timeout_ns,
            cw_min=radio.cw_min,
            cw_max=radio.cw_max,
            attempts=radio.max_attempts,
        )

    def window(self, attempt: int) -> int:
        """The contention window [slots] of an attempt; the first attempt is 0 (10.3.3)."""
        return min(self.cw_max, ((self.cw_min + 1) << attempt) - 1)

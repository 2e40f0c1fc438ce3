"""One slot per period that sends whole frames in FIFO order: the service that it guarantees, and its guard time.

|<------------- P ------------->|
|   S   |                       |   S   |      a frame of airtime C starts only if it also ends within the slot
 C C C x                                       k = floor(S/C) frames fit; the rest x of the slot stays empty

The worst instant to arrive is just after the last start that fits, S - C into the slot. From there the n-th frame of
a queue that never empties is completed within

    completion(n) = (P - S + C) + floor((n-1)/k) P + ((n-1) mod k + 1) C

Arriving earlier, with room for j frames, costs the first j only their airtime and postpones none. Frames shorter than
C start no later than if all had airtime C, so the largest airtime bounds a mix. Not modeled: contention within the
slot, loss, clock error (subtract the guard time from S).
"""

from fractions import Fraction
from math import ceil
from typing import Final, NamedTuple, Protocol

from fanet_mw.airtime import OVERHEAD_BYTES, Timing, airtime_ns
from fanet_mw.errors import LocalProtocolError
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import LIGHT_M_PER_S, MS, US, S


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


class Server(Protocol):
    """What the bounds need to know of a head's service: how fast its queue empties in the worst case."""

    @property
    def frames(self) -> int:
        """The number of frames per period."""
        ...

    @property
    def period_ns(self) -> int: ...

    @property
    def latency_ns(self) -> Fraction:
        """T of the rate-latency curve below the service: completion(n) <= T + n period / frames."""
        ...

    def check(self) -> None:
        """Raise LocalProtocolError when the geometry is impossible."""

    def completion_ns(self, n: int) -> int:
        """The longest time from the beginning of a busy period until `n` frames are completed."""
        ...

    def served(self, window_ns: int) -> int:
        """The number of frames that are certainly completed after `window_ns` of a busy period."""
        ...


class SlotServer(NamedTuple):
    """The service of one slot per period: C, S and P as above."""

    airtime_ns: int
    slot_ns: int
    period_ns: int

    def check(self) -> None:
        if self.airtime_ns <= 0 or not 0 < self.slot_ns <= self.period_ns:
            raise LocalProtocolError(
                f"airtime_ns = {self.airtime_ns} must be > 0 and "
                f"slot_ns = {self.slot_ns} in (0, period_ns = {self.period_ns}]"
            )

    @property
    def frames(self) -> int:
        return self.slot_ns // self.airtime_ns

    @property
    def latency_ns(self) -> Fraction:
        """The first frame of a slot decides the latency: since P >= k C, the other frames need less."""
        return self.completion_ns(1) - Fraction(self.period_ns, self.frames)

    def completion_ns(self, n: int) -> int:
        turns, rest = divmod(n - 1, self.frames)
        return self.period_ns - self.slot_ns + self.airtime_ns * (rest + 2) + turns * self.period_ns

    def served(self, window_ns: int) -> int:
        left_ns = window_ns - (self.period_ns - self.slot_ns + self.airtime_ns)
        if left_ns < self.airtime_ns:
            return 0
        turns, rest_ns = divmod(left_ns, self.period_ns)
        return turns * self.frames + min(self.frames, rest_ns // self.airtime_ns)


PLANNED_ERROR_NS: Final = 50 * US
"""The clock error that a plan before take-off assumes of synchronized clocks."""


def slot_guard_ns(scenario: Scenario, *, clock_error_ns: int) -> int:
    """The guard time of a slot; `auto` covers two opposite clock errors of `clock_error_ns`, the propagation over
    `radio.range_m`, and one data frame that starts just before the guard, but no relays that follow it.
    """
    given_ms, radio = scenario.clusters.guard_ms, scenario.radio
    if given_ms != "auto":
        return round(given_ms * MS)
    overhang_ns = airtime_ns(scenario.traffic.payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return 2 * clock_error_ns + ceil(radio.range_m * S / LIGHT_M_PER_S) + overhang_ns

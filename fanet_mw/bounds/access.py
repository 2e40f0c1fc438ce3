"""Medium access: how long an acknowledged unicast can take at an 802.11 station, from its queueing to its outcome.

DCF gives no bound against stations that always have something to send: a station that draws a backoff of 0 again and
again can hold the others off without end. A bound needs limited traffic, which a contention window of the superframe
provides:

  * n stations, this one included, can be sensed (their frames or the acknowledgements to them); no other traffic;
  * each other station sends at most m frames from the queueing of this station's frame until its outcome is known;
  * this station has at most f frames queued, the frame in question last;
  * every frame has at most R attempts (IEEE 802.11-2020, 10.3.4.4).

An attempt of its own costs at most    EIFS + CW_i slots + airtime + max(SIFS + ACK, ACK timeout), CW_i = 2^i (CW+1) - 1
An attempt of another one freezes it   airtime + SIFS + ACK + EIFS + 1 slot (cut short by it), (n-1) m R times

The bound is f times the first, summed over i < R, plus all of the second. EIFS stands for every DIFS, because any
reception may have failed (10.3.7). Attempts that collide overlap in time; to count them separately is on the safe side.
The outcome that is bounded is that the frame is acknowledged or given up: hidden stations can make all R attempts fail,
so there is no bound on delivery. The bound lies far above what is measured, because all backoffs would have to be the
greatest at once.
"""

from typing import NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.bounds.delay_bound import Bounded, DelayBound, Refused
from fanet_mw.errors import LocalProtocolError
from fanet_mw.scenario.radio import Radio
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


class ContendingTraffic(NamedTuple):
    """The traffic to contend with.

    There are n stations in all; each other one sends m frames of this airtime, and f frames are queued here.
    """

    stations: int
    airtime_ns: int
    frames_each: int = 1
    own_frames: int = 1


def access_bound(
    dcf: Dcf, own_airtime_ns: int, others: ContendingTraffic, *, window_ns: int | None = None
) -> DelayBound:
    """The longest time from queueing an acknowledged unicast to its outcome; refused if `window_ns` is shorter."""
    if others.stations < 1 or others.frames_each < 0 or others.own_frames < 1 or own_airtime_ns <= 0:
        raise LocalProtocolError(f"{others} and {own_airtime_ns=} must have stations, own frames and airtime > 0")
    answer_ns = max(dcf.sifs_ns + dcf.ack_ns, dcf.ack_timeout_ns)
    own_ns = sum(dcf.eifs_ns + dcf.window(i) * dcf.slot_ns + own_airtime_ns + answer_ns for i in range(dcf.attempts))
    freeze_ns = others.airtime_ns + dcf.sifs_ns + dcf.ack_ns + dcf.eifs_ns + dcf.slot_ns
    freezes = (others.stations - 1) * others.frames_each * dcf.attempts
    bound_ns = others.own_frames * own_ns + freezes * freeze_ns
    if window_ns is not None and bound_ns > window_ns:
        return Refused(f"access may take {bound_ns} ns, the contention window is {window_ns} ns")
    return Bounded(bound_ns)

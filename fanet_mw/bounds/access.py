"""The way to the head: how long an acknowledged unicast can take at an 802.11 station, and what a guard time must hold.

DCF gives no bound against stations that always have something to send: one that draws a backoff of 0 again and again
can hold the others off without end. A bound needs limited traffic, which a contention window of the superframe gives:

  * n stations, this one included, can be sensed (their frames or the acknowledgements to them); no other traffic;
  * each of the others sends at most m frames from the instant at which ours is queued until its outcome is known;
  * this station has at most f frames queued, ours last;
  * every frame has at most R attempts (IEEE 802.11-2020, 10.3.4.4).

An attempt of ours costs at most   EIFS + CW_i slots + airtime + max(SIFS + ACK, ACK timeout), CW_i = 2^i (CW+1) - 1
An attempt of another freezes us   airtime + SIFS + ACK + EIFS + 1 slot (which it cut short), (n-1) m R times

and the bound is f times the first, summed over i < R, plus all of the second. EIFS stands for every DIFS, for
any reception may have failed (10.3.7). Attempts that collide overlap; counting them apart is on the safe side. The
bound is for the outcome, acknowledged or given up: hidden stations can make all R attempts fail, and no bound on
delivery exists then.
It is far above what is seen: all backoffs would have to be the greatest at once.
"""

from math import ceil
from typing import Final, NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.bounds.outcome import Bounded, Outcome, Refused
from fanet_mw.errors import LocalProtocolError
from fanet_mw.scenario.radio import Radio
from fanet_mw.units import US

_LIGHT_M_PER_S: Final = 299_792_458


class Dcf(NamedTuple):
    """The MAC's constants; defaults: 802.11b, long preamble, ACK at 11 Mb/s (IEEE 802.11-2020, clauses 15, 16)."""

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
        """The constants that a scenario's standard, rates and preamble give."""
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
        """The contention window [slots] of an attempt, the first being 0 (10.3.3)."""
        return min(self.cw_max, ((self.cw_min + 1) << attempt) - 1)


class Contention(NamedTuple):
    """Who else is there: n stations in all, m frames from each other one, f frames queued here, the others' airtime."""

    stations: int
    airtime_ns: int
    frames_each: int = 1
    own_frames: int = 1


def access_bound(dcf: Dcf, own_airtime_ns: int, others: Contention, *, window_ns: int | None = None) -> Outcome:
    """The longest time from queueing an acknowledged unicast to its outcome; refused if the window is shorter."""
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


def guard_ns(*, clock_error_ns: int, drift_ppm: float, resync_ns: int, range_m: float, overhang_ns: int) -> int:
    """The silent end of a slot that keeps two heads apart.

    Both clocks may be off by `clock_error_ns` when set, and drift apart at twice `drift_ppm` for `resync_ns` until they
    are set again; the last frame travels `range_m`, and goes on for `overhang_ns` after the last permitted start.
    """
    drift_ns = ceil(2 * drift_ppm * resync_ns / 1_000_000)
    return 2 * clock_error_ns + drift_ns + ceil(range_m * 1_000_000_000 / _LIGHT_M_PER_S) + overhang_ns

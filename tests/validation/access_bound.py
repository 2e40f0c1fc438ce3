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

from fanet_mw.bounds import Bounded, Dcf, DelayBound, Refused
from fanet_mw.errors import LocalProtocolError


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

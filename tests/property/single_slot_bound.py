"""The bound of one periodic flow in one slot in closed form, to compare others with."""

from fanet_mw.bounds import Bounded, DelayBound, Refused, SlotServer
from fanet_mw.errors import LocalProtocolError


def single_slot_bound(server: SlotServer, *, interval_ns: int) -> DelayBound:
    """The worst delay, from arrival to end of airtime, of packets that arrive every `interval_ns` = p in any phase.

    It is the maximum over q of completion(q) - (q-1) p, for all q of the busy period (Davis et al. 2007, "Controller
    Area Network (CAN) schedulability analysis: refuted, revisited and revised"). Stable iff k p >= P; then q and q + k
    differ by P - k p <= 0, so q = 1..k hold the maximum; and p >= P/k >= C makes the terms fall from q = 1 on. What
    remains is P - S + 2 C for every p. It is a supremum: arrivals 1 ns after the last start stay 1 ns below it.
    """
    server.check()
    if interval_ns <= 0:
        raise LocalProtocolError(f"interval_ns = {interval_ns} must be > 0")
    if not server.frames:
        return Refused(f"airtime {server.airtime_ns} ns > slot {server.slot_ns} ns: no frame ever fits")
    if server.frames * interval_ns < server.period_ns:
        return Refused(
            f"unstable: {server.frames} frames fit a slot every {server.period_ns} ns, "
            f"{server.period_ns / interval_ns:.3f} arrive (one every {interval_ns} ns)"
        )
    return Bounded(server.completion_ns(1))

"""Equations (1)-(4) of the paper, Section 3.3, exactly as published: an estimate for comparison, not a bound.

    w(q) = ceil((q b/R) / S) p_c                              (4)    S = ((b/R)/p) p_c unless a slot is given
    WD_c = max over q = 1..Q of w(q) - (q-1) p                (2, 3) Q: the first integer with w(Q) <= Q p
    WD   = sum of WD_c over the clusters c on the path        (1)

Here C = b/R is `airtime_ns`, p `interval_ns`, p_c `period_ns`, S `slot_ns`. Equation (4) is wrong in three ways. It
lets a slot serve fractions of a packet, so slots that are no multiple of C look larger than they are. It counts from
the beginning of a period, so a packet that has just missed its slot waits longer than w(1). And it takes arrivals at
every hop as periodic. If C p_c > S p, no Q exists, so the equations give no number. With the paper's own S always C p_c
= S p, so they accept any load, even a single packet that is longer than the period.
"""

from fractions import Fraction
from math import gcd
from typing import Final

from fanet_mw.bounds.arrivals import Bounded, DelayBound, Refused
from fanet_mw.errors import LocalProtocolError

_SLOTS_EXAMINED: Final = 100_000
"""The estimate is refused for busy periods of more slots than this."""


def paper_slot(*, airtime_ns: int, interval_ns: int, period_ns: int) -> Fraction:
    """S = ((b/R)/p) p_c [ns], a fraction: the slot that just holds the packets of one period."""
    return Fraction(airtime_ns * period_ns, interval_ns)


def cluster_estimate(
    *, airtime_ns: int, slot_ns: Fraction | int | None, period_ns: int, interval_ns: int
) -> DelayBound:
    """WD_c of equation (3); `slot_ns` None stands for the paper's own S.

    That serves exactly p_c/p packets a slot, so Q is the first m p_c / p that is an integer, and WD_c = p_c + p -
    gcd(p, p_c), whatever the airtime. For another S all q with the same ceiling share w(q): the first of each is
    examined. Refused when no Q exists, or beyond `_SLOTS_EXAMINED` slots.
    """
    if min(airtime_ns, period_ns, interval_ns) <= 0 or (slot_ns is not None and slot_ns <= 0):
        raise LocalProtocolError(f"{airtime_ns=} {slot_ns=} {period_ns=} {interval_ns=} must all be > 0")
    own = paper_slot(airtime_ns=airtime_ns, interval_ns=interval_ns, period_ns=period_ns)
    slot = own if slot_ns is None else Fraction(slot_ns)
    if slot < own:
        return Refused(
            f"no Q in equation (3): slot {float(slot):.0f} ns < (airtime/interval) period = {float(own):.0f} ns"
        )
    if slot == own:
        return Bounded(period_ns + interval_ns - gcd(period_ns, interval_ns))
    packets, slots = (slot / airtime_ns).as_integer_ratio()
    worst_ns = last = 0
    for m in range(1, _SLOTS_EXAMINED + 1):
        first, last = last + 1, m * packets // slots
        if first > last:  # no q has this ceiling, because S < C
            continue
        worst_ns = max(worst_ns, m * period_ns - (first - 1) * interval_ns)
        if m * period_ns <= last * interval_ns:
            return Bounded(worst_ns)
    return Refused(f"Q in equation (3) lies beyond {_SLOTS_EXAMINED} slots")

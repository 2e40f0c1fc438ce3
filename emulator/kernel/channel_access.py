"""When a station may transmit: DIFS or EIFS, the contention window and the backoff (IEEE 802.11-2020, 10.3.3), as
functions over the rows of its state.

Slots are counted from BASE while the medium is idle. A pending access is one event, stale if SCHEDULED holds another
instant. After a failed reception EIFS takes the place of DIFS (10.3.2.3.7), from the instant at which the medium is
idle; interrupted it begins again, until it has passed or a frame is received. In ns-3.44 the extension beyond DIFS
begins at the end of the bad frame, and passes while the medium is busy.
"""

from emulator.kernel.heap import push
from emulator.kernel.jit import jit
from emulator.kernel.random_numbers import MODULUS, uniform
from emulator.kernel.state import (
    ACCESS,
    ACK_TO,
    BAD_UNTIL,
    BASE,
    BO,
    BUSY_NS,
    BUSY_SINCE,
    CS,
    CW,
    CW_MAX,
    CW_MIN,
    DIFS_FIRST,
    DIFS_NS,
    EIFS_EXTRA_NS,
    EIFS_FROM_FRAME,
    FAILURES,
    FRESH,
    HEAD,
    HS_N,
    IDLE_FROM,
    KEEPS_WINDOW,
    MAX_ATTEMPTS,
    NAV,
    NEVER,
    NOTHING,
    RANDOM,
    RESUME_FROM,
    SCHEDULED,
    SLOT_NS,
    TX_KIND,
    WAITING,
    Ints,
)


@jit
def draw(st: Ints, s: int) -> None:
    st[BO, s] = uniform(st, RANDOM, s) * (st[CW, s] + 1) // MODULUS


@jit
def reset_window(p: Ints, st: Ints, s: int) -> None:
    """Begin anew with the least window."""
    st[CW, s] = p[CW_MIN]
    st[FAILURES, s] = 0


@jit
def widen_window(p: Ints, st: Ints, s: int) -> None:
    """Double the window after a failure; where it outlives frames, begin anew after so many failures in a row."""
    if p[KEEPS_WINDOW] == 1 and st[FAILURES, s] == p[MAX_ATTEMPTS]:
        reset_window(p, st, s)
    else:
        st[FAILURES, s] += 1
        st[CW, s] = min(2 * st[CW, s] + 1, p[CW_MAX])


@jit
def access_from(p: Ints, st: Ints, s: int) -> int:
    """The instant from which backoff slots count, if the medium stays idle."""
    return int(max(st[IDLE_FROM, s], st[BAD_UNTIL, s], st[RESUME_FROM, s], st[NAV, s]) + p[DIFS_NS])


@jit
def arm(g: Ints, p: Ints, st: Ints, hs: Ints, s: int) -> None:
    """Start the countdown of a station whose medium is idle, and plan its access if it has a frame."""
    if st[CS, s] > 0 or st[TX_KIND, s] != NOTHING or st[WAITING, s] >= 0 or st[ACK_TO, s] >= 0:
        return
    st[BASE, s] = access_from(p, st, s)
    if st[HEAD, s] >= 0:
        t = st[BASE, s] + st[BO, s] * p[SLOT_NS]
        st[SCHEDULED, s] = t
        push(hs, g, HS_N, t, ACCESS, s, 0)


@jit
def slots_left(p: Ints, st: Ints, s: int, t: int) -> int:
    """The backoff slots that are left at `t`, if the medium has been idle until then."""
    if t <= st[BASE, s]:
        return int(st[BO, s])
    return int(max(0, st[BO, s] - (t - st[BASE, s]) // p[SLOT_NS]))


@jit
def on_busy(p: Ints, st: Ints, s: int, t: int) -> None:
    """Freeze the backoff of a station, because its medium becomes busy."""
    if st[BUSY_SINCE, s] < 0:
        st[BUSY_SINCE, s] = t
        if st[BAD_UNTIL, s] + p[DIFS_NS] <= t:
            st[BAD_UNTIL, s] = 0  # the EIFS has passed
    st[BO, s] = slots_left(p, st, s, t)
    st[BASE, s] = NEVER
    if st[SCHEDULED, s] >= 0:
        st[SCHEDULED, s] = -1
        if st[FRESH, s] == 1 and p[DIFS_FIRST] == 0:
            draw(st, s)
            st[FRESH, s] = 0


@jit
def on_idle(g: Ints, p: Ints, st: Ints, hs: Ints, s: int, t: int) -> None:
    """Resume the backoff of a station, because its medium becomes idle."""
    if st[BUSY_SINCE, s] >= 0:
        st[BUSY_NS, s] += t - st[BUSY_SINCE, s]
        st[BUSY_SINCE, s] = -1
    st[IDLE_FROM, s] = t
    if p[EIFS_FROM_FRAME] == 0 and st[BAD_UNTIL, s] > 0:
        st[BAD_UNTIL, s] = t + p[EIFS_EXTRA_NS]
    arm(g, p, st, hs, s)

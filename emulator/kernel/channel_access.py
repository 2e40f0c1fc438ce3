"""When a station may transmit: DIFS or EIFS, the contention window and the backoff (IEEE 802.11-2020, 10.3.3), as
functions over the rows of its state.

Slots are counted from BASE while the medium is idle. A pending access is one event, stale if SCHEDULED holds another
instant. After a failed reception EIFS takes the place of DIFS (10.3.2.3.7), from the instant at which the medium is
idle; interrupted it begins again, until it has passed or a frame is received. In ns-3.44 the extension beyond DIFS
begins at the end of the bad frame, and passes while the medium is busy.
"""

from emulator.kernel import state as k
from emulator.kernel.heap import push
from emulator.kernel.jit import jit
from emulator.kernel.random_numbers import MODULUS, uniform
from emulator.kernel.state import Ints


@jit
def draw(st: Ints, s: int) -> None:
    st[k.BO, s] = uniform(st, k.RANDOM, s) * (st[k.CW, s] + 1) // MODULUS


@jit
def reset_window(p: Ints, st: Ints, s: int) -> None:
    """Begin anew with the least window."""
    st[k.CW, s] = p[k.CW_MIN]
    st[k.FAILURES, s] = 0


@jit
def widen_window(p: Ints, st: Ints, s: int) -> None:
    """Double the window after a failure; where it outlives frames, begin anew after so many failures in a row."""
    if p[k.KEEPS_WINDOW] == 1 and st[k.FAILURES, s] == p[k.MAX_ATTEMPTS]:
        reset_window(p, st, s)
    else:
        st[k.FAILURES, s] += 1
        st[k.CW, s] = min(2 * st[k.CW, s] + 1, p[k.CW_MAX])


@jit
def access_from(p: Ints, st: Ints, s: int) -> int:
    """The instant from which backoff slots count, if the medium stays idle."""
    return int(max(st[k.IDLE_FROM, s], st[k.BAD_UNTIL, s], st[k.RESUME_FROM, s], st[k.NAV, s]) + p[k.DIFS_NS])


@jit
def arm(g: Ints, p: Ints, st: Ints, hs: Ints, s: int) -> None:
    """Start the countdown of a station whose medium is idle, and plan its access if it has a frame."""
    if st[k.CS, s] > 0 or st[k.TX_KIND, s] != k.NOTHING or st[k.WAITING, s] >= 0 or st[k.ACK_TO, s] >= 0:
        return
    st[k.BASE, s] = access_from(p, st, s)
    if st[k.HEAD, s] >= 0:
        t = st[k.BASE, s] + st[k.BO, s] * p[k.SLOT_NS]
        st[k.SCHEDULED, s] = t
        push(hs, g, k.HS_N, t, k.ACCESS, s, 0)


@jit
def slots_left(p: Ints, st: Ints, s: int, t: int) -> int:
    """The backoff slots that are left at `t`, if the medium has been idle until then."""
    if t <= st[k.BASE, s]:
        return int(st[k.BO, s])
    return int(max(0, st[k.BO, s] - (t - st[k.BASE, s]) // p[k.SLOT_NS]))


@jit
def on_busy(p: Ints, st: Ints, s: int, t: int) -> None:
    """Freeze the backoff of a station, because its medium becomes busy."""
    if st[k.BUSY_SINCE, s] < 0:
        st[k.BUSY_SINCE, s] = t
        if st[k.BAD_UNTIL, s] + p[k.DIFS_NS] <= t:
            st[k.BAD_UNTIL, s] = 0  # the EIFS has passed
    st[k.BO, s] = slots_left(p, st, s, t)
    st[k.BASE, s] = k.NEVER
    if st[k.SCHEDULED, s] >= 0:
        st[k.SCHEDULED, s] = -1
        if st[k.FRESH, s] == 1 and p[k.DIFS_FIRST] == 0:
            draw(st, s)
            st[k.FRESH, s] = 0


@jit
def on_idle(g: Ints, p: Ints, st: Ints, hs: Ints, s: int, t: int) -> None:
    """Resume the backoff of a station, because its medium becomes idle."""
    if st[k.BUSY_SINCE, s] >= 0:
        st[k.BUSY_NS, s] += t - st[k.BUSY_SINCE, s]
        st[k.BUSY_SINCE, s] = -1
    st[k.IDLE_FROM, s] = t
    if p[k.EIFS_FROM_FRAME] == 0 and st[k.BAD_UNTIL, s] > 0:
        st[k.BAD_UNTIL, s] = t + p[k.EIFS_EXTRA_NS]
    arm(g, p, st, hs, s)

"""The exchange of frames of a station: the distributed coordination function (IEEE 802.11-2020, 10.3), over its state.

queue -> access (DIFS or EIFS, backoff with freezing) -> frame -> ACK or timeout -> next attempt or done
"""

from emulator.kernel import state as k
from emulator.kernel.channel_access import (
    access_from,
    arm,
    draw,
    on_busy,
    on_idle,
    reset_window,
    slots_left,
    widen_window,
)
from emulator.kernel.fading_gain import gain
from emulator.kernel.frame_ends import done, lost, put, release
from emulator.kernel.heap import push
from emulator.kernel.jit import jit
from emulator.kernel.state import Ints, Reals


@jit
def take_head(st: Ints, fr: Ints, s: int) -> None:
    """Remove the first frame of a station's queue."""
    st[k.HEAD, s] = fr[k.NEXT, st[k.HEAD, s]]
    if st[k.HEAD, s] < 0:
        st[k.TAIL, s] = -1
    st[k.QLEN, s] -= 1


@jit
def expire(g: Ints, st: Ints, fr: Ints, out: Ints, s: int, t: int) -> None:
    """Drop frames that waited beyond their lifetime, but not the first while on the air or its ACK is awaited; the
    contention window stays as it is.
    """
    kept = st[k.HEAD, s] if st[k.TX_KIND, s] == k.DATA or st[k.WAITING, s] >= 0 else -1
    if kept >= 0:
        take_head(st, fr, s)
    while st[k.HEAD, s] >= 0 and t >= fr[k.EXPIRES, st[k.HEAD, s]]:
        f = st[k.HEAD, s]
        take_head(st, fr, s)
        done(g, fr, out, f, k.DONE_EXPIRED, t)
    if kept >= 0:
        fr[k.NEXT, kept] = st[k.HEAD, s]
        st[k.HEAD, s] = kept
        if st[k.TAIL, s] < 0:
            st[k.TAIL, s] = kept
        st[k.QLEN, s] += 1


@jit
def arrive(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints, out: Ints, f: int, t: int) -> None:
    """Put a frame into the MAC queue of its station; it is dropped when the queue is full."""
    s = fr[k.SRC, f]
    if st[k.QLEN, s] >= p[k.QUEUE_LIMIT]:
        expire(g, st, fr, out, s, t)
    if st[k.QLEN, s] >= p[k.QUEUE_LIMIT]:
        done(g, fr, out, f, k.DONE_FULL, t)
        return
    fr[k.NEXT, f] = -1
    st[k.QLEN, s] += 1
    if st[k.HEAD, s] >= 0:
        fr[k.NEXT, st[k.TAIL, s]] = f
        st[k.TAIL, s] = f
        return
    st[k.HEAD, s] = f
    st[k.TAIL, s] = f
    request(g, p, st, hs, s, t)


@jit
def request(g: Ints, p: Ints, st: Ints, hs: Ints, s: int, t: int) -> None:
    """Ask for the medium on behalf of a frame in an empty queue (802.11-2020, 10.3.4.2: at once after DIFS of idle)."""
    if st[k.TX_KIND, s] == k.DATA or st[k.WAITING, s] >= 0:
        return  # the station's own frame has not ended: its post-backoff is still to be drawn
    if st[k.CS, s] > 0 or st[k.TX_KIND, s] == k.ACK or st[k.ACK_TO, s] >= 0 or st[k.NAV, s] > t:
        before_ack = st[k.CS, s] == 0 and st[k.TX_KIND, s] != k.ACK and st[k.NAV, s] <= t  # in ns-3 this medium is idle
        if st[k.BO, s] == 0 and not (before_ack and p[k.DIFS_FIRST] == 1):
            draw(st, s)
        st[k.FRESH, s] = 0
        if st[k.CS, s] == 0:
            arm(g, p, st, hs, s)
        return
    if slots_left(p, st, s, t) == 0:
        st[k.BO, s] = 0
        st[k.FRESH, s] = 1
        start = access_from(p, st, s)
        if p[k.DIFS_FIRST] == 1:
            st[k.BASE, s] = max(start, t + p[k.DIFS_NS])
        elif start <= t:
            st[k.BASE, s] = t
        else:  # the medium is idle, but has not been so for DIFS: a backoff is due
            draw(st, s)
            st[k.FRESH, s] = 0
            st[k.BASE, s] = start
    else:
        st[k.FRESH, s] = 0
    at = st[k.BASE, s] + st[k.BO, s] * p[k.SLOT_NS]
    st[k.SCHEDULED, s] = at
    push(hs, g, k.HS_N, at, k.ACCESS, s, 0)


@jit
def access(
    g: Ints, p: Ints, pf: Reals, st: Ints, fr: Ints, lk: Ints, lp: Reals, ptr: Ints, wv: Reals, tb: Reals, hs: Ints,
    hr: Ints, out: Ints, s: int, t: int,
) -> None:  # fmt: skip
    """Transmit the first frame that is still alive, because the backoff has run out."""
    if st[k.SCHEDULED, s] != t:
        return  # the backoff was frozen or planned anew after this event was made
    st[k.SCHEDULED, s] = -1
    st[k.BO, s] = 0
    st[k.FRESH, s] = 0
    st[k.BASE, s] = t
    expire(g, st, fr, out, s, t)
    f = st[k.HEAD, s]
    if f < 0:
        return
    fr[k.ATTEMPTS, f] += 1
    begin_tx(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hr, s, f, k.DATA, t)
    targets = 0
    for link in range(ptr[s], ptr[s + 1]):
        if fr[k.DST, f] == k.EVERYONE or fr[k.DST, f] == lk[k.LINK_DST, link]:
            if lp[k.LINK_POWER, link] > 0.0 and lk[k.COPY, link] == 1:
                targets += 1
            elif lk[k.FAULT, link] != 0:
                g[k.ON_AIR_COPIES] += 1
                lost(g, fr, lk, lk[k.FAULT, link], link, f)
    fr[k.TARGETS, f] = targets
    g[k.ON_AIR_COPIES] += targets
    if fr[k.DST, f] != k.EVERYONE:
        g[k.ATTEMPTS_MADE] += 1
        g[k.MADE_BY - 1 + min(fr[k.ATTEMPTS, f], k.ATTEMPT_ROWS)] += 1
    if p[k.CAPTURE] == 1:
        put(g, out, k.OUT_START, f, s, t, k.DATA, fr[k.ATTEMPTS, f])


@jit
def begin_tx(
    g: Ints, p: Ints, pf: Reals, st: Ints, fr: Ints, lk: Ints, lp: Reals, ptr: Ints, wv: Reals, tb: Reals, hr: Ints,
    s: int, f: int, kind: int, t: int,
) -> None:  # fmt: skip
    """Let a station start to transmit; what it was receiving is lost."""
    if st[k.LOCK, s] >= 0:
        lk[k.FATE, st[k.LOCK, s]] = k.FATE_HALF_DUPLEX
        st[k.LOCK, s] = -1
    on_busy(p, st, s, t)
    airtime = fr[k.AIRTIME, f] if kind == k.DATA else p[k.ACK_NS]
    st[k.TX_KIND, s] = kind
    st[k.TX_FRAME, s] = f
    st[k.TX_END, s] = t + airtime
    st[k.ON_AIR_LIST, g[k.ON_AIR_N]] = s
    g[k.ON_AIR_N] += 1
    push(hr, g, k.HR_N, t + airtime, k.TX_DONE, s, 0)
    first, last = ptr[s], ptr[s + 1]
    while last > first and lp[k.LINK_POWER, last - 1] == 0.0:
        last -= 1  # links without power come last and carry nothing
    for link in range(first, last):
        lp[k.ON_AIR, link] = lp[k.LINK_POWER, link]
        if p[k.FADING] != 0:
            lp[k.ON_AIR, link] *= gain(g, p, pf, wv, tb, s, lk[k.LINK_DST, link], t)
        lk[k.SENSED, link] = 1 if lp[k.ON_AIR, link] >= pf[k.CARRIER_SENSE_MW] else 0
        lk[k.COPY, link] = lk[k.AUDIBLE, link]
        lk[k.FATE, link] = k.FATE_OPEN
        lk[k.LINK_FRAME, link] = f
        lk[k.LINK_KIND, link] = kind
        lk[k.UNDERWAY, link] = 1
        lk[k.BEGINS, link] = t + lk[k.DELAY, link]
        lk[k.ENDS, link] = lk[k.BEGINS, link] + airtime
    if first < last:
        fr[k.OPEN, f] += last - first
        push(hr, g, k.HR_N, lk[k.BEGINS, first], k.ALL_START, first, last)
        push(hr, g, k.HR_N, lk[k.BEGINS, first] + p[k.DETECT_NS], k.ALL_DETECT, first, last)
        push(hr, g, k.HR_N, lk[k.ENDS, first], k.ALL_END, first, last)


@jit
def leave_air(g: Ints, st: Ints, s: int, t: int) -> None:
    """Take a station off the list of those that transmit."""
    last = g[k.ON_AIR_N] - 1
    g[k.ON_AIR_N] = last
    g[k.LAST_END] = t + g[k.REACH_NS]
    for i in range(last):
        if st[k.ON_AIR_LIST, i] == s:
            st[k.ON_AIR_LIST, i] = st[k.ON_AIR_LIST, last]
            return


@jit
def tx_done(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints, out: Ints, s: int, t: int) -> None:
    """The last bit of a frame has left the antenna of its transmitter."""
    kind, f = st[k.TX_KIND, s], st[k.TX_FRAME, s]
    st[k.TX_KIND, s] = k.NOTHING
    leave_air(g, st, s, t)
    if kind == k.DATA:
        if fr[k.DST, f] == k.EVERYONE:
            take_head(st, fr, s)
            draw(st, s)
            done(g, fr, out, f, k.DONE_SENT, t)
        else:
            st[k.WAITING, s] = f
            push(hs, g, k.HS_N, t + p[k.ACK_TIMEOUT_NS], k.ACK_TIMEOUT, s, f)
    if st[k.CS, s] == 0:
        on_idle(g, p, st, hs, s, t)


@jit
def acknowledged(g: Ints, p: Ints, st: Ints, fr: Ints, out: Ints, s: int, t: int) -> None:
    """End the frame of a station that has received the ACK for it."""
    f = st[k.WAITING, s]
    st[k.WAITING, s] = -1
    reset_window(p, st, s)
    take_head(st, fr, s)
    draw(st, s)
    done(g, fr, out, f, k.DONE_ACKED, t)


@jit
def ack_timeout(g: Ints, p: Ints, st: Ints, fr: Ints, lk: Ints, hs: Ints, out: Ints, s: int, f: int, t: int) -> None:
    """No ACK: try again with a doubled window, or give up (802.11-2020, 10.3.4.4). If some header has been received by
    now, that frame may be the ACK: its end decides (10.3.2.11).
    """
    if st[k.WAITING, s] != f:
        return
    link = st[k.LOCK, s]
    if link >= 0 and st[k.LOCK_HEADER_END, s] <= t:
        push(hs, g, k.HS_N, lk[k.ENDS, link] + 1, k.ACK_TIMEOUT, s, f)
        return
    st[k.WAITING, s] = -1
    st[k.RESUME_FROM, s] = t
    g[k.ATTEMPTS_FAILED] += 1
    g[k.FAILED_BY - 1 + min(fr[k.ATTEMPTS, f], k.ATTEMPT_ROWS)] += 1
    widen_window(p, st, s)
    if fr[k.ATTEMPTS, f] >= p[k.MAX_ATTEMPTS]:
        if p[k.KEEPS_WINDOW] == 0:
            reset_window(p, st, s)
        take_head(st, fr, s)
        done(g, fr, out, f, k.DONE_RETRY, t)
    draw(st, s)
    arm(g, p, st, hs, s)


@jit
def send_ack(
    g: Ints, p: Ints, pf: Reals, st: Ints, fr: Ints, lk: Ints, lp: Reals, ptr: Ints, wv: Reals, tb: Reals, hs: Ints,
    hr: Ints, out: Ints, s: int, f: int, t: int,
) -> None:  # fmt: skip
    """Send an ACK, SIFS after the end of a unicast frame, whether or not the medium is busy."""
    st[k.ACK_TO, s] = -1
    if st[k.TX_KIND, s] == k.NOTHING:
        if p[k.CAPTURE] == 1:
            put(g, out, k.OUT_START, f, s, t, k.ACK, 0)
        begin_tx(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hr, s, f, k.ACK, t)
        release(g, fr, out, f, t)
        return
    release(g, fr, out, f, t)
    if st[k.CS, s] == 0:
        arm(g, p, st, hs, s)

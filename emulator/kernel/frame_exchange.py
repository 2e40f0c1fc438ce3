"""The exchange of frames of a station: the distributed coordination function (IEEE 802.11-2020, 10.3), over its state.

queue -> access (DIFS or EIFS, backoff with freezing) -> frame -> ACK or timeout -> next attempt or done
"""

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
from emulator.kernel.state import (
    ACCESS,
    ACK,
    ACK_NS,
    ACK_TIMEOUT,
    ACK_TIMEOUT_NS,
    ACK_TO,
    AIRTIME,
    ALL_DETECT,
    ALL_END,
    ALL_START,
    ATTEMPT_ROWS,
    ATTEMPTS,
    ATTEMPTS_FAILED,
    ATTEMPTS_MADE,
    AUDIBLE,
    BASE,
    BEGINS,
    BO,
    CAPTURE,
    CARRIER_SENSE_MW,
    COPY,
    CS,
    DATA,
    DELAY,
    DETECT_NS,
    DIFS_FIRST,
    DIFS_NS,
    DONE_ACKED,
    DONE_EXPIRED,
    DONE_FULL,
    DONE_RETRY,
    DONE_SENT,
    DST,
    ENDS,
    EVERYONE,
    EXPIRES,
    FADING,
    FAILED_BY,
    FATE,
    FATE_HALF_DUPLEX,
    FATE_OPEN,
    FAULT,
    FRESH,
    HEAD,
    HR_N,
    HS_N,
    KEEPS_WINDOW,
    LAST_END,
    LINK_DST,
    LINK_FRAME,
    LINK_KIND,
    LINK_POWER,
    LOCK,
    LOCK_HEADER_END,
    MADE_BY,
    MAX_ATTEMPTS,
    NAV,
    NEXT,
    NOTHING,
    ON_AIR,
    ON_AIR_COPIES,
    ON_AIR_LIST,
    ON_AIR_N,
    OPEN,
    OUT_START,
    QLEN,
    QUEUE_LIMIT,
    REACH_NS,
    RESUME_FROM,
    SCHEDULED,
    SENSED,
    SLOT_NS,
    SRC,
    TAIL,
    TARGETS,
    TX_DONE,
    TX_END,
    TX_FRAME,
    TX_KIND,
    UNDERWAY,
    WAITING,
    Ints,
    Reals,
)


@jit
def take_head(st: Ints, fr: Ints, s: int) -> None:
    """Remove the first frame of a station's queue."""
    st[HEAD, s] = fr[NEXT, st[HEAD, s]]
    if st[HEAD, s] < 0:
        st[TAIL, s] = -1
    st[QLEN, s] -= 1


@jit
def expire(g: Ints, st: Ints, fr: Ints, out: Ints, s: int, t: int) -> None:
    """Drop frames that waited beyond their lifetime, but not the first while on the air or its ACK is awaited."""
    kept = st[HEAD, s] if st[TX_KIND, s] == DATA or st[WAITING, s] >= 0 else -1
    if kept >= 0:
        take_head(st, fr, s)
    while st[HEAD, s] >= 0 and t >= fr[EXPIRES, st[HEAD, s]]:
        f = st[HEAD, s]
        take_head(st, fr, s)
        done(g, fr, out, f, DONE_EXPIRED, t)
    if kept >= 0:
        fr[NEXT, kept] = st[HEAD, s]
        st[HEAD, s] = kept
        if st[TAIL, s] < 0:
            st[TAIL, s] = kept
        st[QLEN, s] += 1


@jit
def arrive(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints, out: Ints, f: int, t: int) -> None:
    """Put a frame into the MAC queue of its station; it is dropped when the queue is full."""
    s = fr[SRC, f]
    if st[QLEN, s] >= p[QUEUE_LIMIT]:
        expire(g, st, fr, out, s, t)
    if st[QLEN, s] >= p[QUEUE_LIMIT]:
        done(g, fr, out, f, DONE_FULL, t)
        return
    fr[NEXT, f] = -1
    st[QLEN, s] += 1
    if st[HEAD, s] >= 0:
        fr[NEXT, st[TAIL, s]] = f
        st[TAIL, s] = f
        return
    st[HEAD, s] = f
    st[TAIL, s] = f
    request(g, p, st, hs, s, t)


@jit
def request(g: Ints, p: Ints, st: Ints, hs: Ints, s: int, t: int) -> None:
    """Ask for the medium on behalf of a frame in an empty queue (802.11-2020, 10.3.4.2: at once after DIFS of idle)."""
    if st[TX_KIND, s] == DATA or st[WAITING, s] >= 0:
        return  # the station's own frame has not ended: its post-backoff is still to be drawn
    if st[CS, s] > 0 or st[TX_KIND, s] == ACK or st[ACK_TO, s] >= 0 or st[NAV, s] > t:
        before_ack = st[CS, s] == 0 and st[TX_KIND, s] != ACK and st[NAV, s] <= t  # in ns-3 this medium is idle
        if st[BO, s] == 0 and not (before_ack and p[DIFS_FIRST] == 1):
            draw(st, s)
        st[FRESH, s] = 0
        if st[CS, s] == 0:
            arm(g, p, st, hs, s)
        return
    if slots_left(p, st, s, t) == 0:
        st[BO, s] = 0
        st[FRESH, s] = 1
        start = access_from(p, st, s)
        if p[DIFS_FIRST] == 1:
            st[BASE, s] = max(start, t + p[DIFS_NS])
        elif start <= t:
            st[BASE, s] = t
        else:  # the medium is idle, but has not been so for DIFS: a backoff is due
            draw(st, s)
            st[FRESH, s] = 0
            st[BASE, s] = start
    else:
        st[FRESH, s] = 0
    at = st[BASE, s] + st[BO, s] * p[SLOT_NS]
    st[SCHEDULED, s] = at
    push(hs, g, HS_N, at, ACCESS, s, 0)


@jit
def access(
    g: Ints,
    p: Ints,
    pf: Reals,
    st: Ints,
    fr: Ints,
    lk: Ints,
    lp: Reals,
    ptr: Ints,
    wv: Reals,
    tb: Reals,
    hs: Ints,
    hr: Ints,
    out: Ints,
    s: int,
    t: int,
) -> None:
    """Transmit the first frame that is still alive, because the backoff has run out."""
    if st[SCHEDULED, s] != t:
        return  # the backoff was frozen or planned anew after this event was made
    st[SCHEDULED, s] = -1
    st[BO, s] = 0
    st[FRESH, s] = 0
    st[BASE, s] = t
    expire(g, st, fr, out, s, t)
    f = st[HEAD, s]
    if f < 0:
        return
    fr[ATTEMPTS, f] += 1
    begin_tx(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hr, s, f, DATA, t)
    targets = 0
    for link in range(ptr[s], ptr[s + 1]):
        if fr[DST, f] == EVERYONE or fr[DST, f] == lk[LINK_DST, link]:
            if lp[LINK_POWER, link] > 0.0 and lk[COPY, link] == 1:
                targets += 1
            elif lk[FAULT, link] != 0:
                g[ON_AIR_COPIES] += 1
                lost(g, fr, lk, lk[FAULT, link], link, f)
    fr[TARGETS, f] = targets
    g[ON_AIR_COPIES] += targets
    if fr[DST, f] != EVERYONE:
        g[ATTEMPTS_MADE] += 1
        g[MADE_BY - 1 + min(fr[ATTEMPTS, f], ATTEMPT_ROWS)] += 1
    if p[CAPTURE] == 1:
        put(g, out, OUT_START, f, s, t, DATA, fr[ATTEMPTS, f])


@jit
def begin_tx(
    g: Ints,
    p: Ints,
    pf: Reals,
    st: Ints,
    fr: Ints,
    lk: Ints,
    lp: Reals,
    ptr: Ints,
    wv: Reals,
    tb: Reals,
    hr: Ints,
    s: int,
    f: int,
    kind: int,
    t: int,
) -> None:
    """Let a station start to transmit; what it was receiving is lost."""
    if st[LOCK, s] >= 0:
        lk[FATE, st[LOCK, s]] = FATE_HALF_DUPLEX
        st[LOCK, s] = -1
    on_busy(p, st, s, t)
    airtime = fr[AIRTIME, f] if kind == DATA else p[ACK_NS]
    st[TX_KIND, s] = kind
    st[TX_FRAME, s] = f
    st[TX_END, s] = t + airtime
    st[ON_AIR_LIST, g[ON_AIR_N]] = s
    g[ON_AIR_N] += 1
    push(hr, g, HR_N, t + airtime, TX_DONE, s, 0)
    first, last = ptr[s], ptr[s + 1]
    while last > first and lp[LINK_POWER, last - 1] == 0.0:
        last -= 1  # links without power come last and carry nothing
    for link in range(first, last):
        lp[ON_AIR, link] = lp[LINK_POWER, link]
        if p[FADING] != 0:
            lp[ON_AIR, link] *= gain(g, p, pf, wv, tb, s, lk[LINK_DST, link], t)
        lk[SENSED, link] = 1 if lp[ON_AIR, link] >= pf[CARRIER_SENSE_MW] else 0
        lk[COPY, link] = lk[AUDIBLE, link]
        lk[FATE, link] = FATE_OPEN
        lk[LINK_FRAME, link] = f
        lk[LINK_KIND, link] = kind
        lk[UNDERWAY, link] = 1
        lk[BEGINS, link] = t + lk[DELAY, link]
        lk[ENDS, link] = lk[BEGINS, link] + airtime
    if first < last:
        fr[OPEN, f] += last - first
        push(hr, g, HR_N, lk[BEGINS, first], ALL_START, first, last)
        push(hr, g, HR_N, lk[BEGINS, first] + p[DETECT_NS], ALL_DETECT, first, last)
        push(hr, g, HR_N, lk[ENDS, first], ALL_END, first, last)


@jit
def leave_air(g: Ints, st: Ints, s: int, t: int) -> None:
    """Take a station off the list of those that transmit."""
    last = g[ON_AIR_N] - 1
    g[ON_AIR_N] = last
    g[LAST_END] = t + g[REACH_NS]
    for i in range(last):
        if st[ON_AIR_LIST, i] == s:
            st[ON_AIR_LIST, i] = st[ON_AIR_LIST, last]
            return


@jit
def tx_done(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints, out: Ints, s: int, t: int) -> None:
    """The last bit of a frame has left the antenna of its transmitter."""
    kind, f = st[TX_KIND, s], st[TX_FRAME, s]
    st[TX_KIND, s] = NOTHING
    leave_air(g, st, s, t)
    if kind == DATA:
        if fr[DST, f] == EVERYONE:
            take_head(st, fr, s)
            draw(st, s)
            done(g, fr, out, f, DONE_SENT, t)
        else:
            st[WAITING, s] = f
            push(hs, g, HS_N, t + p[ACK_TIMEOUT_NS], ACK_TIMEOUT, s, f)
    if st[CS, s] == 0:
        on_idle(g, p, st, hs, s, t)


@jit
def acknowledged(g: Ints, p: Ints, st: Ints, fr: Ints, out: Ints, s: int, t: int) -> None:
    """End the frame of a station that has received the ACK for it."""
    f = st[WAITING, s]
    st[WAITING, s] = -1
    reset_window(p, st, s)
    take_head(st, fr, s)
    draw(st, s)
    done(g, fr, out, f, DONE_ACKED, t)


@jit
def ack_timeout(g: Ints, p: Ints, st: Ints, fr: Ints, lk: Ints, hs: Ints, out: Ints, s: int, f: int, t: int) -> None:
    """No ACK: try again with a doubled window, or give up (802.11-2020, 10.3.4.4). If some header has been received by
    now, that frame may be the ACK: its end decides (10.3.2.11).
    """
    if st[WAITING, s] != f:
        return
    link = st[LOCK, s]
    if link >= 0 and st[LOCK_HEADER_END, s] <= t:
        push(hs, g, HS_N, lk[ENDS, link] + 1, ACK_TIMEOUT, s, f)
        return
    st[WAITING, s] = -1
    st[RESUME_FROM, s] = t
    g[ATTEMPTS_FAILED] += 1
    g[FAILED_BY - 1 + min(fr[ATTEMPTS, f], ATTEMPT_ROWS)] += 1
    widen_window(p, st, s)
    if fr[ATTEMPTS, f] >= p[MAX_ATTEMPTS]:
        if p[KEEPS_WINDOW] == 0:
            reset_window(p, st, s)
        take_head(st, fr, s)
        done(g, fr, out, f, DONE_RETRY, t)
    draw(st, s)
    arm(g, p, st, hs, s)


@jit
def send_ack(
    g: Ints,
    p: Ints,
    pf: Reals,
    st: Ints,
    fr: Ints,
    lk: Ints,
    lp: Reals,
    ptr: Ints,
    wv: Reals,
    tb: Reals,
    hs: Ints,
    hr: Ints,
    out: Ints,
    s: int,
    f: int,
    t: int,
) -> None:
    """Send an ACK, SIFS after the end of a unicast frame, whether or not the medium is busy."""
    st[ACK_TO, s] = -1
    if st[TX_KIND, s] == NOTHING:
        if p[CAPTURE] == 1:
            put(g, out, OUT_START, f, s, t, ACK, 0)
        begin_tx(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hr, s, f, ACK, t)
        release(g, fr, out, f, t)
        return
    release(g, fr, out, f, t)
    if st[CS, s] == 0:
        arm(g, p, st, hs, s)

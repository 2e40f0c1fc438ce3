"""The event loop of the emulated air: two heaps merged in (t, seq) order until an instant. Sans-IO, integer ns.

One call of `advance` processes any number of events. It returns early only when its output rows or a heap run out of
room; the caller takes the rows, makes room and calls again.
"""

from emulator.kernel import state as k
from emulator.kernel.channel_access import slots_left
from emulator.kernel.frame_exchange import access, ack_timeout, arrive, send_ack, tx_done
from emulator.kernel.heap import pop, push
from emulator.kernel.jit import jit
from emulator.kernel.phy import rx_detect, rx_end, rx_start
from emulator.kernel.state import Ints, Reals

MARGIN = 16
"""Rows that one event may need in the heap of starts."""
AT_ONCE = 4
"""Receivers that one event handles; each may plan two starts, for which there must be room."""
_FEW = 128
"""Up to this many planned starts are examined one by one."""


@jit
def take_in(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints, asked: Ints, bound: int) -> int:
    """Plan the frames asked for (there must be room); the smaller of `bound` and the first instant one can end."""
    for i in range(g[k.ASKED_N]):
        f, src, airtime, t = asked[i, 0], asked[i, 1], asked[i, 3], asked[i, 4]
        for row in range(k.FRAME_ROWS):
            fr[row, f] = 0
        fr[k.SRC, f] = src
        fr[k.DST, f] = asked[i, 2]
        fr[k.AIRTIME, f] = airtime
        fr[k.EXPIRES, f] = asked[i, 6]
        fr[k.NEXT, f] = -1
        fr[k.OPEN, f] = 1
        fr[k.WANTS_STATUS, f] = asked[i, 5]
        push(hs, g, k.HS_N, t, k.ARRIVE, f, 0)
        bound = min(bound, t + airtime + first_wait(p, st, src, t) + g[k.REACH_NS])
    g[k.ASKED_N] = 0
    return int(bound)


@jit
def first_wait(p: Ints, st: Ints, s: int, t: int) -> int:
    """The least wait of a frame that is queued at `t`, unless a frame of another station ends first."""
    if p[k.DIFS_FIRST] == 0 or st[k.HEAD, s] >= 0 or st[k.TX_KIND, s] != k.NOTHING:
        return 0
    return int(p[k.DIFS_NS]) if slots_left(p, st, s, t) == 0 else 0


@jit
def purge(g: Ints, st: Ints, hs: Ints) -> None:
    """Remove stale access events from the heap of starts."""
    n = g[k.HS_N]
    g[k.HS_N] = 0
    for i in range(n):
        kind, a = hs[i, 2], hs[i, 3]
        if kind == k.ACCESS and st[k.SCHEDULED, a] != hs[i, 0]:
            continue
        j = g[k.HS_N]  # (t, seq) is kept, because the order among equal instants must not change
        g[k.HS_N] = j + 1
        t, seq, b = hs[i, 0], hs[i, 1], hs[i, 4]
        while j > 0:
            up = (j - 1) >> 1
            if hs[up, 0] < t or (hs[up, 0] == t and hs[up, 1] < seq):
                break
            for column in range(5):
                hs[j, column] = hs[up, column]
            j = up
        hs[j, 0], hs[j, 1], hs[j, 2], hs[j, 3], hs[j, 4] = t, seq, kind, a, b


@jit
def next_output(g: Ints, p: Ints, st: Ints, fr: Ints, hs: Ints) -> int:
    """A lower bound of the next reception or ACK; NEVER when nothing is on the way. Planned starts are examined one by
    one while they are few; of many, the first start plus a bare header's airtime is taken, so that the report of a
    failure may come late by a header.
    """
    bound = k.NEVER
    for i in range(g[k.ON_AIR_N]):
        bound = min(bound, st[k.TX_END, st[k.ON_AIR_LIST, i]] + g[k.REACH_NS])
    if g[k.LAST_END] > g[k.NOW]:
        bound = min(bound, g[k.LAST_END])
    if g[k.HS_N] > _FEW:
        return int(min(bound, hs[0, 0] + p[k.HEADER_NS]))
    latest = i = 0
    while i < g[k.HS_N] and (i - 1) >> 1 <= latest:
        if hs[i, 0] < bound:
            bound = min(bound, earliest_end(g, p, st, fr, hs[i, 0], hs[i, 2], hs[i, 3], hs[i, 4]))
            latest = i
        i += 1
    return int(bound)


@jit
def earliest_end(g: Ints, p: Ints, st: Ints, fr: Ints, t: int, kind: int, a: int, b: int) -> int:
    """The earliest instant at which the frame that this event may start can have ended at its last receiver."""
    if kind == k.ARRIVE:
        return int(t + fr[k.AIRTIME, a] + first_wait(p, st, fr[k.SRC, a], t) + g[k.REACH_NS])
    if kind == k.SEND_ACK:
        return int(t + p[k.ACK_NS] + g[k.REACH_NS])
    if kind == k.ACK_TIMEOUT:
        return int(t) if st[k.WAITING, a] == b else k.NEVER
    if st[k.SCHEDULED, a] != t or st[k.HEAD, a] < 0:
        return k.NEVER
    f = st[k.HEAD, a]
    return int(t) if t >= fr[k.EXPIRES, f] else int(t + fr[k.AIRTIME, f] + g[k.REACH_NS])


@jit
def advance(  # noqa: C901  (one dispatch; splitting it would only move the branches)
    g: Ints, p: Ints, pf: Reals, st: Ints, sf: Reals, fr: Ints, lk: Ints, lp: Reals, ptr: Ints, wv: Reals,
    tb: Reals, hs: Ints, hr: Ints, asked: Ints, out: Ints, err: Reals, until: int,
) -> int:  # fmt: skip
    """Process all events up to `until`, and fill `out` from its beginning; returns `next_output`, or -1 when room ran
    out: take what is in `out`, make room, call again.
    """
    g[k.OUT_N] = 0
    if g[k.HS_N] + g[k.ASKED_N] + MARGIN > hs.shape[0]:
        return -1
    take_in(g, p, st, fr, hs, asked, k.NEVER)
    room = out.shape[0] - 2 * p[k.QUEUE_LIMIT] - 8  # a single event may let a whole queue expire
    while True:
        if g[k.OUT_N] >= room:
            return -1
        if g[k.HS_N] + MARGIN > hs.shape[0]:
            purge(g, st, hs)
            if g[k.HS_N] + MARGIN > hs.shape[0]:
                return -1
        starts = hs[0, 0] if g[k.HS_N] > 0 else k.NEVER
        ends = hr[0, 0] if g[k.HR_N] > 0 else k.NEVER
        if starts > until and ends > until:
            g[k.NOW] = until
            return next_output(g, p, st, fr, hs)
        if starts < ends or (starts == ends and hs[0, 1] < hr[0, 1]):
            kind, a, b = hs[0, 2], hs[0, 3], hs[0, 4]
            pop(hs, g, k.HS_N)
            if kind == k.ACCESS:
                access(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hs, hr, out, a, starts)
            elif kind == k.ARRIVE:
                arrive(g, p, st, fr, hs, out, a, starts)
            elif kind == k.SEND_ACK:
                send_ack(g, p, pf, st, fr, lk, lp, ptr, wv, tb, hs, hr, out, a, b, starts)
            elif kind == k.ACK_TIMEOUT:
                ack_timeout(g, p, st, fr, lk, hs, out, a, b, starts)
        else:
            kind, a, b = hr[0, 2], hr[0, 3], hr[0, 4]
            pop(hr, g, k.HR_N)
            if kind == k.RX_START:
                rx_start(p, pf, st, sf, lk, lp, err, a, ends)
            elif kind == k.RX_DETECT:
                rx_detect(p, pf, st, sf, fr, lk, lp, a, ends)
            elif kind == k.RX_END:
                rx_end(g, p, pf, st, sf, fr, lk, lp, hs, out, err, a, ends)
            elif kind == k.TX_DONE:
                tx_done(g, p, st, fr, hs, out, a, ends)
            else:
                spread(g, p, pf, st, sf, fr, lk, lp, hs, hr, out, err, kind, a, b, ends)


@jit
def spread(
    g: Ints, p: Ints, pf: Reals, st: Ints, sf: Reals, fr: Ints, lk: Ints, lp: Reals, hs: Ints, hr: Ints, out: Ints,
    err: Reals, kind: int, link: int, end: int, t: int,
) -> None:  # fmt: skip
    """Handle one moment of a frame (`kind`) at its receivers on the links `link` to `end` - 1.

    Up to `AT_ONCE` receivers that the moment reaches at `t` are handled now; an event is planned for the next one.
    """
    until = min(end, link + AT_ONCE)
    while link < until and moment(p, lk, kind, link) == t:
        if kind == k.ALL_START:
            rx_start(p, pf, st, sf, lk, lp, err, link, t)
        elif kind == k.ALL_DETECT:
            rx_detect(p, pf, st, sf, fr, lk, lp, link, t)
        else:
            rx_end(g, p, pf, st, sf, fr, lk, lp, hs, out, err, link, t)
        link += 1
    if link < end:
        push(hr, g, k.HR_N, moment(p, lk, kind, link), kind, link, end)


@jit
def moment(p: Ints, lk: Ints, kind: int, link: int) -> int:
    """The instant at which the frame on a link begins, is detected, or ends at its receiver, according to `kind`."""
    if kind == k.ALL_END:
        return int(lk[k.ENDS, link])
    return int(lk[k.BEGINS, link] + (p[k.DETECT_NS] if kind == k.ALL_DETECT else 0))


@jit
def scatter(g: Ints, p: Ints, lk: Ints, hr: Ints) -> None:
    """Replace each event that stands for many links by one event per link, because the links are about to change."""
    i = 0
    while i < g[k.HR_N]:
        kind, first, end = hr[i, 2], hr[i, 3], hr[i, 4]
        if kind < k.ALL_START:
            i += 1
            continue
        single = kind - k.ALL_START + k.RX_START
        hr[i, 2], hr[i, 4] = single, 0
        for link in range(first + 1, end):
            push(hr, g, k.HR_N, moment(p, lk, kind, link), single, link, 0)
        i = 0  # the pushes have moved rows of the heap


@jit
def relink(  # noqa: C901  (one pass over what is under way)
    hr: Ints, g: Ints, lk: Ints, lp: Reals, ptr: Ints, lock: Ints, new_lk: Ints, new_lp: Reals, new_ptr: Ints
) -> int:  # fmt: skip
    """Carry frames on old links over to new ones; returns how many links are in use. `new_lk` has room for every old
    link behind its own: a frame on a link that is gone ends on an orphan. `lock`: the LOCK row of stations.
    """
    used = new_ptr[new_ptr.shape[0] - 1]
    for old in range(lk.shape[1]):
        if lk[k.UNDERWAY, old] == 0:
            continue
        src, dst = lk[0, old], lk[1, old]
        target = -1
        if src >= 0:
            for link in range(new_ptr[src], new_ptr[src + 1]):
                if new_lk[1, link] == dst and new_lk[k.UNDERWAY, link] == 0:
                    target = link
                    break
        if target < 0:
            target = used
            used += 1
            for row in range(k.LINK_ROWS):
                new_lk[row, target] = lk[row, old]
        else:
            for row in range(k.SENSED, k.LINK_ROWS):
                new_lk[row, target] = lk[row, old]
        new_lp[1, target] = lp[1, old]
        new_lp[2, target] = lp[2, old] if target >= new_ptr[new_ptr.shape[0] - 1] else new_lp[2, target]
        for i in range(g[k.HR_N]):
            if hr[i, 2] != k.TX_DONE and hr[i, 3] == old and hr[i, 4] == 0:
                hr[i, 3] = target
                hr[i, 4] = 1  # marks an event that has been moved, so that it is not moved again
        if lock[dst] == old:
            lock[dst] = -2 - target
    for i in range(g[k.HR_N]):
        hr[i, 4] = 0
    for s in range(lock.shape[0]):
        if lock[s] < -1:
            lock[s] = -2 - lock[s]
    return int(used)


__all__ = ["advance", "next_output", "purge", "relink", "scatter", "take_in"]

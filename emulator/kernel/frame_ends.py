"""The ends of frames and copies: each is counted at once, and reported when nothing refers to the frame any more."""

from emulator.kernel import state as k
from emulator.kernel.jit import jit
from emulator.kernel.state import Ints


@jit
def put(g: Ints, out: Ints, kind: int, frame: int, station: int, t: int, value: int, attempts: int) -> None:
    """Append an output row; the kernel's loop keeps room for all rows that one event can make."""
    n = g[k.OUT_N]
    g[k.OUT_N] = n + 1
    out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4], out[n, 5] = kind, frame, station, t, value, attempts


@jit
def release(g: Ints, fr: Ints, out: Ints, f: int, t: int) -> None:
    """Remove one reference to a frame; after the last one its slot is reported free."""
    fr[k.OPEN, f] -= 1
    if fr[k.OPEN, f] == 0:
        put(g, out, k.OUT_FREE, f, fr[k.SRC, f], t, verdict(fr, f), 0)


@jit
def verdict(fr: Ints, f: int) -> int:
    """How a frame has ended for its receivers; of a broadcast heard by none, the most frequent cause of loss."""
    outcome = fr[k.OUTCOME, f]
    most = max(fr[k.LOST_COLLISION, f], fr[k.LOST_HALF_DUPLEX, f], fr[k.LOST_WEAK, f])
    if fr[k.RECEIVED, f] > 0:
        return k.DELIVERED
    if outcome == k.DONE_FULL:
        return k.NO_ROOM
    if outcome == k.DONE_EXPIRED:
        return k.EXPIRED
    faults = max(fr[k.LOST_DEGRADED, f], fr[k.LOST_JAMMED, f], fr[k.LOST_CUT, f])
    if faults > 0 and faults >= most:
        if faults == fr[k.LOST_CUT, f]:
            return k.CUT_OFF
        return k.JAMMED if faults == fr[k.LOST_JAMMED, f] else k.DEGRADED
    if fr[k.TARGETS, f] == 0:
        return k.NO_RECEIVER
    if outcome == k.DONE_RETRY:
        return k.GIVEN_UP
    if most == fr[k.LOST_COLLISION, f]:
        return k.COLLIDED
    return k.DEAF if most == fr[k.LOST_HALF_DUPLEX, f] else k.WEAK


@jit
def done(g: Ints, fr: Ints, out: Ints, f: int, outcome: int, t: int) -> None:
    """Record that the MAC has finished with a frame."""
    fr[k.OUTCOME, f] = outcome
    if fr[k.WANTS_STATUS, f] == 1:
        put(g, out, k.OUT_DONE, f, fr[k.SRC, f], t, outcome, fr[k.ATTEMPTS, f])
    release(g, fr, out, f, t)


@jit
def lost(g: Ints, fr: Ints, lk: Ints, fate: int, link: int, f: int) -> None:
    """Count one lost copy by its fate."""
    g[k.RECEIVED_COPIES + fate] += 1
    fr[k.LOST_COLLISION - 1 + fate, f] += 1
    lk[k.N_RECEIVED + fate, link] += 1

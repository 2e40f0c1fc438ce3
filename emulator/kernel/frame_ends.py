"""The ends of frames and copies: each is counted at once, and reported when nothing refers to the frame any more."""

from emulator.kernel.jit import jit
from emulator.kernel.state import (
    ATTEMPTS,
    COLLIDED,
    CUT_OFF,
    DEAF,
    DEGRADED,
    DELIVERED,
    DONE_EXPIRED,
    DONE_FULL,
    DONE_RETRY,
    EXPIRED,
    GIVEN_UP,
    JAMMED,
    LOST_COLLISION,
    LOST_CUT,
    LOST_DEGRADED,
    LOST_HALF_DUPLEX,
    LOST_JAMMED,
    LOST_WEAK,
    N_RECEIVED,
    NO_RECEIVER,
    NO_ROOM,
    OPEN,
    OUT_DONE,
    OUT_FREE,
    OUT_N,
    OUTCOME,
    RECEIVED,
    RECEIVED_COPIES,
    SRC,
    TARGETS,
    WANTS_STATUS,
    WEAK,
    Ints,
)


@jit
def put(g: Ints, out: Ints, kind: int, frame: int, station: int, t: int, value: int, attempts: int) -> None:
    n = g[OUT_N]
    g[OUT_N] = n + 1
    out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4], out[n, 5] = kind, frame, station, t, value, attempts


@jit
def release(g: Ints, fr: Ints, out: Ints, f: int, t: int) -> None:
    """Remove one reference to a frame; after the last one its slot is reported free."""
    fr[OPEN, f] -= 1
    if fr[OPEN, f] == 0:
        put(g, out, OUT_FREE, f, fr[SRC, f], t, verdict(fr, f), 0)


@jit
def verdict(fr: Ints, f: int) -> int:
    """How a frame has ended for its receivers; of a broadcast heard by none, the most frequent cause of loss."""
    outcome = fr[OUTCOME, f]
    most = max(fr[LOST_COLLISION, f], fr[LOST_HALF_DUPLEX, f], fr[LOST_WEAK, f])
    if fr[RECEIVED, f] > 0:
        return DELIVERED
    if outcome == DONE_FULL:
        return NO_ROOM
    if outcome == DONE_EXPIRED:
        return EXPIRED
    faults = max(fr[LOST_DEGRADED, f], fr[LOST_JAMMED, f], fr[LOST_CUT, f])
    if faults > 0 and faults >= most:
        if faults == fr[LOST_CUT, f]:
            return CUT_OFF
        return JAMMED if faults == fr[LOST_JAMMED, f] else DEGRADED
    if fr[TARGETS, f] == 0:
        return NO_RECEIVER
    if outcome == DONE_RETRY:
        return GIVEN_UP
    if most == fr[LOST_COLLISION, f]:
        return COLLIDED
    return DEAF if most == fr[LOST_HALF_DUPLEX, f] else WEAK


@jit
def done(g: Ints, fr: Ints, out: Ints, f: int, outcome: int, t: int) -> None:
    """Record that the MAC has finished with a frame."""
    fr[OUTCOME, f] = outcome
    if fr[WANTS_STATUS, f] == 1:
        put(g, out, OUT_DONE, f, fr[SRC, f], t, outcome, fr[ATTEMPTS, f])
    release(g, fr, out, f, t)


@jit
def lost(g: Ints, fr: Ints, lk: Ints, fate: int, link: int, f: int) -> None:
    """Count one lost copy by its fate."""
    g[RECEIVED_COPIES + fate] += 1
    fr[LOST_COLLISION - 1 + fate, f] += 1
    lk[N_RECEIVED + fate, link] += 1

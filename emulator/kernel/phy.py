"""A station's receiver under overlapping frames: detection, interference, success; as functions over its state.

    frame begins -> detected after 4 us if it is strong enough -> received, loss by interference -> decoded or lost

A receiver stays with the frame that it detected first, unless TAKE_OVER = 1 and a later frame, whose preamble can be
detected above everything else, is TAKE_OVER_RATIO times as strong. With INTERFERENCE = 0 any overlap destroys a frame;
with 1 the loss in each segment follows from its SINR.
"""

import math

from emulator.kernel.carrier_sense import busier, energy_fell, energy_rose, quieter
from emulator.kernel.frame_ends import lost, put, release
from emulator.kernel.frame_exchange import acknowledged
from emulator.kernel.heap import push
from emulator.kernel.jit import jit
from emulator.kernel.random_numbers import MODULUS, uniform
from emulator.kernel.state import (
    ACK,
    ACK_NS,
    ACK_TO,
    AIRTIME,
    BAD_UNTIL,
    BEFORE_SEEKING,
    BEGINS,
    CHANGED_AT,
    COPY,
    DATA,
    DETECT_NS,
    DETECT_RATIO,
    DST,
    EIFS_EXTRA_NS,
    ENDS,
    EVERYONE,
    EXTENSION_NS,
    FATE,
    FATE_COLLISION,
    FATE_HALF_DUPLEX,
    FATE_OPEN,
    FATE_WEAK,
    FAULT,
    FAULT_RANDOM,
    HANDED,
    HEADER_BITS_PER_NS,
    HEADER_NS,
    HS_N,
    INTERFERENCE,
    LATE_ACKS,
    LINK_DST,
    LINK_FRAME,
    LINK_KIND,
    LINK_SRC,
    LOCK,
    LOCK_DATA_END,
    LOCK_FROM,
    LOCK_HEADER_END,
    LOCK_RATE,
    LOG_OK,
    N_RECEIVED,
    NAV,
    NEVER,
    NOISE,
    NOTHING,
    NSIG,
    ON_AIR,
    OPEN,
    OUT_N,
    OUT_RECEPTION,
    OVERLAPPED,
    OVERLOOKED,
    OVERLOOKS,
    POWER,
    RANDOM,
    RECEIVED,
    RECEIVED_COPIES,
    SEEKING_UNTIL,
    SEND_ACK,
    SENSED,
    SENSITIVITY_MW,
    SHORT_NS,
    SIFS_NS,
    SPARED,
    SRC,
    TAKE_OVER,
    TAKE_OVER_RATIO,
    TX_KIND,
    UNDERWAY,
    WAITING,
    Ints,
    Reals,
)

ERROR_FLOOR_DB = -20.0
ERROR_STEPS_PER_DB = 20.0


@jit
def sinr_step(err: Reals, sinr: float) -> int:
    """The column of the table of error rates for an SINR above 0."""
    at = int((10.0 * math.log10(sinr) - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB)
    return int(max(0, min(err.shape[1] - 1, at)))


@jit
def close_segment(p: Ints, pf: Reals, st: Ints, sf: Reals, lp: Reals, err: Reals, r: int, t: int) -> None:
    """Account for the part of the locked frame that has passed since the interference last changed."""
    begin = st[LOCK_FROM, r]
    st[LOCK_FROM, r] = t
    if p[INTERFERENCE] == 0 or t <= begin:
        return
    wanted = lp[ON_AIR, st[LOCK, r]]
    unwanted = max(0.0, sf[POWER, r] - wanted - sf[OVERLOOKED, r])
    at = sinr_step(err, wanted / (unwanted + sf[NOISE, r]))
    until = min(t, st[LOCK_DATA_END, r])
    header_ns = max(0, min(until, st[LOCK_HEADER_END, r]) - begin)
    sf[LOG_OK, r] += header_ns * pf[HEADER_BITS_PER_NS] * err[0, at]
    rate = st[LOCK_RATE, r]
    sf[LOG_OK, r] += max(0, until - begin - header_ns) * pf[HEADER_BITS_PER_NS + rate] * err[rate, at]


@jit
def rx_start(p: Ints, pf: Reals, st: Ints, sf: Reals, lk: Ints, lp: Reals, err: Reals, link: int, t: int) -> None:
    """The first bit of a frame has reached a station."""
    r = lk[LINK_DST, link]
    if st[LOCK, r] >= 0:
        close_segment(p, pf, st, sf, lp, err, r, t)
        sf[OVERLOOKED, r] = 0.0
        st[OVERLAPPED, r] = 1
    elif p[OVERLOOKS] == 1:
        seek(p, st, sf, r, t)
    st[NSIG, r] += 1
    sf[POWER, r] += lp[ON_AIR, link]
    st[CHANGED_AT, r] = t


@jit
def seek(p: Ints, st: Ints, sf: Reals, r: int, t: int) -> None:
    """Look for a signal's preamble, and note the power before a run of such windows: as in ns-3.44 (InterferenceHelper
    over YansWifiPhy) it is the interference with which the frame that is detected begins.
    """
    if t >= st[SEEKING_UNTIL, r]:
        sf[BEFORE_SEEKING, r] = sf[POWER, r]
    if st[TX_KIND, r] == NOTHING:
        st[SEEKING_UNTIL, r] = t + p[DETECT_NS]


@jit
def rx_detect(p: Ints, pf: Reals, st: Ints, sf: Reals, fr: Ints, lk: Ints, lp: Reals, link: int, t: int) -> None:
    """The preamble of a frame has been present long enough to be detected, and its energy to be sensed."""
    r = lk[LINK_DST, link]
    audible = lk[SENSED, link] == 1
    if audible:
        busier(p, st, r, t)
    energy_rose(p, pf, st, sf, r, t)
    wanted = lp[ON_AIR, link]
    if p[INTERFERENCE] == 0:
        clear, alone = st[NSIG, r] == 1, True
    else:
        clear = wanted >= pf[DETECT_RATIO] * (max(0.0, sf[POWER, r] - wanted) + sf[NOISE, r])
        alone = clear or wanted >= pf[DETECT_RATIO] * sf[NOISE, r]
    if st[TX_KIND, r] != NOTHING:
        lk[FATE, link] = FATE_HALF_DUPLEX
    elif not audible or not alone:
        lk[FATE, link] = FATE_WEAK
    elif not clear or (st[LOCK, r] >= 0 and not captures(p, pf, st, lp, r, wanted)):
        lk[FATE, link] = FATE_COLLISION
    else:
        if st[LOCK, r] >= 0:
            lk[FATE, st[LOCK, r]] = FATE_COLLISION
        st[LOCK, r] = link
        st[LOCK_FROM, r] = t
        st[LOCK_HEADER_END, r] = t - p[DETECT_NS] + p[HEADER_NS]
        st[LOCK_RATE, r] = rate_row(p, fr, lk, link)
        st[LOCK_DATA_END, r] = NEVER
        if p[EXTENSION_NS] > 0:
            st[LOCK_DATA_END, r] = lk[ENDS, link] - p[EXTENSION_NS]
        st[OVERLAPPED, r] = 1 if st[NSIG, r] > 1 else 0
        sf[LOG_OK, r] = 0.0
        sf[OVERLOOKED, r] = 0.0
        if p[OVERLOOKS] == 1 and st[CHANGED_AT, r] == lk[BEGINS, link]:
            sf[OVERLOOKED, r] = sf[POWER, r] - wanted - sf[BEFORE_SEEKING, r]


@jit
def captures(p: Ints, pf: Reals, st: Ints, lp: Reals, r: int, wanted: float) -> bool:
    """True if a later frame takes the receiver over from the frame on which it is locked (message in message)."""
    return bool(p[TAKE_OVER] == 1 and wanted >= pf[TAKE_OVER_RATIO] * lp[ON_AIR, st[LOCK, r]])


@jit
def rate_row(p: Ints, fr: Ints, lk: Ints, link: int) -> int:
    """Which error rates the frame on a link has, as LOCK_RATE says it."""
    if lk[LINK_KIND, link] == ACK:
        return 2
    return 3 if fr[AIRTIME, lk[LINK_FRAME, link]] <= p[SHORT_NS] else 1


@jit
def decoded(p: Ints, pf: Reals, st: Ints, sf: Reals, lp: Reals, err: Reals, r: int, link: int, t: int) -> int:
    """The locked frame's fate: FATE_OPEN if received. One draw with and without interference: what noise spoils is no
    collision.
    """
    if p[INTERFERENCE] == 0:
        return FATE_OPEN if st[OVERLAPPED, r] == 0 else FATE_COLLISION
    if lp[ON_AIR, link] < pf[SENSITIVITY_MW - 1 + st[LOCK_RATE, r]]:
        return FATE_WEAK
    if sf[LOG_OK, r] > -1e-9:
        return FATE_OPEN
    drawn = uniform(st, RANDOM, r) / MODULUS
    if drawn < math.exp(sf[LOG_OK, r]):
        return FATE_OPEN
    if st[OVERLAPPED, r] == 1 and drawn < math.exp(log_ok_alone(p, pf, st, sf, lp, err, r, link, t)):
        return FATE_COLLISION
    return FATE_WEAK


@jit
def log_ok_alone(p: Ints, pf: Reals, st: Ints, sf: Reals, lp: Reals, err: Reals, r: int, link: int, t: int) -> float:
    """What LOG_OK of the frame that ends at `t` would be without interference."""
    at = sinr_step(err, lp[ON_AIR, link] / sf[NOISE, r])
    rate = st[LOCK_RATE, r]
    data_ns = min(t, st[LOCK_DATA_END, r]) - st[LOCK_HEADER_END, r]
    header = (p[HEADER_NS] - p[DETECT_NS]) * pf[HEADER_BITS_PER_NS] * err[0, at]
    return float(header + data_ns * pf[HEADER_BITS_PER_NS + rate] * err[rate, at])


@jit
def spared(st: Ints, lp: Reals, r: int, link: int) -> bool:
    """True if the fault on a link lets a frame pass that would otherwise be received."""
    share = lp[SPARED, link]
    if share >= 1.0 or share <= 0.0:
        return bool(share >= 1.0)
    return bool(uniform(st, FAULT_RANDOM, r) / MODULUS < share)


@jit
def rx_end(
    g: Ints,
    p: Ints,
    pf: Reals,
    st: Ints,
    sf: Reals,
    fr: Ints,
    lk: Ints,
    lp: Reals,
    hs: Ints,
    out: Ints,
    err: Reals,
    link: int,
    t: int,
) -> None:
    """The last bit of a frame has reached a station."""
    r = lk[LINK_DST, link]
    whole = False
    if st[LOCK, r] >= 0:
        close_segment(p, pf, st, sf, lp, err, r, t)
        sf[OVERLOOKED, r] = 0.0
    st[CHANGED_AT, r] = t
    if st[LOCK, r] == link:
        st[LOCK, r] = -1
        fate = decoded(p, pf, st, sf, lp, err, r, link, t)
        whole = fate == FATE_OPEN
        if not whole:
            lk[FATE, link] = fate
        elif lk[FAULT, link] != 0 and not spared(st, lp, r, link):
            whole = False
            lk[FATE, link] = lk[FAULT, link]
        st[BAD_UNTIL, r] = 0 if whole else t + p[EIFS_EXTRA_NS]
    st[NSIG, r] -= 1
    sf[POWER, r] = 0.0 if st[NSIG, r] == 0 else sf[POWER, r] - lp[ON_AIR, link]
    lk[UNDERWAY, link] = 0
    if lk[LINK_KIND, link] == DATA:
        data_end(g, p, st, fr, lk, lp, hs, out, link, whole, t)
    elif whole and st[WAITING, r] == lk[LINK_FRAME, link]:
        acknowledged(g, p, st, fr, out, r, t)
    elif whole and fr[SRC, lk[LINK_FRAME, link]] == r:
        g[LATE_ACKS] += 1
    if lk[SENSED, link] == 1:
        quieter(g, p, st, hs, r, t)
    energy_fell(g, p, pf, st, sf, hs, r, t)
    release(g, fr, out, lk[LINK_FRAME, link], t)


@jit
def repeats(g: Ints, out: Ints, f: int, t: int, millidbm: int) -> int:
    """1 if the previous row says the same about another station, so that one message serves both; 0 otherwise."""
    n = g[OUT_N] - 1
    return int(n >= 0 and out[n, 0] == OUT_RECEPTION and out[n, 1] == f and out[n, 3] == t and out[n, 4] == millidbm)


@jit
def data_end(
    g: Ints, p: Ints, st: Ints, fr: Ints, lk: Ints, lp: Reals, hs: Ints, out: Ints, link: int, whole: bool, t: int
) -> None:
    """End a data frame at a station: hand it up and acknowledge it, or count why it was lost."""
    r, f = lk[LINK_DST, link], lk[LINK_FRAME, link]
    addressed = fr[DST, f] == EVERYONE or fr[DST, f] == r
    if whole and not addressed:
        st[NAV, r] = max(st[NAV, r], t + p[SIFS_NS] + p[ACK_NS])
    if not addressed or lk[COPY, link] == 0:
        return
    if not whole:
        fate = lk[FATE, link]
        if fate in (FATE_WEAK, FATE_OPEN):
            fate = lk[FAULT, link] if lk[FAULT, link] != 0 else FATE_WEAK
        lost(g, fr, lk, fate, link, f)
        return
    millidbm = int(10_000.0 * math.log10(lp[ON_AIR, link]))
    g[RECEIVED_COPIES] += 1
    lk[N_RECEIVED, link] += 1
    if fr[DST, f] == EVERYONE or fr[RECEIVED, f] == 0:
        fr[RECEIVED, f] += 1
        st[HANDED, r] += 1
        put(g, out, OUT_RECEPTION, f, r, t, millidbm, repeats(g, out, f, t, millidbm))
    if fr[DST, f] == r:
        st[ACK_TO, r] = lk[LINK_SRC, link]
        push(hs, g, HS_N, t + p[SIFS_NS], SEND_ACK, r, f)
        fr[OPEN, f] += 1  # the ACK to come refers to the frame

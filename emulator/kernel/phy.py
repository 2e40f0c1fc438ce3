"""A station's receiver under overlapping frames: detection, interference, success; as functions over its state.

    frame begins -> detected after 4 us if it is strong enough -> received, loss by interference -> decoded or lost

A receiver stays with the frame that it detected first, unless TAKE_OVER = 1 and a later frame, whose preamble can be
detected above everything else, is TAKE_OVER_RATIO times as strong. With INTERFERENCE = 0 any overlap destroys a frame;
with 1 the loss in each segment follows from its SINR.
"""

import math

from emulator.kernel import state as k
from emulator.kernel.carrier_sense import busier, energy_fell, energy_rose, quieter
from emulator.kernel.frame_ends import lost, put, release
from emulator.kernel.frame_exchange import acknowledged
from emulator.kernel.heap import push
from emulator.kernel.jit import jit
from emulator.kernel.random_numbers import MODULUS, uniform
from emulator.kernel.state import Ints, Reals

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
    begin = st[k.LOCK_FROM, r]
    st[k.LOCK_FROM, r] = t
    if p[k.INTERFERENCE] == 0 or t <= begin:
        return
    wanted = lp[k.ON_AIR, st[k.LOCK, r]]
    unwanted = max(0.0, sf[k.POWER, r] - wanted - sf[k.OVERLOOKED, r])
    at = sinr_step(err, wanted / (unwanted + sf[k.NOISE, r]))
    until = min(t, st[k.LOCK_DATA_END, r])
    header_ns = max(0, min(until, st[k.LOCK_HEADER_END, r]) - begin)
    sf[k.LOG_OK, r] += header_ns * pf[k.HEADER_BITS_PER_NS] * err[0, at]
    rate = st[k.LOCK_RATE, r]
    sf[k.LOG_OK, r] += max(0, until - begin - header_ns) * pf[k.HEADER_BITS_PER_NS + rate] * err[rate, at]


@jit
def rx_start(p: Ints, pf: Reals, st: Ints, sf: Reals, lk: Ints, lp: Reals, err: Reals, link: int, t: int) -> None:
    """The first bit of a frame has reached a station."""
    r = lk[k.LINK_DST, link]
    if st[k.LOCK, r] >= 0:
        close_segment(p, pf, st, sf, lp, err, r, t)
        sf[k.OVERLOOKED, r] = 0.0
        st[k.OVERLAPPED, r] = 1
    elif p[k.OVERLOOKS] == 1:
        seek(p, st, sf, r, t)
    st[k.NSIG, r] += 1
    sf[k.POWER, r] += lp[k.ON_AIR, link]
    st[k.CHANGED_AT, r] = t


@jit
def seek(p: Ints, st: Ints, sf: Reals, r: int, t: int) -> None:
    """Look for a signal's preamble, and note the power before a run of such windows: as in ns-3.44 (InterferenceHelper
    over YansWifiPhy) it is the interference with which the frame that is detected begins.
    """
    if t >= st[k.SEEKING_UNTIL, r]:
        sf[k.BEFORE_SEEKING, r] = sf[k.POWER, r]
    if st[k.TX_KIND, r] == k.NOTHING:
        st[k.SEEKING_UNTIL, r] = t + p[k.DETECT_NS]


@jit
def rx_detect(p: Ints, pf: Reals, st: Ints, sf: Reals, fr: Ints, lk: Ints, lp: Reals, link: int, t: int) -> None:
    """The preamble of a frame has been present long enough to be detected, and its energy to be sensed."""
    r = lk[k.LINK_DST, link]
    audible = lk[k.SENSED, link] == 1
    if audible:
        busier(p, st, r, t)
    energy_rose(p, pf, st, sf, r, t)
    wanted = lp[k.ON_AIR, link]
    if p[k.INTERFERENCE] == 0:
        clear, alone = st[k.NSIG, r] == 1, True
    else:
        clear = wanted >= pf[k.DETECT_RATIO] * (max(0.0, sf[k.POWER, r] - wanted) + sf[k.NOISE, r])
        alone = clear or wanted >= pf[k.DETECT_RATIO] * sf[k.NOISE, r]
    if st[k.TX_KIND, r] != k.NOTHING:
        lk[k.FATE, link] = k.FATE_HALF_DUPLEX
    elif not audible or not alone:
        lk[k.FATE, link] = k.FATE_WEAK
    elif not clear or (st[k.LOCK, r] >= 0 and not captures(p, pf, st, lp, r, wanted)):
        lk[k.FATE, link] = k.FATE_COLLISION
    else:
        if st[k.LOCK, r] >= 0:
            lk[k.FATE, st[k.LOCK, r]] = k.FATE_COLLISION
        st[k.LOCK, r] = link
        st[k.LOCK_FROM, r] = t
        st[k.LOCK_HEADER_END, r] = t - p[k.DETECT_NS] + p[k.HEADER_NS]
        st[k.LOCK_RATE, r] = rate_row(p, fr, lk, link)
        st[k.LOCK_DATA_END, r] = k.NEVER
        if p[k.EXTENSION_NS] > 0:
            st[k.LOCK_DATA_END, r] = lk[k.ENDS, link] - p[k.EXTENSION_NS]
        st[k.OVERLAPPED, r] = 1 if st[k.NSIG, r] > 1 else 0
        sf[k.LOG_OK, r] = 0.0
        sf[k.OVERLOOKED, r] = 0.0
        if p[k.OVERLOOKS] == 1 and st[k.CHANGED_AT, r] == lk[k.BEGINS, link]:
            sf[k.OVERLOOKED, r] = sf[k.POWER, r] - wanted - sf[k.BEFORE_SEEKING, r]


@jit
def captures(p: Ints, pf: Reals, st: Ints, lp: Reals, r: int, wanted: float) -> bool:
    """True if a later frame takes the receiver over from the frame on which it is locked (message in message)."""
    return bool(p[k.TAKE_OVER] == 1 and wanted >= pf[k.TAKE_OVER_RATIO] * lp[k.ON_AIR, st[k.LOCK, r]])


@jit
def rate_row(p: Ints, fr: Ints, lk: Ints, link: int) -> int:
    """Which error rates the frame on a link has, as LOCK_RATE says it."""
    if lk[k.LINK_KIND, link] == k.ACK:
        return 2
    return 3 if fr[k.AIRTIME, lk[k.LINK_FRAME, link]] <= p[k.SHORT_NS] else 1


@jit
def decoded(p: Ints, pf: Reals, st: Ints, sf: Reals, lp: Reals, err: Reals, r: int, link: int, t: int) -> int:
    """The locked frame's fate: FATE_OPEN if received. One draw with and without interference: noise is no collision."""
    if p[k.INTERFERENCE] == 0:
        return k.FATE_OPEN if st[k.OVERLAPPED, r] == 0 else k.FATE_COLLISION
    if lp[k.ON_AIR, link] < pf[k.SENSITIVITY_MW - 1 + st[k.LOCK_RATE, r]]:
        return k.FATE_WEAK
    if sf[k.LOG_OK, r] > -1e-9:
        return k.FATE_OPEN
    drawn = uniform(st, k.RANDOM, r) / MODULUS
    if drawn < math.exp(sf[k.LOG_OK, r]):
        return k.FATE_OPEN
    if st[k.OVERLAPPED, r] == 1 and drawn < math.exp(log_ok_alone(p, pf, st, sf, lp, err, r, link, t)):
        return k.FATE_COLLISION
    return k.FATE_WEAK


@jit
def log_ok_alone(p: Ints, pf: Reals, st: Ints, sf: Reals, lp: Reals, err: Reals, r: int, link: int, t: int) -> float:
    """What LOG_OK of the frame that ends at `t` would be without interference."""
    at = sinr_step(err, lp[k.ON_AIR, link] / sf[k.NOISE, r])
    rate = st[k.LOCK_RATE, r]
    data_ns = min(t, st[k.LOCK_DATA_END, r]) - st[k.LOCK_HEADER_END, r]
    header = (p[k.HEADER_NS] - p[k.DETECT_NS]) * pf[k.HEADER_BITS_PER_NS] * err[0, at]
    return float(header + data_ns * pf[k.HEADER_BITS_PER_NS + rate] * err[rate, at])


@jit
def spared(st: Ints, lp: Reals, r: int, link: int) -> bool:
    """True if the fault on a link lets a frame pass that would otherwise be received."""
    share = lp[k.SPARED, link]
    if share >= 1.0 or share <= 0.0:
        return bool(share >= 1.0)
    return bool(uniform(st, k.FAULT_RANDOM, r) / MODULUS < share)


@jit
def rx_end(
    g: Ints, p: Ints, pf: Reals, st: Ints, sf: Reals, fr: Ints, lk: Ints, lp: Reals, hs: Ints, out: Ints,
    err: Reals, link: int, t: int,
) -> None:  # fmt: skip
    """The last bit of a frame has reached a station."""
    r = lk[k.LINK_DST, link]
    whole = False
    if st[k.LOCK, r] >= 0:
        close_segment(p, pf, st, sf, lp, err, r, t)
        sf[k.OVERLOOKED, r] = 0.0
    st[k.CHANGED_AT, r] = t
    if st[k.LOCK, r] == link:
        st[k.LOCK, r] = -1
        fate = decoded(p, pf, st, sf, lp, err, r, link, t)
        whole = fate == k.FATE_OPEN
        if not whole:
            lk[k.FATE, link] = fate
        elif lk[k.FAULT, link] != 0 and not spared(st, lp, r, link):
            whole = False
            lk[k.FATE, link] = lk[k.FAULT, link]
        st[k.BAD_UNTIL, r] = 0 if whole else t + p[k.EIFS_EXTRA_NS]
    st[k.NSIG, r] -= 1
    sf[k.POWER, r] = 0.0 if st[k.NSIG, r] == 0 else sf[k.POWER, r] - lp[k.ON_AIR, link]
    lk[k.UNDERWAY, link] = 0
    if lk[k.LINK_KIND, link] == k.DATA:
        data_end(g, p, st, fr, lk, lp, hs, out, link, whole, t)
    elif whole and st[k.WAITING, r] == lk[k.LINK_FRAME, link]:
        acknowledged(g, p, st, fr, out, r, t)
    elif whole and fr[k.SRC, lk[k.LINK_FRAME, link]] == r:
        g[k.LATE_ACKS] += 1
    if lk[k.SENSED, link] == 1:
        quieter(g, p, st, hs, r, t)
    energy_fell(g, p, pf, st, sf, hs, r, t)
    release(g, fr, out, lk[k.LINK_FRAME, link], t)


@jit
def repeats(g: Ints, out: Ints, f: int, t: int, millidbm: int) -> int:
    """1 if the previous row says the same about another station, so that one message serves both; 0 otherwise."""
    n = g[k.OUT_N] - 1
    return int(n >= 0 and out[n, 0] == k.OUT_RECEPTION and out[n, 1] == f and out[n, 3] == t and out[n, 4] == millidbm)


@jit
def data_end(
    g: Ints, p: Ints, st: Ints, fr: Ints, lk: Ints, lp: Reals, hs: Ints, out: Ints, link: int, whole: bool, t: int
) -> None:
    """End a data frame at a station: hand it up and acknowledge it, or count why it was lost."""
    r, f = lk[k.LINK_DST, link], lk[k.LINK_FRAME, link]
    addressed = fr[k.DST, f] == k.EVERYONE or fr[k.DST, f] == r
    if whole and not addressed:
        st[k.NAV, r] = max(st[k.NAV, r], t + p[k.SIFS_NS] + p[k.ACK_NS])
    if not addressed or lk[k.COPY, link] == 0:
        return
    if not whole:
        fate = lk[k.FATE, link]
        if fate in (k.FATE_WEAK, k.FATE_OPEN):
            fate = lk[k.FAULT, link] if lk[k.FAULT, link] != 0 else k.FATE_WEAK
        lost(g, fr, lk, fate, link, f)
        return
    millidbm = int(10_000.0 * math.log10(lp[k.ON_AIR, link]))
    g[k.RECEIVED_COPIES] += 1
    lk[k.N_RECEIVED, link] += 1
    if fr[k.DST, f] == k.EVERYONE or fr[k.RECEIVED, f] == 0:
        fr[k.RECEIVED, f] += 1
        st[k.HANDED, r] += 1
        put(g, out, k.OUT_RECEPTION, f, r, t, millidbm, repeats(g, out, f, t, millidbm))
    if fr[k.DST, f] == r:
        st[k.ACK_TO, r] = lk[k.LINK_SRC, link]
        push(hs, g, k.HS_N, t + p[k.SIFS_NS], k.SEND_ACK, r, f)
        fr[k.OPEN, f] += 1  # the ACK to come refers to the frame

"""The kernel's state: the rows of a few arrays, because a call with few arguments is cheap.

    st  int64   [station rows, stations]      sf  float64 [station rows, stations]
    fr  int64   [frame rows, frame slots]
    lk  int64   [link rows, links]            lp  float64 [link rows, links]      ptr int64 [stations + 1]
    wv  float64 [stations, columns]           tb  float64 [rows, entries]         fading (emulator/channel/fading.py)
    hs, hr int64 [capacity, 5]                heaps of (t_ns, seq, kind, a, b): starts (hs), receptions (hr)
    g   int64   [globals]                     p int64, pf float64: parameters
    asked, out int64 [capacity, 6]            requests handed to the kernel, results handed back; emptied at each call

Instants are swarm ns. A link is one direction of a pair of stations; the links of one transmitter are adjacent
(compressed rows, `ptr`). A station transmits one frame at a time, so a link carries at most one.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Reals = npt.NDArray[np.float64]

# --- stations (st) ------------------------------------------------------------------------------------------------
(
    BO,  # backoff slots left
    BASE,  # instant from which backoff slots count while the medium is idle
    SCHEDULED,  # instant of the pending access, -1 none; an access event of another instant is stale
    CW,  # contention window
    FAILURES,  # failed attempts since the last ACK, or since CW was reset for them (only with KEEPS_WINDOW)
    FRESH,  # 1: the frame waiting for access has drawn no backoff (immediate access)
    TX_FRAME,  # frame slot on the air, -1 none
    TX_KIND,  # NOTHING, DATA, ACK
    TX_END,  # instant at which the frame on the air ends
    CS,  # number of signals sensed, plus one if ENERGY
    ENERGY,  # 1: all energy together is sensed (only with SENSES_SUMS)
    NSIG,  # signals present, sensed or not
    LOCK,  # link being received, -1 none
    LOCK_FROM,  # start of the current interference segment
    LOCK_HEADER_END,  # end of the PLCP preamble and header of the locked frame
    LOCK_DATA_END,  # instant from which only signal extension follows, which carries no bits; NEVER if there is none
    LOCK_RATE,  # 1: the locked frame is data, 2: an ACK, 3: short data; the row of `err`, and an offset into pf
    OVERLAPPED,  # 1: another signal overlapped the locked frame
    SEEKING_UNTIL,  # end of the last detection window that a signal has opened
    CHANGED_AT,  # instant at which the power last changed
    IDLE_FROM,  # instant at which the medium last became idle
    BAD_UNTIL,  # end of the EIFS extension after a failed reception, 0 none; see channel_access.py
    RESUME_FROM,  # end of the last ACK timeout: access counts from there
    NAV,  # network allocation vector: the medium is reserved until this instant
    WAITING,  # frame slot whose ACK is awaited, -1 none
    ACK_TO,  # station to acknowledge, -1 none
    HEAD,  # frame slot at the head of the MAC queue, -1 none
    TAIL,  # frame slot at the end of the MAC queue, -1 none
    QLEN,  # number of frames in the MAC queue
    BUSY_SINCE,  # instant at which the medium turned busy, -1 idle
    BUSY_NS,  # busy time so far
    RANDOM,  # state of the generator for backoff and reception
    FAULT_RANDOM,  # state of the generator that says which frames a fault destroys
    HANDED,  # number of receptions handed to the station
    ON_AIR_LIST,  # not indexed by station: the first ON_AIR_N entries are the stations that transmit
    STATION_ROWS,
) = range(36)
NOTHING: Final = 0
DATA: Final = 1
ACK: Final = 2

# --- stations (sf) ------------------------------------------------------------------------------------------------
POWER, LOG_OK, NOISE, BEFORE_SEEKING, OVERLOOKED, JAMMING, STATION_REALS = range(7)
"""POWER: sum of the signals present [mW]. LOG_OK: log of the probability that the locked frame has no error so far.
NOISE: noise at the receiver [mW]. JAMMING: power of jammers there, as carrier sense meets it [mW]. Only with OVERLOOKS:
BEFORE_SEEKING is POWER before the first signal of a run of detection windows, OVERLOOKED is the part of the
interference that does not count against the locked frame [mW]."""

# --- frames (fr) --------------------------------------------------------------------------------------------------
(
    SRC,
    DST,  # station, or EVERYONE
    AIRTIME,
    EXPIRES,  # instant from which the frame may no longer begin
    NEXT,  # next frame in the queue, -1 none
    ATTEMPTS,  # transmissions so far
    RECEIVED,  # copies received; duplicates of a unicast are not counted
    OPEN,  # references to the frame: receptions not yet ended, the ACK to come, and 1 while the MAC holds it
    OUTCOME,  # DONE_*
    LOST_COLLISION,  # copies lost; the next five rows count the other fates
    LOST_HALF_DUPLEX,
    LOST_WEAK,
    LOST_DEGRADED,
    LOST_JAMMED,
    LOST_CUT,
    TARGETS,  # receivers in range at the last attempt
    WANTS_STATUS,
    FRAME_ROWS,
) = range(18)
EVERYONE: Final = -1

# --- links (lk, lp) -----------------------------------------------------------------------------------------------
(
    LINK_SRC,
    LINK_DST,
    DELAY,  # propagation delay
    AUDIBLE,  # 1: frames on the link count as copies: they can be received, by a fade at least; 0: they only interfere
    FAULT,  # FATE_DEGRADED, FATE_JAMMED or FATE_CUT while a fault lies on a link that is otherwise audible, else 0
    N_RECEIVED,  # copies received since the links were made; the next six rows count copies lost, by fate
    N_COLLISION,
    N_HALF_DUPLEX,
    N_WEAK,
    N_DEGRADED,
    N_JAMMED,
    N_CUT,
    SENSED,  # 1: the frame on the link is sensed; this and later rows are of that frame
    COPY,  # 1: the frame counts as a copy for this receiver
    FATE,
    LINK_FRAME,  # frame slot; for an ACK, of the frame that it acknowledges
    LINK_KIND,
    UNDERWAY,  # 1 until the frame has ended at the receiver
    BEGINS,  # instant of its first bit at the receiver
    ENDS,  # instant of its last bit at the receiver
    LINK_ROWS,
) = range(21)
LINK_POWER, ON_AIR, SPARED, LINK_REALS = range(4)
"""LINK_POWER: received power [mW]; at 0 the link carries nothing, and is sorted behind the others of its transmitter.
ON_AIR: the power of the frame now on the link, as it was at its start. SPARED: the share of frames that the FAULT of
the link lets pass."""

FATE_OPEN, FATE_COLLISION, FATE_HALF_DUPLEX, FATE_WEAK, FATE_DEGRADED, FATE_JAMMED, FATE_CUT = range(7)
"""Counts by fate are adjacent in this order: g from RECEIVED_COPIES, fr from LOST_COLLISION, lk from N_RECEIVED."""

NEVER: Final = 1 << 62
"""Later than any instant."""

# --- events -------------------------------------------------------------------------------------------------------
ARRIVE, ACCESS, SEND_ACK, ACK_TIMEOUT, TX_DONE, RX_START, RX_DETECT, RX_END, ALL_START, ALL_DETECT, ALL_END = range(11)
"""Each ALL_* stands for RX_* on the links a .. b - 1 of one transmitter, handled in order, nearest receiver first."""

# --- requests (asked): frame, source, destination, airtime, start, wants status, expiry -------------------------------
ASKED_COLUMNS: Final = 7

# --- outputs (out): kind, frame, station, t_ns, rssi in 1/1000 dBm, attempts ------------------------------------------
OUT_RECEPTION, OUT_DONE, OUT_FREE, OUT_START, OUT_COLUMNS = 0, 1, 2, 3, 6
"""OUT_RECEPTION: a copy was decoded (attempts: 1 if the previous row differs only in the station). OUT_DONE: the MAC is
done with a frame that wants a status (value: outcome). OUT_FREE: nothing refers to the slot any more (value:
verdict). OUT_START, only with CAPTURE: a station starts to transmit (value: DATA or ACK)."""

DONE_SENT, DONE_ACKED, DONE_RETRY, DONE_FULL, DONE_EXPIRED = range(5)
"""Outcomes of a frame for its transmitter, equal to the values of `messages.TxOutcome`."""

DELIVERED, NO_RECEIVER, COLLIDED, DEAF, WEAK, GIVEN_UP, NO_ROOM, EXPIRED, DEGRADED, JAMMED, CUT_OFF = range(11)
"""Verdicts: how a frame ended for its receivers."""

ATTEMPT_ROWS: Final = 16

# --- globals (g) --------------------------------------------------------------------------------------------------
(
    NOW,
    SEQ,
    HS_N,
    HR_N,
    OUT_N,
    ON_AIR_COPIES,
    RECEIVED_COPIES,
    COLLISION_COPIES,
    HALF_DUPLEX_COPIES,
    WEAK_COPIES,
    DEGRADED_COPIES,
    JAMMED_COPIES,
    CUT_COPIES,
    ATTEMPTS_MADE,
    ATTEMPTS_FAILED,
    ON_AIR_N,  # number of stations that transmit
    LAST_END,  # instant at which the last frame to leave its antenna has ended at its last receiver
    REACH_NS,  # longest delay of a link that is sensed
    ASKED_N,  # rows of `asked` in use
    WAVES_FROM_NS,  # instant of the phases in `wv`
    LATE_ACKS,  # ACKs received after their timeout
    MADE_BY,  # the first of ATTEMPT_ROWS rows: unicasts by attempt, first ones here; the last row also has later ones
    FAILED_BY,  # likewise: those of them without an ACK
    GLOBALS,
) = (*range(22), 21 + ATTEMPT_ROWS, 21 + 2 * ATTEMPT_ROWS)

# --- parameters (p, pf) -------------------------------------------------------------------------------------------
(
    SLOT_NS,
    SIFS_NS,
    DIFS_NS,
    EIFS_EXTRA_NS,  # EIFS - DIFS
    ACK_NS,
    ACK_TIMEOUT_NS,
    HEADER_NS,  # PLCP preamble and header
    DETECT_NS,
    CW_MIN,
    CW_MAX,
    MAX_ATTEMPTS,
    QUEUE_LIMIT,
    DIFS_FIRST,  # 1, as ns-3: a frame waits one DIFS after it is queued, and draws nothing if it is interrupted
    EIFS_FROM_FRAME,  # 1, as ns-3: EIFS begins at the end of a bad frame, not when the medium is idle after it
    SENSES_SUMS,  # 1: energy above ENERGY_MW is sensed, whatever it consists of
    OVERLOOKS,  # 1, as ns-3: interference that begins within a detection window is overlooked
    KEEPS_WINDOW,  # 1, as ns-3: CW is reset at the failure after MAX_ATTEMPTS in a row, not when a frame is given up
    INTERFERENCE,  # 0: any overlap destroys a frame; 1: loss by SINR and error rate
    CAPTURE,  # 1: every start of a transmission is reported
    EXTENSION_NS,  # signal extension at the end of each frame (OFDM at 2.4 GHz)
    TAKE_OVER,  # 1: a later frame that is TAKE_OVER_RATIO times as strong as the locked one takes the receiver
    FADING,  # 0 none, else the number of the law (fading.py)
    SHORT_NS,  # airtime up to which a frame of data has the error rates of short frames
    PARAMETERS,
) = range(24)
(
    DETECT_RATIO,
    HEADER_BITS_PER_NS,
    PAYLOAD_BITS_PER_NS,
    ACK_BITS_PER_NS,
    SHORT_BITS_PER_NS,  # of short data frames, as of others
    SENSITIVITY_MW,  # of data; the next two rows: of ACKs and of short data frames
    ACK_SENSITIVITY_MW,
    SHORT_SENSITIVITY_MW,
    TAKE_OVER_RATIO,
    CARRIER_SENSE_MW,  # the weakest signal that is sensed
    ENERGY_MW,  # the least energy that is sensed (only with SENSES_SUMS)
    FADING_SHAPE,  # m of Nakagami fading, or K of Rician fading as a ratio
    REALS,
) = range(13)

# --- fading ---------------------------------------------------------------------------------------------------------
NONE: Final = 0
NAKAGAMI: Final = 1
RICIAN: Final = 2
WAVES: Final = 32
TABLE: Final = 4096  # a power of two: see `gain`
ROOT = math.sqrt(WAVES)

"""The kernel's state: rows of a few arrays, because a call with few arguments is a cheap call.

    st  int64   [station rows, stations]      sf  float64 [station rows, stations]
    fr  int64   [frame rows, frame slots]
    lk  int64   [link rows, links]            lp  float64 [link rows, links]      ptr int64 [stations + 1]
    hs, hr int64 [capacity, 5]                heaps of (t_ns, seq, kind, a, b): what may start a frame; receptions
    g   int64   [globals]                     p int64, pf float64: parameters
    asked, out int64 [capacity, 6]            what is handed to the kernel and what it hands back, by the next call

Instants are swarm ns. A link is one direction of a pair of stations; the links of one transmitter are adjacent
(compressed rows, `ptr`). A station transmits one frame at a time, so a link carries at most one.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Reals = npt.NDArray[np.float64]

# --- stations (st) ------------------------------------------------------------------------------------------------
(
    BO,  # backoff slots left
    BASE,  # instant from which they count, while the medium is idle
    SCHEDULED,  # instant of the pending access, -1 none; an access event of another instant is stale
    CW,  # contention window
    FRESH,  # 1: the frame waiting for access has drawn no backoff (immediate access)
    TX_FRAME,  # frame slot on the air, -1 none
    TX_KIND,  # NOTHING, DATA, ACK
    TX_END,
    CS,  # signals sensed, and one more if ENERGY
    ENERGY,  # 1: with SENSES_SUMS, all signals together are sensed
    NSIG,  # signals present, sensed or not
    LOCK,  # link being received, -1 none
    LOCK_FROM,  # start of the current interference segment
    LOCK_HEADER_END,  # end of the PLCP preamble and header of the locked frame
    LOCK_DATA_END,  # from then on only signal extension, which carries no bits; NEVER without
    LOCK_RATE,  # 1: the locked frame is data, 2: an ACK; rows of `err`, and offsets into pf
    OVERLAPPED,  # 1: another signal overlapped the locked frame
    SEEKING_UNTIL,  # end of the last detection window that a signal has opened
    CHANGED_AT,  # when the power last changed
    IDLE_FROM,  # when the medium last became idle
    BAD_UNTIL,  # end of the EIFS extension after a failed reception, 0 none; see backoff.py
    RESUME_FROM,  # end of an ACK timeout: access counts from here
    NAV,  # virtual carrier sense: reserved until
    WAITING,  # frame slot whose ACK is awaited, -1 none
    ACK_TO,  # station to acknowledge, -1 none
    HEAD,  # frame slot at the head of the MAC queue, -1 none
    TAIL,
    QLEN,
    BUSY_SINCE,  # -1 idle
    BUSY_NS,  # busy time so far
    RANDOM,  # state of the station's generator
    FAULT_RANDOM,  # of the one that says which frames a fault takes
    HANDED,  # receptions handed to the station
    FADE_A,  # state of the generator for the fading of what the station transmits
    FADE_B,
    ON_AIR_LIST,  # not by station: the first ON_AIR_N entries name the stations that transmit
    STATION_ROWS,
) = range(37)
NOTHING: Final = 0
DATA: Final = 1
ACK: Final = 2

# --- stations (sf) ------------------------------------------------------------------------------------------------
POWER, LOG_OK, NOISE, BEFORE_SEEKING, OVERSEEN, STATION_REALS = range(6)
"""POWER: sum of the signals present [mW]. LOG_OK: log of the probability that the locked frame is still whole. NOISE:
what the receiver hears besides [mW]. With OVERSEES, BEFORE_SEEKING: POWER before the first signal of a run of
detection windows; OVERSEEN: what the locked frame does not notice of the interference [mW]."""

# --- frames (fr) --------------------------------------------------------------------------------------------------
(
    SRC,
    DST,  # station, or EVERYONE
    AIRTIME,
    BORN,  # when it entered (or will enter) the MAC queue
    NEXT,  # next in the queue, -1 none
    ATTEMPTS,
    RECEIVED,  # copies received, duplicates of a unicast not counted
    OPEN,  # receptions still under way, plus 1 while the MAC holds the frame
    OUTCOME,
    LOST_COLLISION,
    LOST_HALF_DUPLEX,
    LOST_WEAK,
    LOST_DEGRADED,
    LOST_JAMMED,
    LOST_CUT,
    TARGETS,  # copies in range at the last attempt
    WANTS_STATUS,
    FRAME_ROWS,
) = range(18)
EVERYONE: Final = -1

# --- links (lk, lp) -----------------------------------------------------------------------------------------------
(
    LINK_SRC,
    LINK_DST,
    DELAY,
    AUDIBLE,  # 1: strong enough to sense and decode; others only interfere
    FAULT,  # FATE_DEGRADED, FATE_JAMMED or FATE_CUT while a fault lies on a link that were audible without it, else 0
    RSSI_SUM,  # of the copies received [1/1000 dBm]; this and the counts are since the links were made
    N_RECEIVED,  # copies received; then, by fate, copies lost
    N_COLLISION,
    N_HALF_DUPLEX,
    N_WEAK,
    N_DEGRADED,
    N_JAMMED,
    N_CUT,
    SENSED,  # AUDIBLE at the start of the frame now on the link, or as fading has it; rows from here on are of it
    COPY,  # 1: the frame counts as a copy for this receiver: audible on average, or lifted by fading
    FATE,
    LINK_FRAME,  # of an ACK: the frame it acknowledges
    LINK_KIND,
    UNDERWAY,  # 1 until its end
    BEGINS,  # its first bit at the receiver
    ENDS,  # its last
    LINK_ROWS,
) = range(22)
LINK_POWER, ON_AIR, SPARED, LINK_REALS = range(4)
"""LINK_POWER: received power [mW], 0: the link carries nothing, and comes last of its transmitter's. ON_AIR: that of
the frame now on the link, as it was at its start. SPARED: the share of frames that the link's FAULT lets through."""

FATE_OPEN, FATE_COLLISION, FATE_HALF_DUPLEX, FATE_WEAK, FATE_DEGRADED, FATE_JAMMED, FATE_CUT = range(7)
"""Counts by fate lie side by side in this order: g from RECEIVED_COPIES, fr from LOST_COLLISION, lk from N_RECEIVED."""

NEVER: Final = 1 << 62
"""Later than any instant."""

# --- events -------------------------------------------------------------------------------------------------------
ARRIVE, ACCESS, SEND_ACK, ACK_TIMEOUT, TX_DONE, RX_START, RX_DETECT, RX_END, ALL_START, ALL_DETECT, ALL_END = range(11)
"""ALL_*: the same on the links a .. b - 1 of one transmitter, nearest receiver first, from link to link."""

# --- requests (asked): frame, source, destination, airtime, start, wants status ---------------------------------------
ASKED_COLUMNS: Final = 6

# --- outputs (out): kind, frame, station, t_ns, rssi in 1/1000 dBm, attempts ------------------------------------------
OUT_RECEPTION, OUT_DONE, OUT_FREE, OUT_START, OUT_COLUMNS = 0, 1, 2, 3, 6
"""A copy was decoded (attempts: 1 if the row before differs only in the station); the MAC is done with a frame that
wants a status (value: outcome); nothing refers to the slot any more (value: verdict); with CAPTURE, a station starts to
transmit (value: DATA or ACK)."""

DONE_SENT, DONE_ACKED, DONE_RETRY, DONE_FULL, DONE_EXPIRED = range(5)
"""Outcomes; the values of `messages.TxOutcome`."""

DELIVERED, NO_RECEIVER, COLLIDED, DEAF, WEAK, GIVEN_UP, NO_ROOM, EXPIRED, DEGRADED, JAMMED, CUT_OFF = range(11)
"""Verdicts: how a frame ended for its receivers."""

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
    UNICASTS_ENDED,
    RETRIES,
    ON_AIR_N,  # stations transmitting
    LAST_END,  # when the last frame to leave its antenna has ended at its last receiver
    REACH_NS,  # longest delay of an audible link
    ASKED_N,
    GLOBALS,
) = range(22)

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
    LIFETIME_NS,
    DIFS_FIRST,  # 1, as ns-3: a frame waits one DIFS after it is queued, and draws nothing if it is interrupted
    EIFS_FROM_FRAME,  # 1, as ns-3: EIFS begins at the end of a bad frame, not when the medium is idle after it
    SENSES_SUMS,  # 1, as ns-3: signals too weak to be sensed are sensed together
    OVERSEES,  # 1, as ns-3: interference within a detection window is overseen
    INTERFERENCE,  # 0: any overlap destroys; 1: SINR and error rate
    CAPTURE,  # 1: report every start of a transmission
    EXTENSION_NS,  # signal extension at the end of each frame (OFDM at 2.4 GHz)
    TAKE_OVER,  # 1: a later frame that is TAKE_OVER_RATIO times as strong as the locked one takes the receiver
    FADING,  # 0 none, else the law: see fading.py
    PARAMETERS,
) = range(23)
(
    DETECT_RATIO,
    HEADER_BITS_PER_NS,
    PAYLOAD_BITS_PER_NS,
    ACK_BITS_PER_NS,
    TAKE_OVER_RATIO,
    SENSITIVITY_MW,
    FADING_SHAPE,  # m, or K as a ratio
    REALS,
) = range(8)

"""The counters of the medium: requests, copies of frames, late requests. Each thing is counted only once, here."""

from collections import Counter
from typing import Any, Final

from emulator.kernel import state as s
from emulator.late_requests import LateRequests
from fanet_mw.errors import DropReason

_REASON_OF: Final = {
    s.NO_RECEIVER: DropReason.NO_RECEIVER,
    s.COLLIDED: DropReason.COLLISION,
    s.DEAF: DropReason.HALF_DUPLEX,
    s.WEAK: DropReason.WEAK_SIGNAL,
    s.GIVEN_UP: DropReason.RETRY_LIMIT,
    s.NO_ROOM: DropReason.MAC_QUEUE_FULL,
    s.EXPIRED: DropReason.MAC_LIFETIME,
    s.DEGRADED: DropReason.DEGRADED,
    s.JAMMED: DropReason.JAMMED,
    s.CUT_OFF: DropReason.STATION_DOWN,
}


class MediumCounters:
    """The counters of requests by the medium, and those of copies by the kernel."""

    def __init__(self, *, time_scale: float) -> None:
        self.delivered = 0
        self.delivered_bytes = 0
        self.dropped: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        """The number of hostile or misdirected inputs, by kind; none of them became a frame."""
        self.poses = 0
        self.controls = 0
        self.late = LateRequests(time_scale=time_scale)

    def drop(self, reason: DropReason) -> None:
        self.dropped[reason] += 1

    def lost(self, verdict: int) -> None:
        """Count a frame that no node has received, when nothing refers to it any more."""
        self.dropped[_REASON_OF[verdict]] += 1

    def copies(self, g: s.Ints, *, in_flight: int) -> dict[str, Any]:
        """The ledger at the receivers: copies transmitted in range, and how each ended but `in_flight` of them."""
        lost = {
            DropReason.COLLISION: int(g[s.COLLISION_COPIES]),
            DropReason.HALF_DUPLEX: int(g[s.HALF_DUPLEX_COPIES]),
            DropReason.WEAK_SIGNAL: int(g[s.WEAK_COPIES]),
            DropReason.DEGRADED: int(g[s.DEGRADED_COPIES]),
            DropReason.JAMMED: int(g[s.JAMMED_COPIES]),
            DropReason.STATION_DOWN: int(g[s.CUT_COPIES]),
        }
        return {
            "on_air": int(g[s.ON_AIR_COPIES]),
            "received": int(g[s.RECEIVED_COPIES]),
            "lost": {reason.value: count for reason, count in lost.items() if count},
            "in_flight": in_flight,
        }

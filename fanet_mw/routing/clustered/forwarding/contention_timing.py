"""When a frame that contends may start: after a random jitter; if turns are in force, only in a contention window.

Floods of membership (joins, schedules) wait for windows only where bounds count on turns. Elsewhere they start at any
time: when a leader is lost, all nodes join anew within seconds, windows have no room for so many, and a node without a
place has no turns.
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.routing.clustered.tdma.turn_timing import Turns

Random = Callable[[], float]
_SHARE: Final = 4
"""The data of one node take this part of a window at most: what is more would be sent beyond it, into turns."""
_WINDOWS: Final = 256


class ContentionTiming:
    """The starts of one node's contending frames."""

    def __init__(self, *, lead_ns: int, jitter: Random, window: Random) -> None:
        """`jitter` and `window`: random streams for the wait before a frame, and for the instant within a window."""
        self._lead_ns = lead_ns
        self._jitter = jitter
        self._window = window
        self.turns_at: Callable[[int], Turns | None] | None = None
        """Gives the superframe in force at an instant, or None: frames start at any time. None without turns."""
        self.most_jitter_ns: int | None = None
        """The longest jitter in a window; None if there is no limit."""
        self.membership_waits = True
        """Whether floods of membership keep to windows, too."""
        self._used_ns: dict[int, int] = {}
        """The airtime of this node's data in windows, by the starts of their superframes."""

    def start_ns(self, *, due_ns: int, now_ns: int, jitter_ns: int = 0, membership: bool = False) -> int:
        """The earliest start of a frame that was to be announced at `due_ns`, with a jitter up to `jitter_ns`. A
        process woken late loses that much of the lead, so that instants drawn apart stay apart.
        """
        waits = self.membership_waits or not membership
        if waits and self.most_jitter_ns is not None and self._turns(due_ns + self._lead_ns) is not None:
            jitter_ns = min(jitter_ns, self.most_jitter_ns)
        start_ns = max(due_ns + self._lead_ns + int(self._jitter() * jitter_ns), now_ns)
        return self.not_before(start_ns) if waits else start_ns

    def not_before(self, start_ns: int) -> int:
        """The earliest start of a frame that is due: at once, or in a window if turns are in force."""
        turns = self._turns(start_ns)
        return start_ns if turns is None else turns.contending_ns(start_ns, self._window)

    def ends_ns(self, start_ns: int, access_ns: int) -> int:
        """When a frame of `access_ns` that may start at `start_ns` can no longer end in its window; 0 if in none."""
        turns = self._turns(start_ns)
        if turns is None:
            return 0
        ends_ns = turns.superframe_start_ns(start_ns) + turns.contention_ns
        return ends_ns - access_ns if start_ns < ends_ns else 0

    def announced_ns(self, from_ns: int) -> int:
        """A random instant from `from_ns` on, at which a frame is to be announced that then contends at once."""
        jitter_ns = 0 if self.most_jitter_ns is None else int(self._jitter() * self.most_jitter_ns)
        return self.not_before(from_ns + jitter_ns + self._lead_ns) - self._lead_ns

    def has_room(self, start_ns: int, airtime_ns: int) -> bool:
        """Count a frame of data to the window in which it starts; False if this node has filled its share of that."""
        turns = self._turns(start_ns)
        if turns is None:
            return True
        window_ns = turns.superframe_start_ns(start_ns)
        used_ns = self._used_ns.get(window_ns, 0)
        if used_ns and used_ns + airtime_ns > turns.contention_ns // _SHARE:
            return False
        self._used_ns[window_ns] = used_ns + airtime_ns
        if len(self._used_ns) > _WINDOWS:
            del self._used_ns[min(self._used_ns)]
        return True

    def with_room(self, start_ns: int, airtime_ns: int) -> int:
        """The earliest start of a frame of data that is due, in the first window in which it has room."""
        start_ns = self.not_before(start_ns)
        while not self.has_room(start_ns, airtime_ns):
            turns = self._turns(start_ns)
            assert turns is not None, "only windows can be full"
            start_ns = turns.contending_ns(turns.superframe_start_ns(start_ns) + turns.contention_ns, self._window)
        return start_ns

    def _turns(self, t_ns: int) -> Turns | None:
        return None if self.turns_at is None else self.turns_at(t_ns)

"""When a frame that contends may start: after a random jitter; if turns are in force, only in a contention window."""

from collections.abc import Callable

from fanet_mw.routing.clustered.tdma.turn_timing import Turns

Random = Callable[[], float]


class ContentionTiming:
    """The starts of one node's contending frames."""

    def __init__(self, *, lead_ns: int, jitter: Random, window: Random) -> None:
        """`jitter` and `window`: random streams for the wait before a frame, and for the instant within a window."""
        self._lead_ns = lead_ns
        self._jitter = jitter
        self._window = window
        self.turns_at: Callable[[int], Turns | None] | None = None
        """Gives the superframe that is in force at an instant, or None if none is: then a frame may start at any time.
        The attribute itself is None in a protocol without turns."""
        self.most_jitter_ns: int | None = None
        """The longest jitter; None if there is no limit."""

    def start_ns(self, *, due_ns: int, now_ns: int, jitter_ns: int = 0) -> int:
        """The earliest start of a frame that was to be announced at `due_ns`, with a jitter of up to `jitter_ns`.

        A process that is woken late loses that much of the lead: the instants that nodes have drawn, so as not to send
        at the same time, stay apart although the hosts of all of them may wake them together.
        """
        if self.most_jitter_ns is not None:
            jitter_ns = min(jitter_ns, self.most_jitter_ns)
        start_ns = max(due_ns + self._lead_ns + int(self._jitter() * jitter_ns), now_ns)
        return start_ns if self.turns_at is None else self.not_before(start_ns)

    def not_before(self, start_ns: int) -> int:
        """The earliest start of a frame that is due: at once, or in a window if turns are in force."""
        turns = None if self.turns_at is None else self.turns_at(start_ns)
        return start_ns if turns is None else turns.contending_ns(start_ns, self._window)

    def announced_ns(self, from_ns: int) -> int:
        """A random instant from `from_ns` on, at which a frame is to be announced that then contends at once."""
        jitter_ns = 0 if self.most_jitter_ns is None else int(self._jitter() * self.most_jitter_ns)
        return self.not_before(from_ns + jitter_ns + self._lead_ns) - self._lead_ns

"""The start of a frame that has no turn: at once after a random jitter, or in the contention window of a superframe."""

from collections.abc import Callable

from fanet_mw.routing.clustered.tdma.turns import Turns

Random = Callable[[], float]


class Contention:
    """The instants of one node's frames that contend."""

    def __init__(self, *, lead_ns: int, jitter: Random, window: Random) -> None:
        """`jitter`, `window`: random numbers for the wait before a frame, and for the instant in a window."""
        self._lead_ns = lead_ns
        self._jitter = jitter
        self._window = window
        self.turns_at: Callable[[int], Turns | None] | None = None
        """The superframe in force at an instant, or None when there is none: then a frame may go at any time. Where
        there never is one, this is None itself."""
        self.most_jitter_ns: int | None = None
        """No jitter is longer; None: any."""

    def start_ns(self, *, now_ns: int, jitter_ns: int = 0) -> int:
        """The instant from which a frame that is ready now may go, with a jitter of up to `jitter_ns`."""
        if self.most_jitter_ns is not None:
            jitter_ns = min(jitter_ns, self.most_jitter_ns)
        start_ns = now_ns + self._lead_ns + int(self._jitter() * jitter_ns)
        return start_ns if self.turns_at is None else self.not_before(start_ns)

    def not_before(self, start_ns: int) -> int:
        """The instant from which a frame that is due may go: at once if there are no turns, else in a window."""
        turns = None if self.turns_at is None else self.turns_at(start_ns)
        return start_ns if turns is None else turns.contending_ns(start_ns, self._window)

    def by_chance(self, share: float) -> bool:
        """True so often, at random."""
        return self._window() < share

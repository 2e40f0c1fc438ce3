"""When and how much bulk one node sends in the windows, so that what contends there ends there and spares the turns.

Each frame starts after a random wait of up to a window, which keeps apart the nodes that heard the same packet. A node
sends at most f frames per window. f grows by 1 / f with each frame that ended within its window, and is halved when one
ended beyond it (additive increase, multiplicative decrease; Chiu and Jain, 1989): so contenders share the window
without knowing each other. A node repeats in proportion to what it sends anew: where repetitions collide they would
otherwise bring more repetitions, and an overload would last.
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.routing.rounds.round_timing import RoundTiming

_AGAIN: Final = 0.75
"""The repetitions that a node may send for each new packet that it sends, and for each window that it uses."""
_MOST_AGAIN: Final = 16.0
_FIRST: Final = 8.0
_LEAST: Final = 1.0
_MOST: Final = 256.0


class BulkPacing:
    """The bulk frames of one node."""

    def __init__(self, timing: RoundTiming, random: Callable[[], float]) -> None:
        self._timing = timing
        self._random = random
        self._frames = _FIRST
        self._used = 0
        self._again = _MOST_AGAIN
        """The repetitions that this node may send now."""
        self._until_ns = 0
        """The end of the window in which frames are counted."""
        self._reduced_ns = 0
        """The end of the window for which the number was halved last."""

    def start_ns(self, from_ns: int, *, windows: float = 1.0) -> int:
        """A random start for a frame within so many windows, at or after an instant."""
        return self._timing.window_start_ns(from_ns, wait_ns=int(self._random() * windows * self._timing.window_ns))

    def take(self, start_ns: int, *, again: bool) -> bool:
        """Use the window at an instant for one frame; False if that would be more than this node may send in it, or if
        it only sends `again` and has done so too often.
        """
        if again and self._again < 1:
            return False
        if start_ns >= self._until_ns:
            self._again = min(_MOST_AGAIN, self._again + _AGAIN)
            self._until_ns, self._used = start_ns + self._timing.period_ns - self._timing.in_window_ns(start_ns), 0
        if self._used + 1 > self._frames:
            return False
        self._used += 1
        self._again = self._again - 1 if again else min(_MOST_AGAIN, self._again + _AGAIN)
        return True

    def ended(self, end_ns: int) -> None:
        """A frame of this node has ended."""
        within_ns = self._timing.in_window_ns(end_ns)
        if within_ns <= self._timing.window_ns:
            self._frames = min(_MOST, self._frames + 1 / self._frames)
        elif end_ns > self._reduced_ns:
            self._frames = max(_LEAST, self._frames / 2)
            self._reduced_ns = end_ns - within_ns + self._timing.period_ns

"""Which confirmed messages may be sent now, so that what is under way never becomes a burst that fills all queues.

    first transmissions    the most urgent first, then the oldest
    repetitions            likewise, but those that were repeated least come before all others of their priority

Either kind may have as many pieces under way as the window says. So a target that is gone, to which a message is
repeated until its lifetime is over, holds up neither messages that were not sent yet nor, for long, other repetitions.
The window is halved when something must be sent again, and grows by one whenever a target has all of a message, as
a congestion window does (RFC 5681).
"""

import heapq
from typing import Final

_MOST: Final = 32
"""The greatest number of pieces under way: ten kilobytes and more, but no burst that fills all queues."""
_LEAST: Final = 2


class SendWindow:
    """The messages of one node that wait to be sent, by number, and the number of pieces that are under way."""

    def __init__(self) -> None:
        self._pieces = _MOST
        self._waiting: tuple[list[tuple[int, int, int]], ...] = ([], [])
        """Heaps of (priority, times sent, number) of the messages that were never sent, and of all others."""
        self._under_way = [0, 0]
        """The number of pieces of first transmissions and of repetitions for which receipts are awaited."""

    def wait(self, number: int, *, priority: int, rounds: int) -> None:
        """A message that was sent `rounds` times waits to be sent."""
        heapq.heappush(self._waiting[rounds > 0], (priority, rounds, number))

    def next(self) -> int | None:
        """Take out the message to send now; None if there is none, or no room."""
        for waiting, under_way in zip(self._waiting, self._under_way, strict=True):
            if waiting and under_way < self._pieces:
                return heapq.heappop(waiting)[2]
        return None

    def sent(self, pieces: int, *, rounds: int) -> None:
        """A message of so many pieces was sent for the `rounds`-th time, and its receipts are awaited."""
        self._under_way[rounds > 1] += pieces

    def over(self, pieces: int, *, rounds: int) -> None:
        """Receipts of what was said by `sent` are awaited no longer."""
        self._under_way[rounds > 1] -= pieces

    def widen(self) -> None:
        """A target has all of a message."""
        self._pieces = min(_MOST, self._pieces + 1)

    def halve(self) -> None:
        """A message must be sent again."""
        self._pieces = max(_LEAST, self._pieces // 2)

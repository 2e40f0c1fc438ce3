"""The delay within which most copies of a packet arrive where links lose frames: the law of delay does not hold there,
but others' packets show how long packets take.

    ratio   the delay of a packet that was received, over the hops to its origin, two added, in rounds
    D       the same hops to the farthest node, in rounds, x the ratio that few packets have exceeded lately

Links are as lossy one way as the other, so packets take as long to the others as from them.
"""

from typing import Final

LIKELY_SHARE: Final = 0.99
_KEPT: Final = 0.997
"""The share of received packets whose ratio is not exceeded; the rest of what may be missing never arrives."""
_FEWEST: Final = 300
"""So many packets are received before a delay is stated."""
_MOST: Final = 800
"""When so many are counted, each counts half from then on."""
_STEPS: Final = 8
"""The steps into which a ratio of 1 is divided."""
_GREATEST: Final = 16
"""Greater ratios count as this one, and no delay is stated by it."""


class LikelyDelay:
    """The ratios that one node has seen."""

    def __init__(self) -> None:
        self._counts = [0.0] * (_STEPS * _GREATEST)

    def hear(self, delay_ns: int, *, way_ns: int) -> None:
        """A packet took so long over a way that takes `way_ns` if nothing is lost and nothing waits."""
        step = max(0, delay_ns) * _STEPS // way_ns
        self._counts[min(step, len(self._counts) - 1)] += 1
        if sum(self._counts) > _MOST:
            self._counts = [count / 2 for count in self._counts]

    def over_ns(self, way_ns: int) -> int | None:
        """The delay that is likely over such a way; None if too little is known."""
        rest = total = sum(self._counts)
        if total < _FEWEST:
            return None
        for step, count in enumerate(self._counts[:-1]):
            rest -= count
            if rest <= (1 - _KEPT) * total:
                return way_ns * (step + 1) // _STEPS
        return None

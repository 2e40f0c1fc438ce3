"""How long each neighbor has sent nothing, and how long it usually does."""

from typing import Final

from fanet_mw.units import NodeId, S

_HALF_NS: Final = 3 * S
"""After so long half of the longest silence is forgotten, however many frames come: after a burst a node says nothing
but hellos again.
"""
_MOST_NS: Final = 4 * S
"""A longer silence counts as this one, and so does the time before the first frame."""
_UNUSUAL: Final = 2.5
"""A silence is unusual if it is this many times as long as the longest one of late."""


class Silences:
    """The frames that one node hears, whatever is in them."""

    def __init__(self, *, count: int) -> None:
        self._heard_ns = [0] * (count + 1)
        """The instant of the last frame of each neighbor; 0: none."""
        self._longest_ns = [0.0] * (count + 1)
        """The longest silence of late between two frames of each neighbor."""

    def on_frame(self, src: int, now_ns: int) -> None:
        heard_ns = self._heard_ns
        if src < len(heard_ns):
            silence_ns = now_ns - heard_ns[src] if heard_ns[src] else _MOST_NS
            if silence_ns > _MOST_NS:
                silence_ns = _MOST_NS
            longest_ns = self._longest_ns[src] * 0.5 ** (silence_ns / _HALF_NS)
            heard_ns[src] = now_ns
            self._longest_ns[src] = silence_ns if silence_ns > longest_ns else longest_ns

    def is_unusual(self, node: NodeId, *, least_ns: int, now_ns: int) -> bool:
        """True if a node that was heard before has been silent for an unusually long time, `least_ns` at least."""
        heard_ns = self._heard_ns[node]
        return heard_ns > 0 and now_ns - heard_ns > max(least_ns, _UNUSUAL * self._longest_ns[node])

"""Admission of own bulk: what the swarm could not deliver in time as it moves now is refused where it is born.

    each second:  most packets took longer than deadline / 2  -> a source gets 4/5 of its share of what arrives
                  most took less than deadline / 4            -> a little more, until nothing is refused any more

What arrives while delays grow is what the air carries, and all nodes hear the same, so all sources slow down alike.
The limit is half the deadline, because delays may double before they are known. Without a deadline nothing is refused.
"""

from collections import deque
from typing import Final

from fanet_mw.units import MS, NodeId, S

_EACH_NS: Final = S
_LATELY_NS: Final = 2 * S
"""Delays are those of packets that arrived in this time."""
_SHARED_NS: Final = 10 * S
"""The sources are those of packets that arrived in this time; nobody asks for them without a deadline."""
_FEWEST: Final = 10
"""Delays are judged by at least so many packets."""
_MOST: Final = 0.9
"""Delays are judged by that which this share of packets does not exceed."""
_LESS: Final = 1.25
"""A source that slows down gets this multiple of the interval of its fair share."""
_MORE: Final = 0.95
"""A source that speeds up gets this multiple of its interval a second before."""
_LEAST_NS: Final = MS
"""A shorter interval refuses nobody."""
_STEADY_JUDGED: Final = 6
_STEADY: Final = 1.25
"""Delays grow if the later half of so many judgements has a mean this many times that of the earlier half."""


class BulkAdmission:
    """Whether one node's own bulk packets are accepted."""

    def __init__(self, deadline_ns: int | None) -> None:
        self._deadline_ns = deadline_ns
        self.interval_ns = 0
        """The least time between accepted packets; 0 while none is refused."""
        self._arrived = deque[tuple[int, NodeId, int]]()
        """The packets that arrived lately: when, whose, and how long they took; 0 for those of this node."""
        self._accepted_ns: int | None = None
        self._judged_ns = 0
        self._lately_ns = deque[int](maxlen=_STEADY_JUDGED)
        """The mean delay of each of the last judgements."""

    def hear(self, origin: NodeId, delay_ns: int, *, now_ns: int) -> None:
        """A packet arrived that took so long; `delay_ns` is 0 for one of this node that was accepted."""
        self._arrived.append((now_ns, origin, delay_ns))
        if now_ns >= self._judged_ns + _EACH_NS:
            self._judged_ns = now_ns
            self._judge(now_ns)

    def admit(self, node: NodeId, *, now_ns: int) -> bool:
        """True if a packet of this node that is born now is accepted."""
        if self._accepted_ns is not None and now_ns < self._accepted_ns + self.interval_ns:
            return False
        self._accepted_ns = now_ns
        self.hear(node, 0, now_ns=now_ns)
        return True

    def _judge(self, now_ns: int) -> None:
        kept_ns = _LATELY_NS if self._deadline_ns is None else _SHARED_NS
        while self._arrived[0][0] < now_ns - kept_ns:
            self._arrived.popleft()
        from_ns = now_ns - _LATELY_NS
        delays_ns = [delay_ns for t_ns, _, delay_ns in self._arrived if delay_ns and t_ns >= from_ns]
        self._lately_ns.append(sum(delays_ns) // max(1, len(delays_ns)))
        if self._deadline_ns is None:
            return
        most_ns = sorted(delays_ns)[int(_MOST * len(delays_ns))] if len(delays_ns) >= _FEWEST else 0
        if most_ns > self._deadline_ns // 2:
            sources = len({origin for _, origin, _ in self._arrived})
            passed_ns = max(now_ns - self._arrived[0][0], _EACH_NS)
            share_ns = round(_LESS * passed_ns * sources / len(self._arrived))
            self.interval_ns = max(self.interval_ns, share_ns)
        elif self.interval_ns and most_ns < self._deadline_ns // 4:
            faster_ns = round(_MORE * self.interval_ns)
            self.interval_ns = faster_ns if faster_ns >= _LEAST_NS else 0

    @property
    def steady(self) -> bool:
        lately_ns, half = list(self._lately_ns), _STEADY_JUDGED // 2
        return len(lately_ns) == _STEADY_JUDGED and sum(lately_ns[half:]) <= _STEADY * sum(lately_ns[:half])

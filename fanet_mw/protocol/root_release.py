"""A root's queue and when it lets packets out: as many as a frame holds in each of its turns, one lead ahead."""

from collections.abc import Sequence

from fanet_mw.protocol.turns import Turns
from fanet_mw.protocol.txqueue import Packet, TxQueue

Following = tuple[int, Turns, tuple[int, ...], int]
"""In force from an instant on: the geometry, which turns are ours, and how many bytes go into one."""


class RootRelease:
    """The plan of one node's own turns."""

    def __init__(self, queue: TxQueue, *, lead_ns: int) -> None:
        self._queue = queue
        self._lead_ns = lead_ns
        self._plans: Sequence[Following] = ()
        self._free_ns = 0
        """Just after the last turn that was used."""
        self._next_ns: int | None = None
        self._next_bytes = 0

    def __len__(self) -> int:
        return len(self._queue)

    def follow(self, plans: Sequence[Following], *, now_ns: int) -> None:
        """New turns; in order of the instants from which they hold."""
        self._plans = plans
        self._arm(now_ns)

    def push(self, packet: Packet, *, now_ns: int) -> Packet | None:
        """Queue a packet; returns the one evicted for it."""
        evicted = self._queue.push(packet)
        if self._next_ns is None:
            self._arm(now_ns)
        return evicted

    def expire(self, *, before_us: int) -> list[Packet]:
        return self._queue.expire(before_us=before_us)

    def drain(self) -> list[Packet]:
        """Give everything up: it goes another way."""
        self._next_ns = None
        return self._queue.drain()

    def next_wake_ns(self) -> int | None:
        return None if self._next_ns is None else self._next_ns - self._lead_ns

    def due(self, *, now_ns: int) -> list[tuple[list[Packet], int]]:
        """Packets to announce now, those of one frame together, with its instant."""
        released = []
        while self._next_ns is not None and self._next_ns - self._lead_ns <= now_ns and len(self._queue):
            first = self._queue.pop()
            rest = self._queue.pop_fitting(self._next_bytes - len(first.frame))
            released.append(([first, *rest], self._next_ns))
            self._free_ns = self._next_ns + 1
            self._arm(now_ns)
        if not len(self._queue):
            self._next_ns = None
        return released

    def _arm(self, now_ns: int) -> None:
        earliest_ns = max(now_ns + self._lead_ns, self._free_ns)
        self._next_ns = self._start(earliest_ns) if len(self._queue) else None

    def _start(self, earliest_ns: int) -> int | None:
        """The first of our turns from an instant on, under whichever plan is in force then."""
        for index, (valid_ns, turns, offsets, size) in enumerate(self._plans):
            if not offsets:
                continue
            start_ns = turns.next_start_ns(offsets, not_before_ns=max(earliest_ns, valid_ns))
            following = self._plans[index + 1][0] if index + 1 < len(self._plans) else None
            if following is None or start_ns < following:
                self._next_bytes = size
                return start_ns
        return None

"""The queue for a node's calls: turns that over lossy links serve hellos, and packets that neighbors have missed.

A call reaches only the node's neighbors; nobody relays it.
"""

from collections.abc import Sequence

from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.root_release import TurnsInForce
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease


class CallRelease(TurnRelease):
    """The queue of packets that neighbors have missed, and the node's next call."""

    _plans: Sequence[TurnsInForce] = ()

    def follow(self, plans: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over the calls of new timetables, in the order in which they come into force."""
        self._plans = plans
        self._arm(now_ns)

    def claim(self, *, not_before_ns: int, now_ns: int) -> int | None:
        """Reserve the next call for a frame that is not queued, such as a hello; None if there is none."""
        turn = self._turn(max(not_before_ns, self._free_ns))
        if turn is None:
            return None
        self._free_ns = turn.start_ns + 1
        self._arm(now_ns)
        return turn.start_ns

    @property
    def pending(self) -> TxQueue:
        """The packets that are cancelled when another node sends a copy."""
        return self._queue

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has sent this packet (`duplicates.key_of`), so it is removed from the queue."""
        self._queue.remove(key)

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        """The first call from an instant on, by the timetable that is in force then."""
        for index, plan in enumerate(self._plans):
            if plan.offsets:
                not_before_ns = max(earliest_ns, plan.valid_ns)
                start_ns = plan.turns.next_start_ns(plan.offsets, not_before_ns=not_before_ns)
                if index + 1 == len(self._plans) or start_ns < self._plans[index + 1].valid_ns:
                    return OwnTurn(start_ns, plan.frame_bytes)
        return None

"""The queue of one node in claimed slots: own packets and relays, most urgent first, in the turns that are its own."""

from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease


class ClaimedRelease(TurnRelease):
    """What waits for the node's turns."""

    def __init__(self, queue: TxQueue, own: OwnTurns, *, lead_ns: int, frame_bytes: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._own = own
        self._frame_bytes = frame_bytes

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        start_ns = self._own.next_start_ns(not_before_ns=earliest_ns)
        return None if start_ns is None else OwnTurn(start_ns, self._frame_bytes)

    def _look_again(self, now_ns: int) -> None:
        """Take the first turn that is the node's own now; a node that is woken late still uses one that is ahead."""
        planned = self._next
        self._arm(now_ns)
        if planned is not None and planned.start_ns >= now_ns:
            later_ns = planned.start_ns if self._next is None else self._next.start_ns
            self._next = self._turn(min(planned.start_ns, later_ns))

    def reserve(self, *, not_before_ns: int) -> int | None:
        """A turn for something that is not queued."""
        return self._own.reserve(not_before_ns=max(not_before_ns, self._free_ns))

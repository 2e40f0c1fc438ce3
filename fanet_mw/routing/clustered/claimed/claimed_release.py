"""The transmit queue of a node with claimed slots: in each of its turns the most urgent packet goes, own or relayed."""

from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease


class ClaimedRelease(TurnRelease):
    """The packets that wait for the node's own turns."""

    def __init__(self, queue: TxQueue, own: OwnTurns, *, lead_ns: int, frame_bytes: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._own = own
        self._frame_bytes = frame_bytes

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        start_ns = self._own.next_start_ns(not_before_ns=earliest_ns)
        return None if start_ns is None else OwnTurn(start_ns, self._frame_bytes)

    def _look_again(self, now_ns: int) -> None:
        """Choose the node's next turn anew; a turn that has begun before the node was woken is not used."""
        planned = self._next
        self._arm(now_ns)
        if planned is not None and planned.start_ns >= now_ns:
            later_ns = planned.start_ns if self._next is None else self._next.start_ns
            self._next = self._turn(min(planned.start_ns, later_ns))

    def reserve(self, *, not_before_ns: int) -> int | None:
        """Take a turn out of the queue's use, for a frame that is not queued, such as a hello."""
        return self._own.reserve(not_before_ns=max(not_before_ns, self._free_ns))

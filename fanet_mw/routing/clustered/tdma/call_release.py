"""A node's calls, its turns for neighbors alone over lossy links: for hellos, and for packets that neighbors lack."""

from collections.abc import Sequence

from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.root_release import TurnsInForce
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease


class CallRelease(TurnRelease):
    """The queue of answers, and the plan of one node's calls."""

    _plans: Sequence[TurnsInForce] = ()

    def follow(self, plans: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over new calls, given in the order of the instants from which they hold."""
        self._plans = plans
        self._arm(now_ns)

    def claim(self, *, not_before_ns: int, now_ns: int) -> int | None:
        """Take the next call for a frame that is not queued; None: there is none."""
        turn = self._turn(max(not_before_ns, self._free_ns))
        if turn is None:
            return None
        self._free_ns = turn.start_ns + 1
        self._arm(now_ns)
        return turn.start_ns

    @property
    def pending(self) -> TxQueue:
        """The packets whose copies matter here."""
        return self._queue

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Give up a packet (`duplicates.key_of`) that another node has sent."""
        self._queue.remove(key)

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        """The first call from an instant on, under whichever timetable is in force then."""
        for index, plan in enumerate(self._plans):
            if plan.offsets:
                not_before_ns = max(earliest_ns, plan.valid_ns)
                start_ns = plan.turns.next_start_ns(plan.offsets, not_before_ns=not_before_ns)
                if index + 1 == len(self._plans) or start_ns < self._plans[index + 1].valid_ns:
                    return OwnTurn(start_ns, plan.frame_bytes)
        return None

"""Releases in a node's calls or spare turns what only its neighbors need, so no node relays it.

A timetable for lossy links gives each node *calls* (`redundant_scheduling.py`): missed packets wait for one in a queue
of this file, a hello reserves the next one when it is due (`reserve`). Another timetable gives each node *spare
turns*, which the floods of all leave unused (`list_scheduling.py`): packets for one neighbor wait for them in a second
queue.
"""

from collections.abc import Sequence

from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease
from fanet_mw.routing.clustered.timetable.root_release import TurnsInForce


class CallRelease(TurnRelease):
    """One queue of packets for neighbors, and the node's next call or spare turn."""

    _in_force: Sequence[TurnsInForce] = ()
    """The node's calls, or spare turns, by each timetable that is in force or announced."""

    def follow(self, in_force: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over the calls of new timetables, in the order in which they come into force."""
        self._in_force = in_force
        self._arm(now_ns)

    def reserve(self, *, not_before_ns: int, now_ns: int) -> int | None:
        """Reserve the next call for a frame that is not queued, such as a hello; returns its start, None if the node
        has no call.
        """
        turn = self._turn(max(not_before_ns, self._free_ns))
        if turn is None:
            return None
        self._free_ns = turn.start_ns + 1
        self._arm(now_ns)
        return turn.start_ns

    def last_ns(self, *, now_ns: int) -> int | None:
        """The start of the call in which the packet that was queued last goes at the latest; None if it is unknown."""
        earliest_ns, start_ns = max(now_ns + self._lead_ns, self._free_ns), None
        for _ in range(len(self._queue)):
            turn = self._turn(earliest_ns)
            if turn is None:
                return None
            start_ns = turn.start_ns
            earliest_ns = start_ns + 1
        return start_ns

    @property
    def pending(self) -> TxQueue:
        """The queued packets; each is removed when another node sends a copy of it (`on_copy`)."""
        return self._queue

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has sent this packet (`duplicates.key_of`), so it is removed from the queue."""
        self._queue.remove(key)

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        """The first call from an instant on, by the timetable that is in force then."""
        for index, calls in enumerate(self._in_force):
            if calls.offsets:
                not_before_ns = max(earliest_ns, calls.valid_ns)
                start_ns = calls.turns.next_start_ns(calls.offsets, not_before_ns=not_before_ns)
                if index + 1 == len(self._in_force) or start_ns < self._in_force[index + 1].valid_ns:
                    return OwnTurn(start_ns, calls.frame_bytes)
        return None

"""The timetables that a node follows: the one in force, and perhaps others that come into force later."""

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable


class TimetablesInForce:
    """The timetables of one node, in the order in which they come into force."""

    def __init__(self) -> None:
        self.in_order: list[NodeTimetable] = []
        self._left: Turns | None = None
        """The superframe of the timetable that others may keep and this node does not; None if it would know."""

    @property
    def newest(self) -> NodeTimetable | None:
        return self.in_order[-1] if self.in_order else None

    def at(self, t_ns: int) -> NodeTimetable | None:
        for timetable in reversed(self.in_order):
            if timetable.valid_ns <= t_ns:
                return timetable
        return None

    def turns_at(self, t_ns: int) -> Turns | None:
        timetable = self.at(t_ns)
        return self._left if timetable is None else timetable.turns

    def superseded(self, now_ns: int) -> int:
        """The number of timetables, the oldest first, that are no longer in force."""
        return sum(timetable.valid_ns <= now_ns for timetable in self.in_order[1:])

    def follow(self, timetable: NodeTimetable | None, *, now_ns: int) -> None:
        """Follow a newer timetable (None: none), forgetting those no longer in force, and those due after it: they are
        of a leader over which another prevails.
        """
        if timetable is None:
            self.in_order, self._left = [], None
            return
        before = (older for older in self.in_order[self.superseded(now_ns) :] if older.valid_ns < timetable.valid_ns)
        self.in_order = [*before, timetable]

    def give_up(self, turns: Turns) -> None:
        """Forget all timetables, because this node hears nobody keep them: what it sends keeps out of others' turns,
        which are like `turns` if it has never had any.
        """
        newest, self.in_order = self.newest, []
        self._left = (self._left or turns) if newest is None else newest.turns

"""A UAV in virtual time whose program ends at planned instants, and may be started again, as a process may.

Whoever is started again knows nothing. The counters of all its lives are summed up for the ledger.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception


class StoppableUav(Actor):
    """The lives of one UAV's program, one after the other."""

    def __init__(self, make: Callable[[], Actor], stops: Sequence[tuple[int, int | None]]) -> None:
        """`stops`: when the program ends, and when it is started again; None if it is not."""
        self._make = make
        self._uav: Actor | None = make()
        super().__init__(self._uav.name, self._uav.subscriptions)
        self._changes = [
            (at_ns, starts)
            for stop in stops
            for at_ns, starts in zip(stop, (False, True), strict=True)
            if at_ns is not None
        ]
        self._unheard = 0
        """The receptions that came while no program ran."""
        self._earlier: list[Mapping[str, Any]] = []
        """The reports of lives that are over."""

    def end_at(self, at_ns: int) -> None:
        """The program ends at this instant; nudge the UAV if it runs already."""
        self._changes.insert(0, (at_ns, False))

    def start(self, now_ns: int) -> None:
        assert self._uav is not None, "it lives at first"
        self._enter(self._uav)
        self._uav.start(now_ns)

    def _enter(self, uav: Actor) -> None:
        uav.outbox, uav.records = self.outbox, self.records

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        if self._uav is None:
            self._unheard += isinstance(message, Reception)
            return True
        return self._uav.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        while self._changes and self._changes[0][0] <= now_ns:
            _, starts = self._changes.pop(0)
            if not starts and self._uav is not None:
                self._uav.stop(now_ns)
                self._earlier.append(self._uav.report())
                self._uav = None
            elif starts and self._uav is None:
                self._uav = self._make()
                self._enter(self._uav)
                self._uav.start(now_ns)
        if self._uav is not None:
            due_ns = self._uav.next_wake_ns()
            if due_ns is not None and due_ns <= now_ns:
                self._uav.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        own = [self._changes[0][0]] if self._changes else []
        due_ns = None if self._uav is None else self._uav.next_wake_ns()
        return min([*own, *([] if due_ns is None else [due_ns])], default=None)

    def nudge(self, now_ns: int) -> None:
        if self._uav is not None:
            self._uav.nudge(now_ns)

    def stop(self, now_ns: int) -> None:
        if self._uav is not None:
            self._uav.stop(now_ns)

    def report(self) -> Mapping[str, Any]:
        lives = [*self._earlier, *([] if self._uav is None else [self._uav.report()])]
        summed: dict[str, Any] = dict(lives[-1])
        summed["receptions"] = summed.get("receptions", 0) + self._unheard
        for life in lives[:-1]:
            for key in ("frames_sent", "receptions", "generated"):
                summed[key] = summed.get(key, 0) + life.get(key, 0)
            dropped = Counter(summed.get("dropped", {}))
            dropped.update(life.get("dropped", {}))
            summed["dropped"] = dict(dropped)
        return summed

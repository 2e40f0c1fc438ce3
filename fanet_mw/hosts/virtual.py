"""Virtual time: any number of actors on one `(t_ns, seq)` heap, deterministic, as fast as it goes.

A message put at t is received at t, first put first received, before time moves on. Ties between wake-ups go by the
order in which they were asked for. Nothing here depends on a clock, a hash or a set's order.
"""

import heapq
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from fanet_mw.actor import Actor
from fanet_mw.errors import LocalProtocolError
from fanet_mw.messages import Message
from fanet_mw.trace import Record
from fanet_mw.units import S

Listener = Callable[[str, Message], None]
Receive = Callable[[str, Message, int], None]
_STALL_LIMIT: Final = 100_000
"""Wake-ups of one actor at one instant, above which it is taken to be stuck."""


def matches(expression: str, topic: str) -> bool:
    """Whether a key expression (with `*` for one chunk) covers a topic."""
    want, have = expression.split("/"), topic.split("/")
    return len(want) == len(have) and all(w in ("*", h) for w, h in zip(want, have, strict=True))


class VirtualHost:
    """Runs actors in virtual time. `listeners` hear topics without being actors (taps, recorders)."""

    def __init__(
        self,
        actors: Sequence[Actor],
        *,
        on_records: Callable[[list[Record]], None] | None = None,
        listeners: Iterable[tuple[str, Listener]] = (),
    ) -> None:
        self.now_ns = 0
        self._actors = list(actors)
        self._on_records = on_records
        self._listeners = list(listeners)
        self._heap: list[tuple[int, int, int]] = []
        self._seq = 0
        self._armed: list[int | None] = [None] * len(self._actors)
        self._queue: list[tuple[str, Message]] = []
        self._records: list[Record] = []
        for actor in self._actors:  # all append to the same lists, so that nothing needs to be gathered
            actor.outbox, actor.records = self._queue, self._records
        self._routes: dict[str, tuple[list[tuple[int, Receive]], list[Listener]]] = {}
        self._stall = (-1, 0)

    def start(self) -> None:
        """Start every actor, in order, at instant 0."""
        for index, actor in enumerate(self._actors):
            actor.start(self.now_ns)
            self._arm(index)
        self._flush()

    def run(self, until_ns: int) -> None:
        """Run every event up to and including `until_ns`; may be called again with a later instant."""
        heap, armed, actors = self._heap, self._armed, self._actors
        while heap and heap[0][0] <= until_ns:
            t_ns, _, index = heapq.heappop(heap)
            if armed[index] != t_ns:
                continue  # re-armed since
            armed[index] = None
            if t_ns > self.now_ns:
                self.now_ns = t_ns
                self._stall = (index, 0)
            else:
                self._watch(index)
            actors[index].wake(self.now_ns)
            self._arm(index)
            self._flush()
        self.now_ns = max(self.now_ns, until_ns)

    def stop(self) -> None:
        """Stop every actor, in order, and hand over what it still had to say."""
        for actor in self._actors:
            actor.stop(self.now_ns)
        self._flush()

    def _watch(self, index: int) -> None:
        """A wake-up that does not move time is allowed; an endless row of them is a bug of the actor."""
        last, count = self._stall
        self._stall = (index, count + 1 if last == index else 0)
        if self._stall[1] > _STALL_LIMIT:
            raise LocalProtocolError(
                f"{self._actors[index].name} asked to be woken {_STALL_LIMIT} times at {self.now_ns / S} s"
            )

    def _arm(self, index: int) -> None:
        """Plan an actor's next wake-up."""
        wake_ns = self._actors[index].next_wake_ns()
        if wake_ns is not None and wake_ns < self.now_ns:
            wake_ns = self.now_ns
        if wake_ns != self._armed[index]:
            self._armed[index] = wake_ns
            if wake_ns is not None:
                self._seq += 1
                heapq.heappush(self._heap, (wake_ns, self._seq, index))

    def _flush(self) -> None:
        """Deliver all messages of this instant, in order; then plan the wake-ups of whoever heard any."""
        queue, routes, now_ns = self._queue, self._routes, self.now_ns
        heard: dict[int, None] = {}  # in order, each once
        for topic, message in queue:  # it grows meanwhile
            route = routes.get(topic)
            if route is None:
                route = routes[topic] = self._resolve(topic)
            for index, receive in route[0]:
                receive(topic, message, now_ns)
                heard[index] = None
            for listener in route[1]:
                listener(topic, message)
        queue.clear()
        for index in heard:
            self._arm(index)
        if self._records:
            if self._on_records is not None:
                self._on_records(self._records)
            self._records.clear()

    def _resolve(self, topic: str) -> tuple[list[tuple[int, Receive]], list[Listener]]:
        hearing: list[tuple[int, Receive]] = [
            (index, actor.receive)
            for index, actor in enumerate(self._actors)
            if any(matches(expression, topic) for expression in actor.subscriptions)
        ]
        return hearing, [listener for expression, listener in self._listeners if matches(expression, topic)]

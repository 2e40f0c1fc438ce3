"""Virtual time: any number of actors on one `(t_ns, seq)` heap, deterministic, as fast as it goes.

A message put at t is received at t, first put first received, before time moves on. Ties between wake-ups go by the
order in which they were asked for. Nothing here depends on a clock, a hash or a set's order.
"""

import heapq
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message
from fanet_mw.errors import LocalProtocolError
from fanet_mw.trace import Record
from fanet_mw.units import S

Listener = Callable[[str, Message], None]
Receive = Callable[[str, Message, int], bool | None]
Route = tuple[int, Receive, list[tuple[int, Receive]]]
"""Index and `receive` of the first who hears a topic, and of the others: nearly every topic has one hearer."""
_NOBODY: Final = -1
"""In place of the index of an actor: a listener, which has no wake-ups."""
_STALL_LIMIT: Final = 100_000
"""Wake-ups at one instant, of one actor or of several in turn, above which they are taken to be stuck."""

_STALL_SHARE: Final = 1000
"""For each actor of a large swarm: many may have something to do at the same instant."""


def matches(expression: str, topic: str) -> bool:
    """Whether a key expression (with `*` for one chunk) covers a topic."""
    want, have = expression.split("/"), topic.split("/")
    return len(want) == len(have) and all(w in ("*", h) for w, h in zip(want, have, strict=True))


def _deaf_to_time(listener: Listener) -> Receive:
    def hear(topic: str, message: Message, _: int) -> bool:
        listener(topic, message)
        return True

    return hear


def _deaf(_topic: str, _message: Message, _now_ns: int) -> bool:
    return True


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
        self._heap: list[tuple[int, int, int]] = []
        self._seq = 0
        self._asks = [actor.next_wake_ns for actor in self._actors]
        self._armed: list[int | None] = [None] * len(self._actors)
        self._queue: list[tuple[str, Message]] = []
        self._records: list[Record] = []
        for actor in self._actors:  # all append to the same lists, so that nothing needs to be gathered
            actor.outbox, actor.records = self._queue, self._records
        self._hearing: dict[str, list[tuple[int, str, int, Receive]]] = {}
        """(order, key expression, index, receive) by what the expression begins with, up to its first `*`."""
        for index, actor in enumerate(self._actors):
            for expression in actor.subscriptions:
                self._subscribe(expression, index, index, actor.receive)
        for order, (expression, listener) in enumerate(listeners, start=len(self._actors)):
            self._subscribe(expression, order, _NOBODY, _deaf_to_time(listener))
        self._routes: dict[str, Route] = {}
        self._latest: tuple[int, int, int] | None = None
        """The wake-up that was planned last, not in the heap: most often it is the next that comes."""
        self._stalled = 0
        """Wake-ups since time moved."""

    def start(self) -> None:
        """Start every actor, in order, at instant 0."""
        for index, actor in enumerate(self._actors):
            actor.start(self.now_ns)
            self._arm(index, actor.next_wake_ns())
        self._flush({})
        self._hand_over()

    def run(self, until_ns: int) -> None:
        """Run every event up to and including `until_ns`; may be called again with a later instant."""
        heap, armed, wakes, flush = self._heap, self._armed, [actor.wake for actor in self._actors], self._flush
        now_ns = self.now_ns
        while self._latest or heap:
            entry = heapq.heappushpop(heap, self._latest) if self._latest else heapq.heappop(heap)
            self._latest = None
            t_ns, _, index = entry
            if t_ns > until_ns:
                self._latest = entry
                break
            if armed[index] != t_ns:
                continue  # re-armed since
            armed[index] = None
            if t_ns > now_ns:
                self.now_ns = now_ns = t_ns
                self._stalled = 0
            else:
                self._watch(index)
            wakes[index](now_ns)
            flush({index: None})
        self.now_ns = max(self.now_ns, until_ns)
        self._hand_over()

    def stop(self) -> None:
        """Stop every actor, in order, and hand over what it still had to say."""
        for actor in self._actors:
            actor.stop(self.now_ns)
        self._flush({})
        self._hand_over()

    def _watch(self, index: int) -> None:
        """A wake-up that does not move time is allowed; an endless row of them is a bug of the actors."""
        self._stalled += 1
        if self._stalled > max(_STALL_LIMIT, _STALL_SHARE * len(self._actors)):
            raise LocalProtocolError(
                f"actors asked to be woken {self._stalled} times at {self.now_ns / S} s, "
                f"{self._actors[index].name} the last"
            )

    def _flush(self, awake: dict[int, None]) -> None:
        """Deliver all messages of this instant, in order; then plan the wake-ups of `awake` and of who heard any."""
        queue, routes, now_ns = self._queue, self._routes, self.now_ns
        for topic, message in queue:  # it grows meanwhile
            try:
                index, receive, others = routes[topic]
            except KeyError:
                index, receive, others = routes[topic] = self._resolve(topic)
            if not receive(topic, message, now_ns):
                awake[index] = None  # in order, each once
            for index, receive in others:
                if not receive(topic, message, now_ns):
                    awake[index] = None
        queue.clear()
        asks, armed = self._asks, self._armed
        for index in awake:
            wake_ns = asks[index]()
            if wake_ns != armed[index]:
                self._arm(index, wake_ns)

    def _arm(self, index: int, wake_ns: int | None) -> None:
        """Plan an actor's next wake-up."""
        if wake_ns is not None and wake_ns < self.now_ns:
            wake_ns = self.now_ns
        if wake_ns != self._armed[index]:
            self._armed[index] = wake_ns
            if wake_ns is not None:
                self._seq += 1
                if self._latest is not None:
                    heapq.heappush(self._heap, self._latest)
                self._latest = wake_ns, self._seq, index

    def _hand_over(self) -> None:
        """Tell what was recorded; once per call of the host, because a record says itself when it was."""
        if self._on_records is not None:
            self._on_records(self._records)
        self._records.clear()

    def _subscribe(self, expression: str, order: int, index: int, receive: Receive) -> None:
        """Actors hear a topic in their order, then listeners in theirs."""
        beginning, star, _ = expression.partition("*")
        self._hearing.setdefault(beginning if star else expression, []).append((order, expression, index, receive))

    def _resolve(self, topic: str) -> Route:
        """Who hears a topic; the cost does not depend on how many there are who do not."""
        found: dict[int, tuple[int, Receive]] = {}  # each once, whichever of its expressions it is
        chunks = topic.split("/")
        for beginning in (topic, *("/".join(chunks[:n]) + "/" for n in range(1, len(chunks))), ""):
            for order, expression, index, receive in self._hearing.get(beginning, ()):
                if matches(expression, topic):
                    found[order] = index, receive
        hearers = [found[order] for order in sorted(found)] or [(_NOBODY, _deaf)]
        return (*hearers[0], hearers[1:])

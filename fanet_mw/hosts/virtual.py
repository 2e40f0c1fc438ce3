"""The host for virtual time: all actors share one heap of (t_ns, seq), so a run is deterministic.

A message that is put at t is received at t, before time moves on, in the order of the puts. Wake-ups at the same
instant happen in the order in which they were requested. Nothing depends on a clock, on hashes, or on the order of a
set.
"""

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Final

from fanet_mw.actor import Actor, require_instant
from fanet_mw.bus.messages import Message
from fanet_mw.errors import LocalProtocolError
from fanet_mw.trace import Record
from fanet_mw.units import S

Listener = Callable[[str, Message], None]
Receive = Callable[[str, Message, int], bool | None]
Route = tuple[tuple[int, Receive], ...]
"""The index and the `receive` of each receiver of a topic; most topics have only one."""
_NOBODY: Final = -1
"""Takes the place of an actor's index for a receiver that is a listener, and so has no wake-ups."""
_BEFORE_ALL_NS: Final = -1
"""No event is at this instant, or before it."""
_STALL_LIMIT: Final = 100_000
"""Actors count as stuck after this number of wake-ups at one instant, of one actor or of several."""

_STALL_SHARE: Final = 1000
"""In a large swarm the limit is this number for each actor, because many may act at the same instant."""


def matches(expression: str, topic: str) -> bool:
    """True if a key expression (with `*` for one chunk) covers a topic."""
    want, have = expression.split("/"), topic.split("/")
    return len(want) == len(have) and all(w in ("*", h) for w, h in zip(want, have, strict=True))


def _without_time(listener: Listener) -> Receive:
    def hear(topic: str, message: Message, _: int) -> bool:
        listener(topic, message)
        return True

    return hear


class VirtualHost:
    """Runs actors in virtual time. `listeners` receive topics without being actors, for example to record them."""

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
        self._wakes = [actor.wake for actor in self._actors]
        self._armed: list[int | None] = [None] * len(self._actors)
        self._queue: list[tuple[str, Message]] = []
        self._records: list[Record] = []
        for actor in self._actors:  # all of them append to the same lists, so the host need not collect anything
            actor.outbox, actor.records = self._queue, self._records
        self._receivers: dict[str, list[tuple[int, str, int, Receive]]] = {}
        """(order, key expression, index, receive), by the beginning of the key expression up to its first `*`."""
        for index, actor in enumerate(self._actors):
            for expression in actor.subscriptions:
                self._subscribe(expression, index, index, actor.receive)
        for order, (expression, listener) in enumerate(listeners, start=len(self._actors)):
            self._subscribe(expression, order, _NOBODY, _without_time(listener))
        self._routes: dict[str, Route] = {}
        self.failed: list[str] = []
        """The actors that have raised, by name; they are not called again but for their end."""
        self._latest: tuple[int, int, int] | None = None
        """The wake-up that was requested last, outside of the heap, because it is often the next one."""
        self._stalled = 0

    def start(self) -> None:
        for index, actor in enumerate(self._actors):
            actor.start(self.now_ns)
            wake_ns = actor.next_wake_ns()
            if wake_ns is not None:
                require_instant(wake_ns, who=actor.name)
                self._seq += 1
                self._armed[index] = wake_ns = max(wake_ns, self.now_ns)
                heapq.heappush(self._heap, (wake_ns, self._seq, index))
        self._flush({})
        self._hand_over()

    def run(self, until_ns: int) -> None:
        """Process all events up to and including `until_ns`; may be called again with a later instant."""
        self._process(until_ns, None)
        self.now_ns = max(self.now_ns, until_ns)
        self._hand_over()

    def put(self, topic: str, message: Message) -> None:
        """Publish a message from outside, between two calls of `run`."""
        self._queue.append((topic, message))
        self._flush({})

    def nudge(self, actor: Actor) -> None:
        """Let an actor act now on something it was given from outside, between two calls of `run`."""
        actor.nudge(self.now_ns)
        self._flush({self._actors.index(actor): None})

    def stop(self) -> None:
        for actor in self._actors:
            actor.stop(self.now_ns)
        self._flush({})
        self._hand_over()

    def stop_after_failure(self) -> None:
        """`stop`, after an actor has raised: the others get what is on its way to them, and who raises is left out."""
        self._flush_what_can_be()
        for actor in self._actors:
            with suppress(Exception, SystemExit):  # the one that has raised may not be whole
                actor.stop(self.now_ns)
        self._flush_what_can_be()
        self._hand_over()

    def _flush_what_can_be(self) -> None:
        before = -1
        while before < len(self.failed):  # each that raises is one less
            before = len(self.failed)
            with suppress(Exception, SystemExit):
                self._flush({})

    def _leave_out(self, index: int, left: Iterator[tuple[str, Message]]) -> None:
        """An actor has raised: what was not handed over yet stays queued, and nothing of that is for this actor."""
        self._queue[:] = list(left)
        if index == _NOBODY:
            return
        self.failed.append(self._actors[index].name)
        self._armed[index] = None
        self._routes.clear()
        for receivers in self._receivers.values():
            receivers[:] = [one for one in receivers if one[2] != index]

    def _watch(self, index: int) -> None:
        """Count wake-ups that do not advance time: a few are normal, an endless series is a bug in an actor."""
        self._stalled += 1
        if self._stalled > max(_STALL_LIMIT, _STALL_SHARE * len(self._actors)):
            last = self._actors[index]
            raise LocalProtocolError(
                f"actors asked to be woken {self._stalled} times at {self.now_ns / S} s, "
                f"{last.name} the last: {', '.join(last.due(self.now_ns))}".removesuffix(": ")
            )

    def _flush(self, awake: dict[int, None]) -> None:
        """Deliver all messages of this instant, in order; then plan the wake-ups of `awake` and of all receivers."""
        self._process(_BEFORE_ALL_NS, awake)

    def _process(  # noqa: C901  (one loop for each frame; a call for each of its parts takes time)
        self, until_ns: int, awake: dict[int, None] | None
    ) -> None:
        """The loop of the host: deliver all messages of this instant, in order, plan the wake-ups of actor and
        receivers, and go on to the next wake-up up to `until_ns`. `awake`: actors called already; None: begin with a
        wake-up.
        """
        heap, armed, wakes, asks = self._heap, self._armed, self._wakes, self._asks
        queue, routes, now_ns = self._queue, self._routes, self.now_ns
        latest, seq = self._latest, self._seq
        push_and_pop, pop, push = heapq.heappushpop, heapq.heappop, heapq.heappush
        index = _NOBODY
        try:
            while True:
                left = iter(queue)
                if awake is None:
                    if latest is not None:
                        latest = push_and_pop(heap, latest)
                    elif heap:
                        latest = pop(heap)
                    else:
                        return
                    t_ns, _, index = latest
                    if t_ns > until_ns:
                        return
                    latest = None
                    if armed[index] != t_ns:
                        continue  # the actor has requested another wake-up since
                    armed[index] = None
                    if t_ns > now_ns:
                        self.now_ns = now_ns = t_ns
                        self._stalled = 0
                    else:
                        self._watch(index)
                    wakes[index](now_ns)
                    awake = {index: None}
                for topic, message in left:  # deliveries may append further messages to the queue
                    try:
                        route = routes[topic]
                    except KeyError:
                        route = routes[topic] = self._resolve(topic)
                    for index, receive in route:
                        if not receive(topic, message, now_ns):
                            awake[index] = None  # the keys of a dict keep their order, and each occurs once
                queue.clear()
                for index in awake:
                    wake_ns = asks[index]()
                    if wake_ns is not None and wake_ns < now_ns:
                        wake_ns = now_ns  # an instant in the past counts as now
                    if wake_ns != armed[index]:
                        armed[index] = wake_ns
                        if wake_ns is not None:
                            if wake_ns.__class__ is not int:  # NaN would break the order of the heap
                                require_instant(wake_ns, who=self._actors[index].name)
                            seq += 1
                            if latest is not None:
                                push(heap, latest)
                            latest = wake_ns, seq, index
                awake = None
        except BaseException:
            self._leave_out(index, left)
            raise
        finally:
            self._latest, self._seq = latest, seq

    def _hand_over(self) -> None:
        """Pass on the trace records, once per call from outside; each record states its own instant."""
        if self._on_records is not None:
            self._on_records(self._records)
        self._records.clear()

    def _subscribe(self, expression: str, order: int, index: int, receive: Receive) -> None:
        """Register a receiver. A topic is received by actors in their order, then by listeners in theirs."""
        beginning, star, _ = expression.partition("*")
        self._receivers.setdefault(beginning if star else expression, []).append((order, expression, index, receive))

    def _resolve(self, topic: str) -> Route:
        """The receivers of a topic; the cost does not depend on how many actors do not receive it."""
        found: dict[int, tuple[int, Receive]] = {}  # each receiver once, even if several of its key expressions match
        chunks = topic.split("/")
        for beginning in (topic, *("/".join(chunks[:n]) + "/" for n in range(1, len(chunks))), ""):
            for order, expression, index, receive in self._receivers.get(beginning, ()):
                if matches(expression, topic):
                    found[order] = index, receive
        return tuple(found[order] for order in sorted(found))

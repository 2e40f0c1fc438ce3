"""The actor contract: messages and instants go in; messages, trace records and the next wake-up come out.

An actor never sleeps, reads a clock, opens a socket or starts a thread. A host owns time and transport:

    start(now)  once, before anything else
    receive(topic, message, now)  for every message on a subscribed topic
    wake(now)   at or after the instant that `next_wake_ns()` named, whichever host runs it
    stop(now)   once, last; then `report()` says how it went

After every call, or after several at one instant, the host takes all of `outbox` and `records`, and asks
`next_wake_ns()` again, unless `receive` has said that it need not. Instants never decrease. Both lists belong to the
host, which may put its own in place before `start`; the actor only appends, during a call.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from fanet_mw.bus.messages import Message
from fanet_mw.trace import Record


class Actor(ABC):
    """One process' worth of behaviour, with no process in it."""

    name: str
    """Unique in a swarm; what reports, logs and messages to people call it (`agent-7`, `emulator`, `world`)."""
    hears_out = False
    """True for an actor that accounts for what others send: in real time, what was on its way when the time was over
    still reaches it before `stop`."""

    def __init__(self, name: str, subscriptions: tuple[str, ...]) -> None:
        self.name = name
        self.subscriptions = subscriptions
        """Zenoh key expressions; `*` stands for one chunk."""
        self.outbox: list[tuple[str, Message]] = []
        """(topic, message) pairs to publish, in order."""
        self.records: list[Record] = []
        """Trace records, in order."""

    @abstractmethod
    def start(self, now_ns: int) -> None: ...

    @abstractmethod
    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        """True: nothing has become due sooner than `next_wake_ns()` said last, and the host need not ask again."""

    @abstractmethod
    def wake(self, now_ns: int) -> None: ...

    @abstractmethod
    def next_wake_ns(self) -> int | None:
        """The instant of the next wanted `wake`, or None. May lie in the past: then at once."""

    def stop(self, now_ns: int) -> None:  # noqa: B027  (most actors have nothing to settle)
        """The run is over; settle what is in flight into counters."""

    def report(self) -> Mapping[str, Any]:
        """JSON-able counters, cumulative since `start`. May be asked at any time."""
        return {}

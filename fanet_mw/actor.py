"""The actor contract: messages and instants go in; messages, trace records and the next wake-up come out.

An actor never sleeps, reads a clock, opens a socket or starts a thread. A host owns time and transport:

    start(now)  once, before anything else
    receive(topic, message, now)  for every message on a subscribed topic
    wake(now)   at or after the instant that `next_wake_ns()` named, whichever host runs it
    nudge(now)  at any instant, when a program outside has given a part of it something to do
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
    """The behavior of one process, without the process."""

    name: str
    """The actor's name, unique in a swarm, used in reports, logs and messages (`agent-7`, `emulator`, `world`)."""
    slack_ns = 0
    """How much later than `next_wake_ns()` a host may wake the actor, so that several wake-ups become one. A process is
    woken less often; in virtual time, where a wake-up costs nothing, the host does not make use of it."""
    hears_out = False
    """True for an actor that accounts for what others send: in real time it still receives, before `stop`, what was on
    its way at the end."""

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
        """Take in a message. True means that the next wake-up has not moved, so that the host need not ask for it."""

    @abstractmethod
    def wake(self, now_ns: int) -> None: ...

    @abstractmethod
    def next_wake_ns(self) -> int | None:
        """The instant of the next `wake` that is wanted, or None. An instant in the past means at once."""

    def nudge(self, now_ns: int) -> None:  # noqa: B027  (most actors have no part that is used from outside)
        """Code outside of the actor has given one of its parts something to do, and it should look now."""

    def stop(self, now_ns: int) -> None:  # noqa: B027  (most actors have nothing to do here)
        """The run is over: count what is still in flight."""

    def report(self) -> Mapping[str, Any]:
        """Counters as JSON values, cumulative since `start`. May be called at any time."""
        return {}

"""The actor contract: messages and instants go in; messages, trace records and the next wake-up come out.

An actor never sleeps, reads a clock, opens a socket or starts a thread. A host owns time and transport, and calls:

    start(now)  once, before anything else
    receive(topic, message, now)  for every message on a subscribed topic
    wake(now)   at or after the instant that `next_wake_ns()` has returned
    nudge(now)  at any instant, when code outside of the actor has given one of its parts something to do
    stop(now)   once, last; then `report()` gives the counters

After every call, or after several calls at the same instant, the host takes everything out of `outbox` and `records`,
and calls `next_wake_ns()` again unless `receive` has returned True. Instants never decrease. The host may replace both
lists by lists of its own before `start`; the actor only appends to them, and only during a call.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from numbers import Integral
from typing import Any

from fanet_mw.bus.messages import Message
from fanet_mw.errors import LocalProtocolError
from fanet_mw.trace import Record


class Actor(ABC):
    """The behavior of one process, without the process."""

    name: str
    """The actor's name, unique in a swarm, used in reports, logs and messages (`agent-7`, `emulator`, `world`)."""
    slack_ns = 0
    """How much later than `next_wake_ns()` a host may wake the actor, so that several wake-ups become one. A process is
    woken less often; in virtual time, where a wake-up costs nothing, the host does not make use of it."""
    patient: Collection[str] = ()
    """The topics whose messages may wait for a wake-up that is due within the slack."""
    hears_out = False
    """True for an actor that, in real time, still receives before `stop` what was on its way when the run ended."""

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
        """Handle a message. Returns True if the next wake-up has not changed, so that the host need not ask for it."""

    @abstractmethod
    def wake(self, now_ns: int) -> None: ...

    @abstractmethod
    def next_wake_ns(self) -> int | None:
        """The instant of the next `wake`, or None if none is wanted. An instant in the past means at once."""

    def due(self, now_ns: int) -> Sequence[str]:
        """The parts that want to be woken by now, by name: what an error says of an actor that always wants to be."""
        return ()

    def nudge(self, now_ns: int) -> None:  # noqa: B027  (most actors have no part that is used from outside)
        """Code outside of the actor has given one of its parts something to do, which it should do now."""

    def stop(self, now_ns: int) -> None:  # noqa: B027  (most actors have nothing to do here)
        """The run is over: count the frames that are still in flight."""

    def report(self) -> Mapping[str, Any]:
        """Counters as JSON values, cumulative since `start`. May be called at any time."""
        return {}


def is_whole(number: object) -> bool:
    """True for what has the type of a whole number, numpy's among them."""
    return isinstance(number, Integral)


def require_instant(wake_ns: object, *, who: str) -> None:
    """Raise LocalProtocolError for a wake-up at what is no whole number of nanoseconds."""
    if not is_whole(wake_ns):
        raise LocalProtocolError(f"{who}: next_wake_ns() = {wake_ns!r} must be a whole number of ns, or None")

"""The application that connects a node with the user's program that has joined it: a mailbox in each direction.

node.send(...)   ->  to_send  ->  port.send, when the host wakes the UAV  ->  the status, back to the sender
a message        ->  got      ->  node.receive()
"""

import asyncio
from collections import deque
from collections.abc import Callable, Collection
from types import ModuleType
from typing import Any, Final, NamedTuple

from fanet_mw import mavlink
from fanet_mw.application import ANY, Application, Fate, Received, Status
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.units import MS

_MOST_UNREAD: Final = 4096


class Sent(NamedTuple):
    """What became of a message."""

    fate: Fate
    """The last known fate of the message."""
    acknowledged: tuple[int, ...] = ()
    """The nodes at which an application has the message."""
    lacking: tuple[int, ...] = ()
    """The nodes that have not acknowledged it in its lifetime, or have no application that listens."""
    reason: DropReason | None = None
    """Why it was refused or dropped; None: it was not, or the network cannot tell."""
    interval_ms: float | None = None
    """The least interval of such messages, if this one was refused; None: unknown."""

    @property
    def ok(self) -> bool:
        """True when all have acknowledged it, or it was let out and is not to be confirmed."""
        return not self.lacking and self.fate in (Fate.ACKNOWLEDGED, Fate.LET_OUT)


class Message(NamedTuple):
    """A message of another node."""

    origin: int
    """The node whose application has sent it."""
    data: bytes
    """The bytes that were sent to a port, or MAVLink frames."""
    port: int | None
    """The port it was sent to; None: `data` are MAVLink frames."""
    priority: int
    """1: safety, 2: report, 3: bulk."""
    hops: int
    """The number of transmissions that it took to get here."""
    delay_ms: float
    """The time since the other application handed it over, as exact as the clocks of the two nodes agree."""

    def mavlink(self, dialect: ModuleType | None = None) -> list[Any]:
        """The MAVLink messages that it consists of, as objects of pymavlink; none if it was sent to a port.

        `dialect`: a module that pymavlink has generated, for messages of your own. Raises
        MalformedFrameError for frames that make no sense.
        """
        return mavlink.decode(self.data, dialect) if self.port is None else []


class Mailbox(Application):
    """The mailbox between a node and the program that has joined it."""

    name = "joined"
    ports = ANY
    follows = (
        Fate.REFUSED, Fate.LET_OUT, Fate.ACKNOWLEDGED, Fate.UNWANTED, Fate.EXPIRED, Fate.DROPPED,
    )  # fmt: skip

    def __init__(self, messages: Collection[int] = ()) -> None:
        """`messages`: the ids of the MAVLink messages that the program wants, or ANY."""
        self.listens = messages
        self.to_send: deque[tuple[Callable[[], int], asyncio.Future[Sent], bool]] = deque()
        """What waits for the host: what sends the message, the future for its status, and whether it is confirmed."""
        self._open: dict[int, tuple[asyncio.Future[Sent], bool, list[int], list[int]]] = {}
        self.got: deque[Message] = deque(maxlen=_MOST_UNREAD)
        self.news = asyncio.Event()
        self.lost = 0
        """The number of messages that the program did not read in time."""

    def next_wake_ns(self) -> int | None:
        return 0 if self.to_send else None

    def wake(self, now_ns: int) -> None:
        while self.to_send:
            send, future, confirm = self.to_send.popleft()
            if future.cancelled():
                continue
            try:
                self._open[send()] = future, confirm, [], []
            except LocalProtocolError as error:
                future.set_exception(error)

    def on_message(self, message: Received, now_ns: int) -> None:
        self.lost += len(self.got) == _MOST_UNREAD
        port = message.port or None
        delay_ms = max(0.0, (now_ns - message.born_ns) / MS)
        self.got.append(Message(message.origin, message.data, port, message.priority, message.hops, delay_ms))
        self.news.set()

    def on_status(self, status: Status, now_ns: int) -> None:
        found = self._open.get(status.handle)
        if found is None:
            return
        future, confirm, has, lacks = found
        (has if status.fate is Fate.ACKNOWLEDGED else lacks).extend(status.nodes)
        if status.last or (status.fate is Fate.LET_OUT and not confirm):
            del self._open[status.handle]
            if not future.done():
                interval_ms = None if status.interval_ns is None else status.interval_ns / MS
                future.set_result(
                    Sent(status.fate, tuple(sorted(has)), tuple(sorted(lacks)), status.reason, interval_ms)
                )

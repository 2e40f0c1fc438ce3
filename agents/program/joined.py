"""A node of a swarm in a program of one's own: `async with join(scenario, node=3) as node:`.

    join -> the UAV of that id, and a mailbox among its applications -> a host (`attached.py`)
    node.send(...)          mailbox -> port.send; the host is told to look, and what became of it comes back
    async for message       what the mailbox was given

One argument says whether that is over Zenoh, over UDP or in virtual time.
"""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self

import fanet_mw
from agents.program.attached import Attachment, Drive, Emulated, NodeClosedError
from agents.program.mailbox import Mailbox, Message, Sent
from agents.submission import Sending, priority_of
from fanet_mw.application import Application, Data
from fanet_mw.errors import ConfigError, LocalProtocolError
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S, seconds_to_ns

ALL: Final = "all"


class Node:
    """A node that a program has joined."""

    def __init__(self, scenario: Scenario, node: NodeId, drive: Drive, mailbox: Mailbox) -> None:
        self.id = node
        """The id of the node in the swarm."""
        self.scenario = scenario
        """The scenario of the swarm."""
        self._sending = Sending(node, scenario.node_count)
        self._drive = drive
        self._mailbox = mailbox

    async def send(
        self,
        content: object,
        *,
        to: int | Iterable[int] | str = ALL,
        port: int | None = None,
        priority: str = "bulk",
        confirm: bool | None = None,
        lifetime_s: float | None = None,
        deadline_s: float | None = None,
    ) -> Sent:
        """Send bytes to a port, or a MAVLink message (of pymavlink, or as frames), and wait for what becomes of it.

        By default a message to all is let out and no more; any other is confirmed: sent again until all its targets
        have it, or `lifetime_s` is over. Raises ConfigError (a ValueError) for what cannot be sent, NodeClosedError
        when the node's time is over, and BusError when the router is gone.
        """
        body = content if port is None else Data(port, content)  # type: ignore[arg-type]  # it is checked at once
        destination = _destination(to)
        try:  # before any time passes
            self._sending.content(body)
            self._sending.whom(destination)
            rank = priority_of(priority)
        except LocalProtocolError as error:
            raise ConfigError(str(error)) from error
        confirmed = destination != BROADCAST if confirm is None else confirm
        lifetime_ns, deadline_ns = _in_ns("lifetime_s", lifetime_s), _in_ns("deadline_s", deadline_s)
        future: asyncio.Future[Sent] = asyncio.get_running_loop().create_future()

        def send() -> int:
            return self._mailbox.port.send(
                body,
                destination=destination,
                priority=rank,
                confirm=confirmed,
                lifetime_ns=lifetime_ns,
                deadline_ns=deadline_ns,
            )

        self._mailbox.to_send.append((send, future, confirmed))
        self._drive.nudge()
        try:
            return await self._drive.wait(future)
        except LocalProtocolError as error:
            raise ConfigError(str(error)) from error

    async def receive(self) -> Message:
        """The next message; raises NodeClosedError when there will be none, BusError when the router is gone."""
        mailbox = self._mailbox
        while not mailbox.got:
            mailbox.news.clear()
            await self._drive.wait(asyncio.ensure_future(mailbox.news.wait()))
        return mailbox.got.popleft()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Message:
        try:
            return await self.receive()
        except NodeClosedError:
            raise StopAsyncIteration from None

    @property
    def now_s(self) -> float:
        """The swarm time [s]."""
        return self._drive.now_ns() / S

    @property
    def neighbors(self) -> tuple[int, ...]:
        """The nodes whose hellos are heard."""
        return self._drive.state().neighbors

    @property
    def bound_ms(self) -> float | None:
        """The delay within which all nodes have the next bulk packet of this node; None: the network states none."""
        bound_ns = self._drive.state().bound_ns
        return None if bound_ns is None else bound_ns / MS

    @property
    def clusters(self) -> Mapping[int, tuple[int, ...]]:
        """The nodes of each cluster as far as this node knows, by head."""
        return {int(head): tuple(nodes) for head, nodes in self._drive.state().clusters.items()}

    @property
    def position(self) -> Enu:
        """The last position fix."""
        return self._mailbox.port.position

    @property
    def lost(self) -> int:
        """The number of messages that were discarded because the program did not read them."""
        return self._mailbox.lost

    def report(self) -> Mapping[str, Any]:
        """The node's counters, as they are in the results of a run."""
        return self._drive.report()


def _destination(to: int | Iterable[int] | str) -> NodeId | Collection[NodeId]:
    if isinstance(to, int):
        return NodeId(to)
    if to == ALL:
        return BROADCAST
    if isinstance(to, str) or not isinstance(to, Iterable):
        raise ConfigError(f"to = {to!r} must be {ALL!r}, a node id or several")
    return tuple(NodeId(node) for node in to)


def _in_ns(name: str, seconds: float | None) -> int | None:
    """A duration as people write it; raises ConfigError for one that is none."""
    if seconds is None:
        return None
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        raise ConfigError(f"{name} = {seconds!r} must be a number of seconds above 0")
    return max(1, seconds_to_ns(seconds))


@contextlib.asynccontextmanager
async def join(
    scenario: Scenario | str | Path,
    *,
    node: int,
    radio: Attachment | None = None,
    messages: Collection[int] = (),
    applications: Sequence[Application] = (),
) -> AsyncIterator[Node]:
    """Be one node of a swarm. `radio`: `Emulated(...)` (the default), `OnAir(...)`, or a swarm in virtual time.

    The node is given all that is sent to ports, and MAVLink messages whose ids are in `messages` (or ANY). Yields when
    the node takes part. Raises ConfigError for a scenario or an id that is wrong, and BusError when the router cannot
    be had. Leaving the block ends the node once its receipts and packets are on the air, 5 s later at most; being
    cancelled in it ends it at once.
    """
    known = scenario if isinstance(scenario, Scenario) else fanet_mw.load_scenario(scenario)
    if node not in known.node_ids:
        raise ConfigError(f"node = {node}: must be in [1, {known.last_id}]")
    mailbox = Mailbox(messages)
    how = Emulated() if radio is None else radio
    if isinstance(how, type) or not hasattr(how, "attach"):
        raise ConfigError(f"radio = {how!r}: must be Emulated(endpoint), OnAir(...) or a VirtualSwarm")
    async with how.attach(known, NodeId(node), [mailbox, *applications]) as drive:
        yield Node(known, NodeId(node), drive, mailbox)

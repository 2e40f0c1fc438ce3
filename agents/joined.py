"""A node of a swarm in a program of one's own: `async with join(scenario, node=3) as node:`.

    join -> the UAV of that id, and a mailbox among its applications -> a host
    node.send(...)          mailbox -> port.send; the host is told to look, and what became of it comes back
    async for message       what the mailbox was given

Over Zenoh, over UDP or in virtual time: which, is said by one argument. The task that runs the host belongs to the
`async with`: it ends with it, and when the host ends first (the time is over, the router is gone, the UAV raised),
whoever waits for the node is told.
"""

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, Self, TypeVar

from agents.clocked import ClockedUav, make_uav
from agents.uav import NodeState, Uav
from fanet_mw import mavlink
from fanet_mw.application import ANY, Application, Data, Fate, Received, Status
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, ConfigError, DropReason, LocalProtocolError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.hosts.clock import START_PATIENCE_S
from fanet_mw.hosts.realtime import RealtimeHost
from fanet_mw.radios.field_bus import FieldBus, joined
from fanet_mw.radios.udp import PORT, UdpRadio
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire import PRIORITIES

T = TypeVar("T")
ALL: Final = "all"
_MOST_UNREAD: Final = 4096
_POLL_S: Final = 0.01
_PATIENCE_S: Final = 10.0
"""Longer than for a person at a terminal: on a busy machine a handshake may take seconds."""
_ORIGIN: Final = Enu(0.0, 0.0, 0.0)


class NodeClosedError(BusError):
    """The node's time in the swarm is over: nothing is sent or received any more."""


class Sent(NamedTuple):
    """What became of a message."""

    fate: Fate
    """The last that is known of it."""
    acknowledged: tuple[int, ...] = ()
    """Nodes whose application has it."""
    lacking: tuple[int, ...] = ()
    """Nodes that have not acknowledged it in its lifetime, or have nobody who listens."""
    reason: DropReason | None = None
    interval_ms: float | None = None
    """Of a message that was refused: how far apart such messages must be; None: unknown."""

    @property
    def ok(self) -> bool:
        """True when all have acknowledged it; of a message that nobody was to confirm: when it was let out."""
        return not self.lacking and self.fate in (Fate.ACKNOWLEDGED, Fate.LET_OUT)


class Message(NamedTuple):
    """A message of another node."""

    origin: int
    data: bytes
    port: int | None
    """The port it was sent to; None: `data` are MAVLink frames."""
    priority: int
    hops: int
    delay_ms: float
    """From the other application's hand-over; as exact as the clocks of the two agree."""


class Mailbox(Application):
    """The application between a node and the program that has joined it."""

    name = "joined"
    ports = ANY
    follows = (
        Fate.REFUSED, Fate.LET_OUT, Fate.ACKNOWLEDGED, Fate.UNWANTED, Fate.EXPIRED, Fate.DROPPED,
    )  # fmt: skip

    def __init__(self, messages: Collection[int] = ()) -> None:
        """`messages`: ids of the MAVLink messages that the program wants, or ANY."""
        self.listens = messages
        self.to_send: deque[tuple[Callable[[], int], asyncio.Future[Sent], bool]] = deque()
        """Messages that wait for the host: how to send each, who waits for what became of it, and whether it is to be
        confirmed."""
        self._open: dict[int, tuple[asyncio.Future[Sent], bool, list[int], list[int]]] = {}
        self.got: deque[Message] = deque(maxlen=_MOST_UNREAD)
        self.news = asyncio.Event()
        self.lost = 0
        """Messages that nobody read in time."""

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


class Drive(Protocol):
    """What moves the time of a joined node."""

    def nudge(self) -> None:
        """The UAV has something to do."""

    def now_ns(self) -> int: ...

    def state(self) -> NodeState:
        """What the node knows of the network."""

    def report(self) -> Mapping[str, Any]:
        """The counters of the UAV."""

    async def wait(self, future: asyncio.Future[T]) -> T:
        """Wait for something that the host brings about; raises when it cannot come any more."""


class Radio(Protocol):
    """How a node is joined to a swarm."""

    def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> contextlib.AbstractAsyncContextManager[Drive]: ...


class Node:
    """A node that a program has joined."""

    def __init__(self, scenario: Scenario, node: NodeId, drive: Drive, mailbox: Mailbox) -> None:
        self.id = node
        self.scenario = scenario
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
        if priority not in PRIORITIES:
            raise ConfigError(f"priority = {priority!r} must be one of {', '.join(PRIORITIES)}")
        destination = _destination(to)
        confirmed = destination != BROADCAST if confirm is None else confirm
        body = _body(content, port, self.id)
        future: asyncio.Future[Sent] = asyncio.get_running_loop().create_future()

        def send() -> int:
            return self._mailbox.port.send(
                body,
                destination=destination,
                priority=PRIORITIES[priority],
                confirm=confirmed,
                lifetime_ns=None if lifetime_s is None else seconds_to_ns(lifetime_s),
                deadline_ns=None if deadline_s is None else seconds_to_ns(deadline_s),
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
        """Swarm time."""
        return self._drive.now_ns() / S

    @property
    def neighbors(self) -> tuple[int, ...]:
        """Nodes whose hellos are heard."""
        return self._drive.state().neighbors

    @property
    def bound_ms(self) -> float | None:
        """Within which delay everyone has the next bulk packet of this node; None: the network states none."""
        bound_ns = self._drive.state().bound_ns
        return None if bound_ns is None else bound_ns / MS

    @property
    def clusters(self) -> Mapping[int, tuple[int, ...]]:
        """By head, the nodes of each cluster, as far as this node knows."""
        return {int(head): tuple(nodes) for head, nodes in self._drive.state().clusters.items()}

    @property
    def position(self) -> Enu:
        """The last position fix."""
        return self._mailbox.port.position

    @property
    def lost(self) -> int:
        """Messages that were let go of because nobody read them."""
        return self._mailbox.lost

    def report(self) -> Mapping[str, Any]:
        """The node's counters, as they are in the results of a run."""
        return self._drive.report()


def _destination(to: int | Iterable[int] | str) -> NodeId | Collection[NodeId]:
    if isinstance(to, str):
        if to != ALL:
            raise ConfigError(f"to = {to!r} must be {ALL!r}, a node id or several")
        return BROADCAST
    return NodeId(to) if isinstance(to, int) else tuple(NodeId(node) for node in to)


def _body(content: object, port: int | None, node: NodeId) -> bytes | Data:
    if port is not None:
        if not isinstance(content, bytes | bytearray | memoryview):
            raise ConfigError(f"content for port {port} must be bytes, not {type(content).__name__}")
        return Data(port, bytes(content))
    if isinstance(content, bytes | bytearray | memoryview):
        return bytes(content)
    try:
        return mavlink.packed(content, node)
    except LocalProtocolError as error:
        raise ConfigError(str(error)) from error


# --- how a node is joined ---------------------------------------------------------------------------------------------


class _RealTime:
    """Real time: the host runs in a task of its own."""

    def __init__(self, uav: Uav | ClockedUav, host: RealtimeHost, task: asyncio.Task[None]) -> None:
        self._uav = uav
        self._host = host
        self._task = task

    def nudge(self) -> None:
        self._host.nudge()

    def now_ns(self) -> int:
        return self._host.now_ns()

    def state(self) -> NodeState:
        return self._uav.state(self._host.now_ns())

    def report(self) -> Mapping[str, Any]:
        return self._uav.report()

    async def wait(self, future: asyncio.Future[T]) -> T:
        try:
            await asyncio.wait((future, self._task), return_when=asyncio.FIRST_COMPLETED)
            if future.done():
                return future.result()
        finally:
            future.cancel()
        if not self._task.cancelled():
            self._task.result()  # raises what ended the host
        raise NodeClosedError("the swarm's time is over")


@contextlib.asynccontextmanager
async def _running(uav: Uav | ClockedUav, host: RealtimeHost, scenario: Scenario) -> AsyncIterator[Drive]:
    """A host in a task; yields when its UAV has been started, and ends it whatever happens."""
    task = asyncio.ensure_future(
        host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S, scenario=scenario)
    )
    try:
        while not host.running:
            if task.done():
                task.result()
                raise NodeClosedError("the swarm's time was over before the node had joined")
            await asyncio.wait((task,), timeout=_POLL_S)
        yield _RealTime(uav, host, task)
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError, BusError):
            await task


@dataclass(frozen=True)
class Emulated:
    """The emulated radio of a swarm whose Zenoh router listens on an endpoint."""

    endpoint: str = "tcp/127.0.0.1:7447"
    swarm: str | None = None
    """By default the scenario's name."""
    zenoh_config: Path | None = None
    patience_s: float = _PATIENCE_S
    """How long the router is waited for."""
    position: Enu = _ORIGIN
    """Where the node is until its first fix."""

    @contextlib.asynccontextmanager
    async def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> AsyncIterator[Drive]:
        swarm = self.swarm or scenario.name
        uav = make_uav(scenario, node, swarm, position=self.position, applications=applications)
        file = config_of(self.zenoh_config, uav.name)
        bus = await asyncio.to_thread(Bus.join, self.endpoint, file, patience_s=self.patience_s)
        with bus:
            async with _running(uav, RealtimeHost(uav, bus, Topics(swarm)), scenario) as drive:
                yield drive


@dataclass(frozen=True)
class OnAir:
    """A real radio: UDP broadcasts on an ad hoc interface."""

    address: str
    broadcast: str
    port: int = PORT
    epoch_unix_s: float | None = None
    """Unix time of swarm instant 0, for a node without a router; clocks agree by GPS or NTP."""
    endpoint: str | None = None
    """Zenoh endpoint of a router that keeps the swarm's clock; None: there is no router."""
    swarm: str | None = None
    zenoh_config: Path | None = None
    position: Enu = _ORIGIN

    @contextlib.asynccontextmanager
    async def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> AsyncIterator[Drive]:
        if (self.epoch_unix_s is None) == (self.endpoint is None):
            raise ConfigError("a real radio needs epoch_unix_s or endpoint, and not both: one of them keeps the clock")
        swarm = self.swarm or scenario.name
        names = Topics(swarm)
        uav = make_uav(scenario, node, swarm, position=self.position, applications=applications)
        epoch_unix_ns = None if self.epoch_unix_s is None else round(self.epoch_unix_s * S)
        with joined(self.endpoint, config_of(self.zenoh_config, uav.name)) as inner:
            bus = FieldBus(names, node, inner=inner, epoch_unix_ns=epoch_unix_ns)
            host = RealtimeHost(uav, bus, names)
            radio = UdpRadio(
                node, address=self.address, broadcast=self.broadcast, port=self.port,
                max_frame_bytes=scenario.radio.max_frame_bytes, now_ns=host.now_ns, on_message=bus.on_radio,
            )  # fmt: skip
            bus.use(radio)
            await radio.open()
            try:
                async with _running(uav, host, scenario) as drive:
                    yield drive
            finally:
                radio.close()


@contextlib.asynccontextmanager
async def join(
    scenario: Scenario | str | Path,
    *,
    node: int,
    radio: Radio | None = None,
    messages: Collection[int] = (),
    applications: Sequence[Application] = (),
) -> AsyncIterator[Node]:
    """Be one node of a swarm. `radio`: `Emulated(...)` (the default), `OnAir(...)`, or a swarm in virtual time.

    The node is given all that is sent to ports, and MAVLink messages whose ids are in `messages` (or ANY). Yields when
    the node takes part. Raises ConfigError for a scenario or an id that is wrong, and BusError when the router cannot
    be had. Leaving the block, or being cancelled in it, ends the node.
    """
    known = scenario if isinstance(scenario, Scenario) else config.load(Path(scenario))
    if node not in known.node_ids:
        raise ConfigError(f"node = {node}: must be in [1, nodes.count = {known.nodes.count}]")
    mailbox = Mailbox(messages)
    how = Emulated() if radio is None else radio
    async with how.attach(known, NodeId(node), [mailbox, *applications]) as drive:
        yield Node(known, NodeId(node), drive, mailbox)

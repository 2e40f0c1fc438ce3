"""Connects the node of a user's program to a swarm: over the emulated radio, or over a real one.

    Emulated   Zenoh session -> host -> UAV
    OnAir      UDP socket, and a router that keeps the clock or an epoch -> host -> UAV

The host runs in a task, which ends with the `async with` block. If the host ends first, because the time is over, the
router is gone or the UAV has raised, every task that waits for the node is told.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from agents.clock.clocked_uav import ClockedUav, make_uav
from agents.uav import NodeState, Uav
from fanet_mw.application import Application
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts.bus import Bus, HostBus, config_of
from fanet_mw.hosts.clock import START_PATIENCE_S, given_epoch_ns
from fanet_mw.hosts.realtime import RealtimeHost
from fanet_mw.radios.field_bus import FieldBus, joined
from fanet_mw.radios.udp import MAX_PORT, PORT, UdpRadio
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S

T = TypeVar("T")
_POLL_S: Final = 0.01
_PATIENCE_S: Final = 10.0
"""Longer than a person at a terminal would wait; on a busy machine a handshake may take seconds."""
_LEAVING_S: Final = 5.0
"""A program that leaves waits no longer for what its node has yet to send; a flooding period of the paper."""
_ORIGIN: Final = Enu(0.0, 0.0, 0.0)


class NodeClosedError(BusError):
    """The node's time in the swarm is over: nothing is sent or received any more."""


class Drive(Protocol):
    """The host of a joined node, as the node's program needs it."""

    def nudge(self) -> None:
        """Let the UAV look at what has been handed to it."""

    def now_ns(self) -> int: ...

    def state(self) -> NodeState:
        """The state of the network, as the node knows it."""

    def report(self) -> Mapping[str, Any]:
        """The counters of the UAV."""

    async def wait(self, future: asyncio.Future[T]) -> T:
        """Wait for something that the host brings about; raises if it cannot come any more."""


class Attachment(Protocol):
    """The way in which a node is connected to a swarm."""

    def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> contextlib.AbstractAsyncContextManager[Drive]: ...


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

    async def let_out(self, lead_ns: int) -> None:
        """Wait until receipts and packets of this node are on the air, unless the medium is always taken."""
        ends_s = self._now_s() + _LEAVING_S
        while self._host.running and self.state().owing and self._now_s() < ends_s:
            await asyncio.wait((self._task,), timeout=_POLL_S)
        if self._host.running:
            await asyncio.wait((self._task,), timeout=lead_ns / S + _POLL_S)

    def _now_s(self) -> float:
        return asyncio.get_running_loop().time()

    async def wait(self, future: asyncio.Future[T]) -> T:
        try:
            await asyncio.wait((future, self._task), return_when=asyncio.FIRST_COMPLETED)
            if future.done():
                return future.result()
        finally:
            future.cancel()
        if not self._task.cancelled():
            self._task.result()  # raises what has ended the host
        raise NodeClosedError("the swarm's time is over")


@contextlib.asynccontextmanager
async def _running(uav: Uav | ClockedUav, host: RealtimeHost, scenario: Scenario) -> AsyncIterator[Drive]:
    """Run a host in a task; yields when its UAV has started, and ends the task whatever happens."""
    task = asyncio.ensure_future(
        host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S, scenario=scenario)
    )
    try:
        while not host.running:
            if task.done():
                task.result()
                raise NodeClosedError("the swarm's time was over before the node had joined")
            await asyncio.wait((task,), timeout=_POLL_S)
        drive = _RealTime(uav, host, task)
        yield drive
        await drive.let_out(scenario.radio.lead_ns)  # not if the program has raised, or was canceled
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError, BusError):
            await task


@dataclass(frozen=True)
class Emulated:
    """The emulated radio of a swarm whose Zenoh router listens on an endpoint."""

    endpoint: str = "tcp/127.0.0.1:7447"
    """The Zenoh endpoint of the router."""
    swarm: str | None = None
    """The name of the swarm; by default that of the scenario."""
    zenoh_config: Path | None = None
    """Zenoh's own configuration (TLS, access lists): a file, or a folder of `fanet keys`; None: plain TCP."""
    patience_s: float = _PATIENCE_S
    """The time for which the router is waited for."""
    position: Enu = _ORIGIN
    """The position of the node until its first fix."""

    @contextlib.asynccontextmanager
    async def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> AsyncIterator[Drive]:
        swarm = self.swarm or scenario.name
        uav = make_uav(scenario, node, swarm, position=self.position, applications=applications)
        file = config_of(self.zenoh_config, uav.name)
        with await Bus.join_on_loop(self.endpoint, file, patience_s=self.patience_s) as bus:
            async with _running(uav, RealtimeHost(uav, bus, Topics(swarm)), scenario) as drive:
                yield drive


@dataclass(frozen=True)
class OnAir:
    """A real radio: UDP broadcasts on an ad hoc interface."""

    address: str
    """The IPv4 address of the interface."""
    broadcast: str
    """The broadcast address of its network."""
    port: int = PORT
    """The UDP port of all nodes."""
    epoch_unix_s: float | None = None
    """The Unix time of swarm instant 0, for a node without a router; clocks agree by GPS or NTP."""
    endpoint: str | None = None
    """The Zenoh endpoint of a router that keeps the swarm's clock; None: there is no router."""
    swarm: str | None = None
    """The name of the swarm; by default that of the scenario."""
    zenoh_config: Path | None = None
    """Zenoh's own configuration (TLS, access lists): a file, or a folder of `fanet keys`; None: plain TCP."""
    position: Enu = _ORIGIN
    """The position of the node until its first fix."""

    @contextlib.asynccontextmanager
    async def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> AsyncIterator[Drive]:
        uav = make_uav(scenario, node, self.swarm or scenario.name, position=self.position, applications=applications)
        async with self.opened(uav, scenario, node) as (host, _), _running(uav, host, scenario) as drive:
            yield drive

    @contextlib.asynccontextmanager
    async def opened(
        self,
        uav: Uav | ClockedUav,
        scenario: Scenario,
        node: NodeId,
        *,
        through: Callable[[HostBus], HostBus] = lambda bus: bus,
    ) -> AsyncIterator[tuple[RealtimeHost, UdpRadio]]:
        """The host of a UAV and its radio, open within the block; `through` comes between the host and its bus."""
        if (self.epoch_unix_s is None) == (self.endpoint is None):
            raise ConfigError("a real radio needs epoch_unix_s or endpoint, and not both: one of them keeps the clock")
        if not 1 <= self.port <= MAX_PORT:
            raise ConfigError(f"the UDP port of a real radio = {self.port}: must be in [1, {MAX_PORT}]")
        names = Topics(self.swarm or scenario.name)
        epoch_unix_ns = None if self.epoch_unix_s is None else given_epoch_ns(self.epoch_unix_s, scenario)
        async with joined(self.endpoint, config_of(self.zenoh_config, uav.name)) as inner:
            bus = FieldBus(names, node, inner=inner, epoch_unix_ns=epoch_unix_ns)
            host = RealtimeHost(uav, through(bus), names)
            radio = UdpRadio(
                node, address=self.address, broadcast=self.broadcast, port=self.port,
                max_frame_bytes=scenario.radio.max_frame_bytes, now_ns=host.now_ns, on_message=bus.on_radio,
                hears=lambda: host.running,
            )  # fmt: skip
            bus.use(radio)
            await radio.open()
            try:
                yield host, radio
            finally:
                radio.close()

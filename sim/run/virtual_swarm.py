"""A swarm in virtual time that a program steers: time passes only while one of its tasks waits for something."""

import asyncio
import contextlib
import inspect
import math
import time
from collections.abc import AsyncIterator, Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from agents.clock.clocked_uav import ClockedUav
from agents.program.attached import Drive, NodeClosedError
from agents.program.joined import Node
from agents.program.mailbox import Mailbox
from agents.uav import NodeState, Uav
from fanet_mw.actor import Actor
from fanet_mw.application import Application
from fanet_mw.bus.radio_control import Cut, Degrade, Restore, require_valid
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered
from fanet_mw.units import MS, NodeId, S, seconds_to_ns
from sim.records.record_kinds import records_of
from sim.results.result import Result
from sim.run.arguments import OfUser, by_node, scenario_of
from sim.run.virtual import Observed, StoppableUav

T = TypeVar("T")
_STEP_NS: Final = 10 * MS
"""Virtual time advances by this much before the program's tasks run again."""
_TURNS: Final = 4
"""This many turns of the event loop are enough for a chain of tasks that wait for each other."""
_STOPPED: Final = NodeState((), None, {}, owing=False)
"""The state of a node whose program has ended, by a fault of the scenario."""


class _Time:
    """The time of a virtual swarm, which begins when a task first waits for it."""

    def __init__(self, scenario: Scenario, applications: Callable[[int], Sequence[Application]]) -> None:
        self.scenario = scenario
        self.joined: dict[int, list[Application]] = {}
        self.observed: Observed | None = None
        self.ended = False
        self._applications = applications

    def now_ns(self) -> int:
        return 0 if self.observed is None else self.observed.host.now_ns

    @property
    def over(self) -> bool:
        return self.ended or self.now_ns() >= self.scenario.duration_ns

    def start(self) -> Observed:
        """Build the actors, with all nodes that were joined, and start them; only the first call does it."""
        if self.observed is None:
            self.observed = Observed(
                self.scenario, applications=lambda n: [*self._applications(n), *self.joined.get(n, ())]
            )
            self.observed.host.start()
        return self.observed

    def uav(self, node: int) -> Actor:
        return next(actor for actor in self.start().actors if actor.name == f"agent-{node}")

    async def step(self, until_ns: int) -> None:
        """Let a little time pass, and then let the other tasks of the program run."""
        if self.ended:
            raise NodeClosedError("the swarm's time is over")
        host = self.start().host
        host.run(min(host.now_ns + _STEP_NS, until_ns))
        await _breathe()


async def _breathe() -> None:
    """Let other tasks run, so that a task that was told something can act before time goes on."""
    for _ in range(_TURNS):
        await asyncio.sleep(0)


class _VirtualDrive:
    """The time of a node in a virtual swarm; it passes while a task waits for it."""

    def __init__(self, time: _Time, node: int) -> None:
        self._time = time
        self._node = node

    def nudge(self) -> None:
        if self._time.observed is not None and not self._time.over:
            self._time.observed.host.nudge(self._time.uav(self._node))

    def now_ns(self) -> int:
        return self._time.now_ns()

    def state(self) -> NodeState:
        uav = self._time.uav(self._node)
        alive = uav.alive if isinstance(uav, StoppableUav) else uav
        return alive.state(self._time.now_ns()) if isinstance(alive, Uav | ClockedUav) else _STOPPED

    def report(self) -> Mapping[str, Any]:
        return self._time.uav(self._node).report()

    async def wait(self, future: asyncio.Future[T]) -> T:
        time = self._time
        try:
            await _breathe()
            while not future.done():
                if time.over:
                    raise NodeClosedError("the swarm's time is over")
                await time.step(time.scenario.duration_ns)
            return future.result()
        finally:
            future.cancel()


class VirtualSwarm:
    """A whole swarm in virtual time, which passes only while a task waits for something. `async with` ends the run
    with its block; without it `result` does.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path,
        *,
        applications: OfUser | None = None,
        seed: int | None = None,
        overrides: Sequence[str] = (),
    ) -> None:
        self.scenario = scenario_of(scenario, seed=seed, overrides=overrides)
        """The scenario that is run, with its seed and all overrides."""
        self._time = _Time(self.scenario, by_node(applications, self.scenario))
        self._nodes: dict[int, Node] = {}
        self._began_s = time.perf_counter()
        self._result: Result | None = None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.result()  # whatever the block looked at, the run ends in order
        self._time.ended = True

    # --- time -----------------------------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Swarm time."""
        return self._time.now_ns() / S

    async def run_until(self, wanted: float | Callable[[], bool], *, timeout_s: float | None = None) -> None:
        """Let time pass until an instant [s], or until something is true; raises TimeoutError when that takes longer.

        Other tasks of the program run meanwhile. Time never passes the scenario's end: what is later, or not true by
        then, raises.
        """
        if inspect.iscoroutinefunction(wanted):
            raise ConfigError(f"wanted = {wanted!r} must be no async function: what it returns is always true")
        wanted_ns = self.scenario.duration_ns if callable(wanted) else _ns("wanted", wanted)
        until_ns = min(wanted_ns, self.scenario.duration_ns)
        if timeout_s is not None:
            until_ns = min(until_ns, self._time.now_ns() + _ns("timeout_s", timeout_s))
        self._time.start()
        while self._time.now_ns() < until_ns and not (callable(wanted) and wanted()):
            await self._time.step(until_ns)
        if callable(wanted) and not wanted():
            raise TimeoutError(f"not true by {self.now_s:g} s")
        if self._time.now_ns() < wanted_ns and not callable(wanted):
            ends = "the time ends" if self._time.over else f"timeout_s = {timeout_s:g} ends"
            raise TimeoutError(f"wanted = {wanted:g} s: {ends} at {self.now_s:g} s")

    async def run_for(self, duration_s: float) -> None:
        """Let so much time pass."""
        await self.run_until((self._time.now_ns() + _ns("duration_s", duration_s)) / S)

    # --- nodes ----------------------------------------------------------------------------------------------------

    def node(self, node: int, *, messages: Collection[int] = ()) -> Node:
        """A node to send from and to receive at; to be asked for before time passes. `messages`: as of `join`."""
        if node not in self._nodes:
            mailbox = Mailbox(messages)
            self._nodes[node] = Node(self.scenario, NodeId(node), self._join(node, [mailbox]), mailbox)
        return self._nodes[node]

    def _join(self, node: int, applications: Sequence[Application]) -> _VirtualDrive:
        if self._time.observed is not None:
            raise ConfigError(f"node {node} must be joined before time passes; it is {self.now_s:g} s")
        if node not in self.scenario.node_ids:
            raise ConfigError(f"node = {node!r}: must be in [1, {self.scenario.last_id}]")
        self._time.joined.setdefault(node, []).extend(applications)
        return _VirtualDrive(self._time, node)

    @contextlib.asynccontextmanager
    async def attach(
        self, scenario: Scenario, node: NodeId, applications: Sequence[Application]
    ) -> AsyncIterator[Drive]:
        """What `join(..., radio=swarm)` asks for."""
        if scenario != self.scenario:
            raise ConfigError("the scenario of a node must be that of its swarm")
        yield self._join(node, applications)

    # --- faults ---------------------------------------------------------------------------------------------------

    def cut(self, node: int, *, for_s: float = 0.0) -> None:
        """Switch a node's radio off, for a while or (0) until `restore`."""
        self._control(Cut(f"cut-{node}", NodeId(node), _ns("for_s", for_s)))

    def degrade(self, a: int, b: int, *, loss_share: float = 1.0, loss_db: float = 0.0, for_s: float = 0.0) -> None:
        """Let the link between two nodes lose frames, both ways."""
        for_ns, label = _ns("for_s", for_s), f"degrade-{a}-{b}"
        self._control(
            Degrade(label, NodeId(a), NodeId(b), both=True, loss_db=loss_db, loss_share=loss_share, for_ns=for_ns)
        )

    def restore(self) -> None:
        """End all faults."""
        self._control(Restore(""))

    def _control(self, fault: Cut | Degrade | Restore) -> None:
        if not isinstance(fault, Restore):
            require_valid(fault, count=self.scenario.node_count)
        observed = self._time.start()
        observed.host.put(observed.names.radio_control, fault)

    # --- what came of it ------------------------------------------------------------------------------------------

    @property
    def deliveries(self) -> Sequence[Delivered]:
        """Packets that were delivered until now."""
        return [] if self._time.observed is None else [*records_of(self._time.observed.records, Delivered)]

    def result(self) -> Result:
        """End the run where it is, and what came of it; time does not pass any more."""
        if self._result is None:
            observed = self._time.start()
            observed.host.stop_after_failure() if observed.host.failed else observed.host.stop()
            self._time.ended = True
            wall_s = time.perf_counter() - self._began_s
            self._result = Result(observed.outcome(wall_s=wall_s, cut_short="ended by its program"))
        return self._result

    def assert_bound_kept(self) -> None:
        """Every copy of a packet with a bound was there within it; and there were such packets. Ends the run."""
        bound = self.result().summary["bound"]
        assert bound, "no packet was promised a bound"
        assert bound["violations"] == 0, f"promises were broken: {bound}"

    def assert_ledger_closes(self) -> None:
        """Every frame is accounted for: delivered, dropped with a reason, or in flight. Ends the run."""
        frames = self.result().summary["frames"]
        assert frames["closes"], f"frames are unaccounted for: {frames}"


def _ns(name: str, seconds: float) -> int:
    if not (isinstance(seconds, int | float) and 0 <= seconds < math.inf):
        raise ConfigError(f"{name} = {seconds!r} must be a number of seconds >= 0")
    return seconds_to_ns(seconds)

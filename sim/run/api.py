"""Whole runs for programs and notebooks: `simulate` in virtual time, and `launch` with real processes."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Collection, Sequence
from pathlib import Path
from typing import Final

from agents.program.attached import Emulated
from fanet_mw.errors import BusError
from fanet_mw.scenario import Scenario
from sim.results.outcome import Outcome
from sim.results.result import Result
from sim.run.arguments import OfUser, by_node, known_nodes, scenario_of
from sim.run.launcher.leads import fitted
from sim.run.launcher.swarm import READY_TIMEOUT_S, SwarmRun
from sim.run.launcher.swarm import launch as launch_processes
from sim.run.virtual import simulate as run_virtual

_LAST_WORD_S: Final = 5.0
"""The time in which a launcher whose router has gone says what has ended it."""


def simulate(
    scenario: Scenario | str | Path,
    *,
    applications: OfUser | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
) -> Result:
    """Run a scenario in virtual time, with a user's applications on its nodes; the same seed gives the same result."""
    known = scenario_of(scenario, seed=seed, overrides=overrides)
    return Result(run_virtual(known, applications=by_node(applications, known)))


class Launched:
    """A swarm of real processes that runs."""

    def __init__(self, scenario: Scenario, swarm: SwarmRun, task: asyncio.Task[Outcome]) -> None:
        self.scenario = scenario
        """The scenario that is run."""
        self.processes = swarm.processes
        """Its processes: `processes.names()`, and `processes.pid(name)` of each."""
        self.radio = Emulated(endpoint=swarm.address.endpoint, swarm=swarm.address.swarm, patience_s=READY_TIMEOUT_S)
        """The radio by which a node that was left out joins: `join(swarm.scenario, node=3, radio=swarm.radio)`."""
        self.result: Result | None = None
        """What came of the run, once the block is left; None before."""
        self._swarm, self._task = swarm, task

    async def wait(self) -> None:
        """Wait until the run is over; who leaves the block before gets a partial result."""
        await asyncio.wait((self._task,))

    def stop(self) -> None:
        """End the run; before its time the result is partial."""
        if not self._swarm.time_is_over():
            self._swarm.end("ended by its program")


@contextlib.asynccontextmanager
async def launch(
    scenario: Scenario | str | Path,
    *,
    leave_out: Collection[int] = (),
    seed: int | None = None,
    overrides: Sequence[str] = (),
    listen: str | None = None,
    respawn: bool = False,
) -> AsyncIterator[Launched]:
    """Run a scenario as real processes while the block lasts; afterwards `result` is what was collected.

    The nodes of `leave_out` are joined by others, who have the scenario as it is; without any, a scenario that states
    no `radio.lead_ms` gets one that fits the machine. The swarm's time begins when all are there. A block that ends
    early ends the run; `await launched.wait()` stays until the scenario's end. Raises BusError when the swarm does not
    come up, or the block ends before that.
    """
    stated = scenario_of(scenario, seed=seed, overrides=overrides)
    known_nodes("leave_out", leave_out, stated)
    known, leads = stated, None
    if not leave_out:
        known, leads = await asyncio.to_thread(fitted, stated, lambda _: None)
    started: asyncio.Future[SwarmRun] = asyncio.get_running_loop().create_future()
    task = asyncio.ensure_future(
        launch_processes(
            known, swarm=known.name, listen=listen, respawn=respawn, leave_out=leave_out, heed_signals=False,
            on_started=started.set_result, leads=leads,
        )
    )  # fmt: skip
    try:
        await asyncio.wait((started, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        launched = Launched(known, started.result(), task)
        yield launched
        if not task.done():
            launched.stop()
        launched.result = Result(await task)
    except BusError as error:
        await asyncio.wait((task,), timeout=_LAST_WORD_S)  # a node of the block has lost its router: why is said there
        if task.done() and not task.cancelled() and (why := task.exception()) is not None:
            raise why from error
        raise
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError, Exception):
            await task


__all__ = ["Launched", "launch", "simulate"]

"""The result of a swarm whose services were started one by one, collected by the router."""

import asyncio
import time
from pathlib import Path
from typing import Self

from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.scenario import Scenario
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.collecting.collector import Collector


class Collection:
    """Collects while the swarm runs, and writes the result at the end."""

    def __init__(self, scenario: Scenario, bus: Bus, names: Topics, out: Path) -> None:
        self._out = out
        self._began_s = time.monotonic()
        self._collector = Collector(scenario, bus.subscribe, names, now_ns=time.monotonic_ns, folder=out)
        bus.answer(names.standing, self._collector.standing)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._collector.close()

    async def last_words(self, patience_s: float) -> None:
        """Wait until all actors have sent their last reports, but no longer than `patience_s`."""
        end_s = time.monotonic() + patience_s
        while self._collector.unfinished() and time.monotonic() < end_s:  # noqa: ASYNC110  (other threads fill it)
            await asyncio.sleep(0.05)

    def outcome(self, *, ready_s: float, epoch_unix_ns: int) -> Outcome:
        """What was heard until now."""
        wall_s = time.monotonic() - self._began_s - ready_s
        return self._collector.outcome(wall_s=wall_s, ready_s=ready_s, epoch_unix_ns=epoch_unix_ns)

    def finish(self, outcome: Outcome) -> int:
        """Write the result; returns exit code 0 if it may be used, otherwise 1."""
        return 0 if finish(outcome, out=self._out)["valid"] else 1

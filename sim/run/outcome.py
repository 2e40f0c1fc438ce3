"""The result of a run, whichever host ran it: the input of metrics and files."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from sim.results.links import LinkTotals


@dataclass(slots=True)
class Outcome:
    """The result of one run, finished or cut short."""

    scenario: Scenario
    mode: Literal["virtual", "realtime"]
    wall_s: float
    records: Collection[Record]
    """The trace records by instant; within one instant as they were made (virtual) or by node (real time). They are on
    disk and decoded anew each time they are read; in virtual time, those of the last while are in memory. `of` in
    `collecting.trace_reading` reads those of some kinds."""
    reports: Mapping[str, Mapping[str, Any]]
    """The last report of each actor, by its name."""
    taps: Collection[tuple[int, bytes]] = ()
    """Pairs (instant ns, MAVLink bytes) for the `.tlog`."""
    links: LinkTotals = field(default_factory=LinkTotals)
    """What each link has carried."""
    ended: list[tuple[str, int]] = field(default_factory=list)
    """Pairs (name, exit code) of processes that ended before their time."""
    aborted: str | None = None
    """Why the run is partial; None when it ran to its end."""
    ended_ns: int | None = None
    """The swarm instant at which a partial run ended; None when it ran to its end."""
    epoch_unix_ns: int = 0
    """The unix time of swarm instant 0; a fixed one in virtual time, so that the same run gives the same files."""
    ready_s: float = 0.0
    """The time until all processes were up, in real time."""
    heard: Mapping[str, Any] = field(default_factory=dict)
    """The puts that the launcher received, and what of them was refused, by what was wrong; in real time only."""
    absent: Mapping[str, str] = field(default_factory=dict)
    """The reason why there is no report of an actor, by the actor's name; in real time only."""
    stall_ms: float = 0.0
    """The longest time for which the launcher, and with it the bus, could do nothing; in real time only."""

    @property
    def simulated_ns(self) -> int:
        """The swarm time that has passed."""
        return self.scenario.duration_ns if self.ended_ns is None else self.ended_ns

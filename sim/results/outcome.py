"""The outcome of a run, in virtual or in real time: the input of metrics and files."""

import signal
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from sim.results.links import LinkTotals

UNHEARD: Final = "no report was heard"
"""Why the report of an actor is missing that has sent none."""


def described(exit_code: int) -> str:
    """An exit code in words; a signal by its name."""
    return f"signal {signal.Signals(-exit_code).name}" if exit_code < 0 else f"exit code {exit_code}"


@dataclass(slots=True)
class Outcome:
    """The outcome of one run, complete or partial."""

    scenario: Scenario
    mode: Literal["virtual", "realtime"]
    wall_s: float
    records: Collection[Record]
    """By instant, then in the order in which they were made (virtual time) or by node (real time). They are on disk,
    and decoded each time they are read; `record_kinds.records_of` reads those of some kinds."""
    reports: Mapping[str, Mapping[str, Any]]
    """The last report of each actor, by its name."""
    taps: Collection[tuple[int, bytes]] = ()
    """Pairs (instant ns, MAVLink bytes) for `mavlink.tlog`."""
    links: LinkTotals = field(default_factory=LinkTotals)
    ended: list[tuple[str, int]] = field(default_factory=list)
    """Name and exit code of each process that ended too early."""
    aborted: str | None = None
    """Why the run is partial; None if it is complete."""
    ended_ns: int | None = None
    """The swarm instant at which a partial run ended; None if it is complete."""
    epoch_unix_ns: int = 0
    """The unix time of swarm instant 0; a fixed one in virtual time, so that the same run gives the same files."""
    ready_s: float = 0.0
    """The time until all processes were present, in real time only."""
    heard: Mapping[str, Any] = field(default_factory=dict)
    """The number of puts that the launcher received, and of refused items by what was wrong; in real time only."""
    absent: Mapping[str, str] = field(default_factory=dict)
    """Why the report of an actor, or its last one, is missing, by the actor's name; in real time only."""
    slowed: Sequence[tuple[int, float]] = ()
    """When the pace of the clock changed as the machine could not keep up, or could again: swarm instant [ns], scale.
    """
    pauses: Mapping[str, Any] = field(default_factory=dict)
    """The pauses of the machine as the launcher saw them, in real time only."""
    leads: Mapping[str, Any] = field(default_factory=dict)
    """What was chosen for a scenario that states no lead, and the pause that was measured; in real time only."""
    stall_ms: float = 0.0
    """The longest time for which the launcher, and with it the bus, could do nothing; in real time only."""

    @property
    def simulated_ns(self) -> int:
        return self.scenario.duration_ns if self.ended_ns is None else self.ended_ns

"""What a run leaves behind, whichever host ran it. The input of metrics and files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from sim.results.links import LinkTotals


@dataclass(slots=True)
class Outcome:
    """One finished (or cut short) run."""

    scenario: Scenario
    mode: Literal["virtual", "realtime"]
    wall_s: float
    records: list[Record]
    """By instant; within one instant as they were made (virtual) or by node (real time)."""
    reports: Mapping[str, Mapping[str, Any]]
    """The last report of each actor, by its name."""
    taps: list[tuple[int, bytes]] = field(default_factory=list)
    """(instant ns, MAVLink bytes) for the `.tlog`."""
    links: LinkTotals = field(default_factory=LinkTotals)
    """What each link carried."""
    ended: list[tuple[str, int]] = field(default_factory=list)
    """(name, exit code) of processes that died before their time."""
    aborted: str | None = None
    """Why the run is partial; None when it ran to its end."""
    ended_ns: int | None = None
    """The swarm instant at which a partial run ended; None when it ran to its end."""
    epoch_unix_ns: int = 0
    """Unix time of swarm instant 0; in virtual time a fixed one, so that the same run gives the same files."""
    ready_s: float = 0.0
    """Real time: until all processes were up."""
    heard: Mapping[str, Any] = field(default_factory=dict)
    """Real time: puts that the launcher heard, and what of them was refused, by what was wrong."""
    absent: Mapping[str, str] = field(default_factory=dict)
    """Real time: why there is no report of an actor, by its name."""
    stall_ms: float = 0.0
    """Real time: the longest that the launcher, and the bus with it, could do nothing."""

    @property
    def simulated_ns(self) -> int:
        """How much swarm time has passed."""
        return self.scenario.duration_ns if self.ended_ns is None else self.ended_ns

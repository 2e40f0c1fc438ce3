"""The `[clock]` table of a scenario: how inaccurate the nodes' clocks are, and how the nodes agree on a common time.

    local = true + offset + (1 + rate) x elapsed        the rate within `drift_ppm`, wandering by `wander_ppm`

A clock may also jump (`jumps`).
Without any of these keys a node's clock is that of its host, and exact. Not modeled: aging, and temperature other than
as a wander.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.tables.sections import Id, Milliseconds, Section, SomeTime
from fanet_mw.units import MS, US, seconds_to_ns


class Clock(Section):
    """The oscillators of the nodes, and how the nodes come to a common time."""

    sync: Literal["none", "beacons", "gps"] = "none"
    """How a node learns swarm time. `none`: it takes its own clock for swarm time; `beacons`: hellos carry the time of
    the node with the lowest id, hop by hop; `gps`: each position fix gives the time."""
    offset_ms: Milliseconds = 0.0
    """A node's clock is off by U(-offset, offset) at the start. With `sync = "none"` the nodes know this bound, as the
    accuracy with which their clocks were set."""
    drift_ppm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Bound of the clock's rate error, which is drawn from U(-drift, drift). The nodes know it from the data sheet of
    the oscillator; 10 to 20 is usual for a crystal."""
    wander_ppm: Annotated[float, Field(ge=0, le=10)] = 0.0
    """The rate error changes by N(0, wander) per second, and stays within `drift_ppm`."""
    timestamp_us: Annotated[float, Field(ge=0, le=1e6)] = 1.0
    """Resolution of a radio's time stamps; the timing synchronization function of IEEE 802.11 counts microseconds."""
    gps_sigma_ns: Annotated[float, Field(ge=0, le=1e9)] = 100.0
    """`gps`: standard deviation of the time of one fix; a receiver without a timing output has some 100 ns to 1 us."""
    limit_s: SomeTime = 5.0
    """`beacons` and `gps`: a swarm time that differs from the own clock by more than this is not accepted, whichever
    node states it."""

    jumps: tuple[tuple[Id, SomeTime, Annotated[float, Field(ge=-60_000, le=60_000)]], ...] = ()
    """Clocks that jump, as a step of NTP lets them: node, instant [s] and by how much [ms], for example
    `[[8, 50.0, 300.0]]`."""
    counter: bool = True
    """Each node's computer also has a counter that nobody sets, as CLOCK_MONOTONIC, by which it sees a jump of its own
    clock and takes it out; `false`: only its neighbors can tell it."""

    @model_validator(mode="after")
    def _a_walk_has_bounds(self) -> Self:
        if self.wander_ppm and not self.drift_ppm:
            raise ValueError("clock.wander_ppm needs clock.drift_ppm > 0, the bound within which the rate walks")
        return self

    @property
    def modelled(self) -> bool:
        """True if a node's clock is not simply that of its host."""
        return self.sync != "none" or bool(self.offset_ms or self.drift_ppm or self.jumps)

    @property
    def offset_ns(self) -> int:
        return round(self.offset_ms * MS)

    def unsynchronized_error_ns(self, duration_ns: int) -> int:
        """The greatest error of an unsynchronized clock at the end of a run."""
        return self.offset_ns + math.ceil(self.drift_ppm * duration_ns / 1_000_000)

    def apart_ns(self, duration_ns: int) -> int:
        """The greatest error of a clock that counts: that of the whole run if nothing synchronizes clocks."""
        return self.unsynchronized_error_ns(duration_ns) if self.modelled and self.sync == "none" else 0

    @property
    def stamp_ns(self) -> int:
        """Resolution of a time stamp, at least 1 ns."""
        return max(1, round(self.timestamp_us * US))

    @property
    def limit_ns(self) -> int:
        return seconds_to_ns(self.limit_s)

"""The `[clock]` table of a scenario: how wrong the nodes' clocks are, and how they agree nevertheless.

    local = true + offset + (1 + rate) x elapsed        the rate within `drift_ppm`, wandering by `wander_ppm`

Without any of it a node's clock is its host's: exact. Not modelled: aging, and temperature other than as a wander.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.sections import Milliseconds, Section, SomeTime
from fanet_mw.units import MS, US, seconds_to_ns


class Clock(Section):
    """Oscillators, and the way to a common time."""

    sync: Literal["none", "beacons", "gps"] = "none"
    """`none`: each node takes its own clock for swarm time; `beacons`: hellos carry the time of the node with the
    lowest id, hop by hop; `gps`: each position fix brings the time."""
    offset_ms: Milliseconds = 0.0
    """A node's clock is off by U(-offset, offset) at the start. With `sync = "none"` the nodes know the bound, as the
    tolerance to which their clocks were set."""
    drift_ppm: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Bound of the error of its rate, drawn from U(-drift, drift). The nodes know it, as the oscillator's data sheet
    says it; 10 to 20 is usual of a crystal."""
    wander_ppm: Annotated[float, Field(ge=0, le=10)] = 0.0
    """The rate walks by N(0, wander) a second, and stays within `drift_ppm`."""
    timestamp_us: Annotated[float, Field(ge=0, le=1e6)] = 1.0
    """Resolution of a radio's time stamps; the timing synchronization function of IEEE 802.11 counts microseconds."""
    gps_sigma_ns: Annotated[float, Field(ge=0, le=1e9)] = 100.0
    """`gps`: standard deviation of the time of one fix; a receiver without a timing output has some 100 ns to 1 us."""
    limit_s: SomeTime = 5.0
    """A swarm time farther from the own clock than this is not believed, whichever node says it."""

    @model_validator(mode="after")
    def _a_walk_has_bounds(self) -> Self:
        if self.wander_ppm and not self.drift_ppm:
            raise ValueError("clock.wander_ppm needs clock.drift_ppm > 0, the bound within which the rate walks")
        return self

    @property
    def modelled(self) -> bool:
        """True if anything stands between a node and its host's clock."""
        return self.sync != "none" or bool(self.offset_ms or self.drift_ppm)

    @property
    def offset_ns(self) -> int:
        return round(self.offset_ms * MS)

    def unsynchronized_error_ns(self, duration_ns: int) -> int:
        """How far a clock that nothing synchronizes may be from true time by the end of a run."""
        return self.offset_ns + math.ceil(self.drift_ppm * duration_ns / 1_000_000)

    @property
    def stamp_ns(self) -> int:
        """Resolution of a time stamp, at least 1 ns."""
        return max(1, round(self.timestamp_us * US))

    @property
    def limit_ns(self) -> int:
        return seconds_to_ns(self.limit_s)

"""`[traffic]`: what the applications of load send."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.sections import (
    MOST_S,
    Duration,
    Id,
    Section,
    SomeTime,
)
from fanet_mw.units import MAX_NODES


class Traffic(Section):
    """The application load: which nodes send how much, how often, to which. Several classes: `[[traffic]]` for each."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{0,64}$")] = ""
    """What results call a class of traffic; empty: `traffic` for the first one, `traffic_2` and so on."""
    payload_bytes: Annotated[int, Field(ge=64, le=2304)] = 1024
    """UDP payload on the air, the routing header included."""
    interval_s: Annotated[float, Field(ge=1e-4, le=MOST_S)] = 1.0
    """From one packet of a source to its next. At least 0.1 ms: packets are named by numbers of which a node has one
    for each 0.1 ms."""
    arrivals: Literal["cbr", "poisson", "saturated", "on_off", "trace", "none"] = "cbr"
    """When a source offers packets: one per interval, with exponential gaps of that mean, always one more as soon as
    the last has ended, one per interval in periods of activity (`on_s`, `off_s`), as `packets` says, or never."""
    on_s: SomeTime = 1.0
    """Arrivals `on_off`: mean of the exponential periods in which a source is active."""
    off_s: Duration = 1.0
    """Arrivals `on_off`: mean of the exponential pauses between these."""
    packets: tuple[tuple[Duration, Annotated[int, Field(ge=64, le=2304)]], ...] = ()
    """Arrivals `trace`: each packet of a source as [seconds after `start_s`, bytes as in `payload_bytes`]."""
    packets_csv: str = ""
    """Arrivals `trace`: a file with a line `seconds,bytes` for each packet, read when the scenario is."""
    start_s: Duration | None = None
    """When a class begins; unset: with the measured part of the run (`warmup_s`)."""
    priority: Literal["safety", "report", "bulk"] = "bulk"
    """Which packets go first where several wait, and after which time they expire (`routing`)."""
    sources: Literal["all"] | Annotated[int, Field(ge=0, le=MAX_NODES)] | tuple[Id, ...] = "all"
    """A number of sources (drawn by seed among the nodes that are neither leader nor destination), a list of node
    ids, or every node but the destination."""
    destination: Literal["all"] | Id = "all"
    """One node's id, or `all`: packets are flooded."""
    deadline_s: SomeTime | None = None
    """`clusters.relay = "scheduled"`: nodes refuse packets that would break this, and record whether their bound meets
    it; unset: every packet is taken. Each class has its own; what nodes record is about the first one's."""
    targets: tuple[Id, ...] = ()
    """Nodes at which delivery counts when the destination is `all`; empty: every other node."""

    @model_validator(mode="after")
    def _trace_has_packets(self) -> Self:
        if self.packets_csv:
            raise ValueError(f"traffic.packets_csv = {self.packets_csv!r}: is read with a scenario file only")
        if (self.arrivals == "trace") != bool(self.packets):
            raise ValueError(f"traffic.packets: {len(self.packets)} with arrivals = {self.arrivals!r}; for trace, some")
        return self

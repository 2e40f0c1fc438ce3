"""The `[traffic]` table: the application load."""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.tables.sections import MOST_S, Duration, Id, Section, SomeTime
from fanet_mw.units import MAX_NODES

LEAST_BYTES: Final = 64
MOST_BYTES: Final = 2304
"""Bounds of a packet; an MSDU has no more (802.11-2020, 9.2.4.8.1)."""


class Traffic(Section):
    """The application load: which nodes send how much, how often, and to whom. With several classes: one `[[traffic]]`
    each.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{0,64}$")] = ""
    """Name of the traffic class in results; empty: `traffic` for the first class, then `traffic_2` and so on."""
    payload_bytes: Annotated[int, Field(ge=LEAST_BYTES, le=MOST_BYTES)] = 1024
    """UDP payload on the air, including the routing header."""
    interval_s: Annotated[float, Field(ge=1e-4, le=MOST_S)] = 1.0
    """Time between two packets of a source, at least 0.1 ms, because a node has one sequence number for each 0.1 ms."""
    arrivals: Literal["cbr", "poisson", "saturated", "on_off", "trace", "none"] = "cbr"
    """When a source sends packets. `cbr`: one per interval; `poisson`: with exponential gaps of that mean; `saturated`:
    the next one as soon as one has ended; `on_off`: one per interval in periods of activity (`on_s`, `off_s`); `trace`:
    as `packets` states; `none`: never."""
    on_s: SomeTime = 1.0
    """`on_off`: mean of the exponential periods in which a source is active."""
    off_s: Duration = 1.0
    """`on_off`: mean of the exponential pauses in between."""
    packets: tuple[tuple[Duration, Annotated[int, Field(ge=LEAST_BYTES, le=MOST_BYTES)]], ...] = ()
    """`trace`: each packet of a source as [seconds after `start_s`, bytes as in `payload_bytes`]."""
    packets_csv: str = ""
    """`trace`: a file with a line `seconds,bytes` for each packet, which is read with the scenario."""
    start_s: Duration | None = None
    """The instant at which the class begins; unset: with the measured part of the run (`warmup_s`)."""
    priority: Literal["safety", "report", "bulk"] = "bulk"
    """Priority of the packets, which decides which packets go first, and after which time they expire (`routing`)."""
    sources: Literal["all"] | Annotated[int, Field(ge=0, le=MAX_NODES)] | tuple[Id, ...] = "all"
    """The nodes that send: a number of them (drawn by the seed among the nodes that are neither leader nor
    destination; if these are too few, the leader is one), a list of ids, or all except the destination."""
    destination: Literal["all"] | Id = "all"
    """The id of one node, or `all`: packets are flooded."""
    deadline_s: SomeTime | None = None
    """Nodes refuse packets that would miss this deadline: with `clusters.relay = "scheduled"` by their bound, and they
    record whether it meets the deadline; bulk in `rounds` by how long packets took lately. Unset: all are accepted.
    Each class has a deadline of its own; the records, and `rounds`, know that of the first class."""
    targets: tuple[Id, ...] = ()
    """The nodes at which deliveries count if the destination is `all`; empty: all other nodes."""

    @property
    def longest_bytes(self) -> int:
        """The size of the longest packet."""
        return max((size for _, size in self.packets), default=self.payload_bytes)

    @property
    def source_hz(self) -> float:
        """The packets a second that one source makes on average."""
        if self.arrivals == "trace":
            return len(self.packets) / max(max(at_s for at_s, _ in self.packets), self.interval_s)
        active = {"on_off": self.on_s / (self.on_s + self.off_s), "saturated": math.inf, "none": 0.0}
        return active.get(self.arrivals, 1.0) / self.interval_s

    def rate_hz(self, nodes: int) -> float:
        """The packets a second that all sources in a swarm of so many nodes make on average."""
        named = self.sources if not isinstance(self.sources, tuple) else len(self.sources)
        sources = nodes if isinstance(named, str) else named
        return sources * self.source_hz if sources else 0.0

    @model_validator(mode="after")
    def _trace_has_packets(self) -> Self:
        if self.packets_csv:
            raise ValueError(f"traffic.packets_csv = {self.packets_csv!r}: is read with a scenario file only")
        if (self.arrivals == "trace") != bool(self.packets):
            raise ValueError(f"traffic.packets: {len(self.packets)} with arrivals = {self.arrivals!r}; for trace, some")
        return self

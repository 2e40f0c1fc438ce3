"""`[routing]`: the protocol, and what every node does under any of them."""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.sections import (
    Count,
    Duration,
    Milliseconds,
    Section,
    SomeTime,
)
from fanet_mw.units import MS, seconds_to_ns


def _none_or_interval(hello_s: float) -> float:
    if 0 < hello_s < LEAST_HELLO_S:
        raise ValueError(f"routing.hello_interval_s = {hello_s:g} must be 0 or >= {LEAST_HELLO_S:g}")
    return hello_s


LEAST_HELLO_S: Final = 0.01
HelloInterval = Annotated[Duration, AfterValidator(_none_or_interval)]


PROTOCOLS: Final = (
    "direct", "flooding", "clustered", "aodv", "olsr", "dsdv", "gossip", "counter", "geographic",
)  # fmt: skip


class Routing(Section):
    """The protocol above the radio."""

    protocol: Annotated[str, PartName("routing.protocol", PROTOCOLS)] = "clustered"
    """How packets find their way: one hop only (`direct`), a relay by every node (`flooding`), with a probability
    (`gossip`) or by those that heard few copies (`counter`), the time-divided floods of cluster heads (`clustered`), or
    a route found on demand, by link states, by distance vectors or by positions; or as another package does it."""
    options: Annotated[dict[str, Any], OptionsOf("routing.protocol", PROTOCOLS)] = Field(default_factory=Options)
    """The table of a protocol that another package brings, as that package documents it."""
    address_resolution: Literal["none", "rfc826", "ns3"] = "none"
    """`aodv`, `olsr`, `dsdv`, `geographic`: a node asks for a neighbor's address before its first unicast to it, as IP
    does, by the rules of RFC 826 or by ns-3's. `none`: a node id is an address, and no node needs to ask."""
    jitter_ms: Milliseconds = 10.0
    """A relay waits U(0, jitter) after a reception."""
    hop_limit: Annotated[int, Field(ge=1, le=255)] = 32
    """A packet is not relayed farther than so many hops."""
    queue_frames: Count = 512
    """Bound of a node's own queue; the least important packet is evicted, with a reason."""
    lifetime_s: SomeTime = 30.0
    """A packet older than this is dropped where it waits."""
    safety_lifetime_s: Duration = 1.0
    """The same for warnings (priority 1): a position that old warns of nothing; 0: as `lifetime_s`."""
    report_lifetime_s: Duration = 0.0
    """The same for survivor reports (priority 2); 0: as `lifetime_s`."""
    aggregate: bool = False
    """`clustered`: packets that are released together share frames of up to `radio.max_frame_bytes`, and so do their
    relays. `clusters.relay = "scheduled"` decides that by the load instead."""
    hello_interval_s: HelloInterval = 1.0
    """Position beacon and hello, one hop; 0 sends none (`clustered` needs them)."""
    gossip_p: Annotated[float, Field(ge=0, le=1)] = 0.65
    """Protocol `gossip`: probability with which a node relays a flooded packet."""
    gossip_k: Annotated[int, Field(ge=0, le=255)] = 1
    """Protocol `gossip`: within so many hops of the origin everyone relays."""
    counter: Annotated[int, Field(ge=2, le=1_000_000)] = 3
    """Protocol `counter`: a node that has heard so many copies does not relay."""
    assess_ms: Milliseconds = 20.0
    """Protocol `counter`: copies are counted for U(0, assess_ms)."""

    @property
    def jitter_ns(self) -> int:
        return round(self.jitter_ms * MS)

    def lifetime_ns(self, priority: int) -> int:
        """The lifetime of a packet of this priority (`wire.PRIORITY_...`)."""
        own_s = {1: self.safety_lifetime_s, 2: self.report_lifetime_s}.get(priority, 0.0)
        return seconds_to_ns(own_s or self.lifetime_s)

"""The `[routing]` table: the protocol, and settings that all protocols share; and `[rounds]`, turns in a fixed order
that depend on nothing but the number of nodes.
"""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Count, Duration, Milliseconds, Section, SomeTime
from fanet_mw.units import MS, seconds_to_ns


def _none_or_interval(hello_s: float) -> float:
    if 0 < hello_s < LEAST_HELLO_S:
        raise ValueError(f"routing.hello_interval_s = {hello_s:g} must be 0 or >= {LEAST_HELLO_S:g}")
    return hello_s


LEAST_HELLO_S: Final = 0.01
HelloInterval = Annotated[Duration, AfterValidator(_none_or_interval)]


PROTOCOLS: Final = (
    "direct", "flooding", "rounds", "clustered", "aodv", "olsr", "dsdv", "gossip", "counter", "geographic",
)  # fmt: skip


class Routing(Section):
    """The routing protocol, and settings that all protocols share."""

    protocol: Annotated[str, PartName("routing.protocol", PROTOCOLS)] = "clustered"
    """How packets find their way: `direct` transmits them one hop only; `flooding` lets every node relay, `gossip` with
    a probability, `counter` if few copies were received; `clustered` floods from cluster heads, time-divided; `aodv`,
    `olsr`, `dsdv` and `geographic` find routes on demand, by link states, by distance vectors and by positions. A
    protocol of another package may be named, too."""
    options: Annotated[dict[str, Any], OptionsOf("routing.protocol", PROTOCOLS)] = Field(default_factory=Options)
    """The options of a protocol from another package, as that package documents them."""
    address_resolution: Literal["none", "rfc826", "ns3"] = "none"
    """`aodv`, `olsr`, `dsdv`, `geographic`: whether a node must ask for a neighbor's address before its first unicast
    to it, as with IP, by the rules of RFC 826 or of ns-3. `none`: the node id is the address."""
    jitter_ms: Milliseconds = 10.0
    """A relay waits U(0, jitter) after a reception. So do own floods of warnings, and of users' applications, because
    several nodes may see one event at one instant; `clustered` and `rounds` have times of their own for them."""
    hop_limit: Annotated[int, Field(ge=1, le=255)] = 32
    """The greatest number of hops of a packet."""
    queue_frames: Count = 512
    """The greatest number of packets in a node's queue; if it is full, the least important packet is evicted."""
    lifetime_s: SomeTime = 30.0
    """A packet that waits in a node is dropped when it is older than this."""
    safety_lifetime_s: Duration = 1.0
    """The same for warnings (priority 1), which are useless when they are old; 0: as `lifetime_s`."""
    report_lifetime_s: Duration = 0.0
    """The same for survivor reports (priority 2); 0: as `lifetime_s`."""
    aggregate: bool = False
    """`clustered`: whether packets that are released together share frames of up to `radio.max_frame_bytes`, and so do
    their relays. With `clusters.relay = "scheduled"` the load decides that instead."""
    hello_interval_s: HelloInterval = 1.0
    """Interval of hellos, which also carry the position, to all neighbors; 0 sends none (`clustered` needs them)."""
    gossip_p: Annotated[float, Field(ge=0, le=1)] = 0.65
    """`gossip`: probability with which a node relays a flooded packet."""
    gossip_k: Annotated[int, Field(ge=0, le=255)] = 1
    """`gossip`: within this number of hops from the origin every node relays."""
    counter: Annotated[int, Field(ge=2, le=1_000_000)] = 3
    """`counter`: a node that has received this many copies does not relay."""
    assess_ms: Milliseconds = 20.0
    """`counter`: copies are counted for U(0, assess_ms)."""

    @property
    def said(self) -> str:
        """The protocol as errors name it."""
        return f"routing.protocol = {self.protocol!r}"

    @property
    def jitter_ns(self) -> int:
        return round(self.jitter_ms * MS)

    def lifetime_ns(self, priority: int) -> int:
        """The lifetime of a packet of this priority (`wire.PRIORITY_...`)."""
        own_s = {1: self.safety_lifetime_s, 2: self.report_lifetime_s}.get(priority, 0.0)
        return seconds_to_ns(own_s or self.lifetime_s)

    def lifetimes_ns(self) -> list[int]:
        """The lifetime of a packet by its priority; the air may state any of 256."""
        return [self.lifetime_ns(priority) for priority in range(256)]


class Rounds(Section):
    """`routing.protocol = "rounds"`: every node has one turn in each round, whatever moves; bulk uses the rest."""

    turn_bytes: Annotated[int, Field(ge=100, le=16_384)] = 600
    """The size of frame that a turn holds."""
    turn_slack_us: Annotated[float, Field(ge=0, le=1e6)] = 50.0
    """By how much a turn is longer than its frame. A bound is stated while it holds twice the bound of a clock's error,
    and some 20 us for propagation and detection."""
    bulk_share: Annotated[float, Field(ge=0, le=0.95)] = 0.7
    """Share of a round whose slots are for bulk (0 to 0.95); 0: bulk goes in turns, too."""
    least_period_ms: Milliseconds = 0.0
    """The shortest round; 0: as short as the turns and `bulk_share` allow."""
    repeats: Annotated[int, Field(ge=0, le=64)] = 16
    """How often a node sends a packet again that a neighbor is not known to have, while it is not older than its
    lifetime."""
    burst_bytes: Annotated[int, Field(ge=0, le=1_000_000)] = 4096
    """The bytes of urgent packets that may be under way at the same time under a stated bound; while a node hears of
    more it states none."""
    repair_s: Annotated[float, Field(ge=0, le=1e6)] = 10.0
    """Neighbors send packets again that a node lacks, as its hellos show, if they are newer than this; 0: no repair."""

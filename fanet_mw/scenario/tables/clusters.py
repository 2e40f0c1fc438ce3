"""The `[clusters]` table: how the clustered protocol forms clusters, schedules and relays."""

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Duration, Length, Milliseconds, Section
from fanet_mw.units import seconds_to_ns

METHODS: Final = ("balanced",)


class Clusters(Section):
    """The clustered protocol of the paper and its variants: clusters, each with one slot per flooding period."""

    count: Annotated[int, Field(ge=1, le=1024)] = 4
    """Number of clusters, and so of slots in a flooding period."""
    flooding_period_s: Annotated[float, Field(ge=0.01, le=4000)] = 5.0
    """The period in which each head floods once, in its slot."""
    guard_ms: Milliseconds | Literal["auto"] = 2.0
    """The silent end of each slot; `auto`: as long as the greatest clock error in the swarm, the radio range and the
    largest frame require."""
    release_gap_ms: Milliseconds = 2.0
    """The shortest time between two packets that a head releases in its slot."""
    pacing: Literal["burst", "spread"] = "spread"
    """`burst` releases at `release_gap_ms`; `spread` divides the slot evenly among the queued packets."""
    relay: Literal["all", "counter", "scheduled"] = "all"
    """Which nodes relay a flooded packet. `all`: all nodes; `counter`: each that has received fewer than `counter`
    copies after U(0, assess_ms); `scheduled`: the nodes that a collision-free timetable names, each in a turn of its
    own."""
    contention_ms: Milliseconds = 40.0
    """`scheduled`: length of the contention window at the beginning of each period, for hellos, joins,
    unicasts and all else that has no turn."""
    turn_slack_us: Annotated[float, Field(ge=0, le=1e6)] = 50.0
    """`scheduled`: by how much a turn is longer than its frame. It must hold twice the bound of a clock's
    error, and some 20 us for propagation and detection."""
    links: Literal["auto", "places", "measured"] = "auto"
    """`scheduled`: the links for which the timetable is made. `places`: all pairs within `link_m`; `measured`: as
    hellos have shown, with frames repeated according to their loss; `auto`: `measured` with shadowing or fading, else
    `places`."""
    load: Literal["scenario", "heard"] = "scenario"
    """`scheduled`: the load for which each node gets turns: what `[traffic]` says (`scenario`), or what the leader
    hears of the node's packets (`heard`), with a new timetable when nodes send more, or much less."""
    link_m: Length = 0.0
    """`scheduled`: the greatest distance at which nodes are taken to receive each other; 0: `radio.range_m`."""
    interference_m: Length = 0.0
    """`scheduled`: the greatest distance at which nodes may disturb each other; 0: twice `radio.range_m`, but with
    `radio.channel = "range"` only that and what errors of GPS may add."""
    counter: Annotated[int, Field(ge=2, le=1_000_000)] = 3
    """`counter`: a node that has received this many copies does not relay."""
    assess_ms: Milliseconds = 100.0
    """`counter`: copies are counted for U(0, assess_ms)."""
    method: Annotated[str, PartName("clusters.method", METHODS)] = "balanced"
    """How the leader divides the swarm into clusters: equal parts that hold together, or a method of another
    package."""
    options: Annotated[dict[str, Any], OptionsOf("clusters.method", METHODS)] = Field(default_factory=Options)
    """The options of a method from another package, as that package documents them."""
    reassign_s: Duration = 10.0
    """The shortest time between two divisions of a swarm that has moved; 0: clusters change only
    when nodes come or go."""
    repair_s: Duration | Literal["auto"] = "auto"
    """Neighbors send packets again that a node lacks, as its hellos show, if they are newer than this; 0: no repair;
    `auto`: 10 s with relays `counter` or with measured links, else no repair."""
    resume: bool = True
    """`scheduled`: whether floods that ended early because a frame was lost go on in later superframes, when nodes miss
    the packet; it then comes later than its bound. Without effect where packets are repaired all the time."""

    @property
    def period_ns(self) -> int:
        return seconds_to_ns(self.flooding_period_s)

    @property
    def slot_ns(self) -> int:
        """Length of one slot, guard included."""
        return self.period_ns // self.count

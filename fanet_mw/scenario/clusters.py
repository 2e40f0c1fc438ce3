"""`[clusters]`: how the clustered protocol divides, schedules and relays."""

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.sections import (
    Duration,
    Length,
    Milliseconds,
    Section,
)
from fanet_mw.units import seconds_to_ns

METHODS: Final = ("balanced", "lowest_id", "highest_degree", "wca", "lasting_degree", "affinity")


class Clusters(Section):
    """The paper's protocol: k clusters, one slot each per flooding period."""

    count: Annotated[int, Field(ge=1, le=1024)] = 4
    """Number of clusters, and so of slots in a flooding period."""
    flooding_period_s: Annotated[float, Field(ge=0.01, le=4000)] = 5.0
    """Each head floods once in such a period, in its slot."""
    guard_ms: Milliseconds | Literal["auto"] = 2.0
    """The silent end of a slot; `auto`: as long as the greatest clock error in the swarm, the range and the largest
    frame ask for."""
    release_gap_ms: Milliseconds = 2.0
    """The least time between two packets that a head releases in its slot."""
    pacing: Literal["burst", "spread"] = "spread"
    """`burst` releases at `release_gap_ms`; `spread` divides the slot evenly among the queued packets."""
    relay: Literal["all", "gossip", "counter", "heads", "cds", "mpr", "scheduled", "claimed"] = "all"
    """Relays of a flooded packet: all nodes; each with probability min(1, gossip_degree / neighbors); each that has
    heard fewer than `counter` copies after U(0, assess_ms); heads and what connects them; a connected dominating set;
    multipoint relays; those that a collision-free timetable names, each in a turn of its own; or a connected
    dominating set in slots that nodes agree on over the air."""
    contention_ms: Milliseconds = 40.0
    """`scheduled`, `claimed`: the beginning of each period, for all that has no turn: hellos, joins, unicasts."""
    turn_slack_us: Annotated[float, Field(ge=0, le=1e6)] = 50.0
    """`scheduled`, `claimed`: what a turn is longer than its frame: twice the bound of a clock's error, and some 20 us
    for flight and detection."""
    slots: Annotated[int, Field(ge=0, le=254)] = 0
    """`claimed`: slots of a superframe; 0: as many as the neighborhood needs, a power of two."""
    links: Literal["auto", "places", "measured"] = "auto"
    """`scheduled`: what the timetable takes for a link: every pair within `link_m` (`places`), or what hellos have
    shown (`measured`), with frames repeated according to the loss; `auto`: `measured` with shadowing or fading, else
    `places`."""
    load: Literal["scenario", "heard"] = "scenario"
    """`scheduled`: the load for which each node gets turns: what `[traffic]` says (`scenario`), or what the leader
    hears of the node's packets (`heard`), with a new timetable when nodes send more, or much less."""
    link_m: Length = 0.0
    """`scheduled`: nodes no farther apart are taken to hear each other; 0: `radio.range_m`."""
    interference_m: Length = 0.0
    """`scheduled`: nodes no farther apart may disturb each other; 0: `radio.range_m` for `range`, else twice that."""
    gossip_degree: Annotated[float, Field(gt=0, le=1e6)] = 6.0
    """`gossip`: how many neighbors of a node relay on average."""
    counter: Annotated[int, Field(ge=2, le=1_000_000)] = 3
    """`counter`: a node that has heard so many copies does not relay."""
    assess_ms: Milliseconds = 100.0
    """`counter`: copies are counted for U(0, assess_ms)."""
    method: Annotated[str, PartName("clusters.method", METHODS)] = "balanced"
    """How the leader divides the swarm. All but `balanced` make as many clusters as the topology asks for, whatever
    `count` says: every member hears its head."""
    options: Annotated[dict[str, Any], OptionsOf("clusters.method", METHODS)] = Field(default_factory=Options)
    """The table of a method that another package brings, as that package documents it."""
    reassign_s: Duration = 10.0
    """The leader makes new clusters for a swarm that has moved at most this often; 0: only when nodes come or go."""
    repair_s: Duration = 0.0
    """Hellos say what a node holds; neighbors send again what it lacks and is younger than this; 0: no repair, but 10 s
    with measured links."""

    @property
    def period_ns(self) -> int:
        return seconds_to_ns(self.flooding_period_s)

    @property
    def slot_ns(self) -> int:
        """Length of one slot, guard included."""
        return self.period_ns // self.count

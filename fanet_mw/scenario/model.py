"""The scenario: one frozen model of everything a run depends on. Keys are people's units, with the unit in the key.

A key is a contract with users: renaming one breaks their files and sweeps. Derived values are properties, in `int` ns.
Each table checks itself; what the tables ask of each other is in `checks.py`.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from fanet_mw.bus.radio_control import Control
from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.applications import ForeignApplication
from fanet_mw.scenario.checks import disagreements
from fanet_mw.scenario.clock import Clock
from fanet_mw.scenario.faults import AnyFault
from fanet_mw.scenario.radio import Radio
from fanet_mw.scenario.sections import (
    MOST_S,
    Coordinate,
    Count,
    Duration,
    Id,
    Interval,
    Length,
    Level,
    Milliseconds,
    Rate,
    Section,
    SomeLength,
    SomeTime,
    Speed,
)
from fanet_mw.scenario.sensors import Sensors
from fanet_mw.units import MAX_NODES, MS, NodeId, seconds_to_ns

_REPAIR_S: Final = 10.0
"""The time for which packets are repaired that floods over measured links leave out."""


def _none_or_interval(hello_s: float) -> float:
    if 0 < hello_s < LEAST_HELLO_S:
        raise ValueError(f"routing.hello_interval_s = {hello_s:g} must be 0 or >= {LEAST_HELLO_S:g}")
    return hello_s


LEAST_HELLO_S: Final = 0.01
HelloInterval = Annotated[Duration, AfterValidator(_none_or_interval)]


PROTOCOLS: Final = (
    "direct", "flooding", "clustered", "aodv", "olsr", "dsdv", "gossip", "counter", "geographic",
)  # fmt: skip
METHODS: Final = ("balanced", "lowest_id", "highest_degree", "wca", "lasting_degree", "affinity")
MOBILITY_MODELS: Final = ("static", "formation", "random_waypoint", "crossing", "onboard")


class Nodes(Section):
    """How many nodes there are and where they start. Node ids run from 1; node 1 is the leader."""

    count: Annotated[int, Field(ge=1, le=MAX_NODES)] = 45
    """Number of nodes; their ids are 1 to `count`."""
    layout: Literal["grid", "disc", "line", "explicit"] = "grid"
    """Where the nodes start: in a `grid`, at random places in a `disc`, in a `line`, or as `positions_m` says."""
    spacing_m: SomeLength = 200.0
    """`grid` and `line`: distance from one node to the next."""
    radius_m: SomeLength = 100.0
    """`disc`: its radius."""
    columns: Count | None = None
    """Grid columns; by default the widest near-square factorisation in the manner of 9 x 5."""
    leader_at: Literal["first", "middle"] = "first"
    """Layouts `grid` and `line`: node 1, the leader, stands at the first place, or at the one nearest to the middle;
    the others take the remaining places in order."""
    altitude_m: Length = 50.0
    """Height at which the nodes start and fly; every layout but `explicit` uses it."""
    on_ground: bool = False
    """UAVs stand on the ground at the start and take off when told to; else they start at `altitude_m`."""
    telemetry_hz: Rate = 1.0
    """Native MAVLink telemetry of each node on its tap; 0 sends none."""
    positions_m: tuple[tuple[Coordinate, Coordinate, Coordinate], ...] = ()
    """Layout `explicit`: one [east, north, up] per node."""

    @model_validator(mode="after")
    def _explicit_has_positions(self) -> Self:
        if self.layout == "explicit" and len(self.positions_m) != self.count:
            raise ValueError(
                f"nodes.positions_m has {len(self.positions_m)} entries; "
                f'layout = "explicit" needs nodes.count = {self.count}'
            )
        return self


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


class Mobility(Section):
    """What a UAV does when the mission asks nothing of it."""

    model: Annotated[str, PartName("mobility.model", MOBILITY_MODELS)] = "static"
    """`formation` sweeps the area keeping the layout; `random_waypoint` is the statistical model, without pause;
    `crossing` flies each UAV through the middle of the area to the point opposite its start, and back.
    `onboard`: the world decides nothing, keeps no UAV clear of others, and flies what each UAV's computer asks for."""
    options: Annotated[dict[str, Any], OptionsOf("mobility.model", MOBILITY_MODELS)] = Field(default_factory=Options)
    """The table of a model that another package brings, as that package documents it."""
    speed_m_s: Speed = 7.5
    """Cruising speed."""
    see_m: Length = 50.0
    """UAVs nearer than this see each other without radio and keep clear; 0: they are blind."""


WindSpeed = Annotated[float, Field(ge=-50, le=50)]
Building = tuple[Coordinate, Coordinate, SomeLength, SomeLength, SomeLength]


class World(Section):
    """The engine that moves the bodies, and the area they move in."""

    engine: Literal["pybullet", "kinematic", "rotors"] = "kinematic"
    """What moves the bodies: rigid-body physics with collisions (`pybullet`, an extra of the package), point masses of
    limited acceleration (`kinematic`), or multirotors with their rotors, motors, control loops and wind (`rotors`)."""
    vehicle: Literal["iris", "crazyflie"] = "iris"
    """The vehicle whose battery is drained, and which `rotors` flies: a 3DR Iris of 1.5 kg, or a Crazyflie of 30 g."""
    charge: tuple[Annotated[float, Field(gt=0, le=1)], Annotated[float, Field(gt=0, le=1)]] = (1.0, 1.0)
    """Least and greatest share of its capacity that a battery holds at the start; which is drawn by the seed."""
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """`rotors`: where the mean wind blows to, east and north."""
    gusts_m_s: Annotated[float, Field(ge=0, le=50)] = 0.0
    """`rotors`: the wind 6 m above the ground that makes the gusts (Dryden): they have a tenth of it upwards."""
    area_m: SomeLength = 2500.0
    """Side of the square area, centred at the origin."""
    tick_ms: Annotated[float, Field(ge=1, le=10_000)] = 100.0
    """Period at which poses are published."""
    base_m: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    """East and north of the base: the middle of the layout in which the swarm starts."""
    crash: Literal["none", "falls"] = "none"
    """What a contact does to a vehicle: nothing but being counted, or it falls to the ground and stays there."""
    crash_radio: Literal["survives", "dies"] = "dies"
    """Whether the radio of a crashed vehicle goes on."""
    physics_hz: Annotated[int, Field(ge=10, le=2000)] = 240
    """`pybullet`: steps of the physics per second."""
    buildings: Annotated[int, Field(ge=0, le=10_000)] | tuple[Building, ...] = 0
    """A number of boxes at seeded places, or each as [east, north, width, depth, height] in metres: its middle, its
    extent to the east and to the north, and its roof above the ground. UAVs collide with them, radio is obstructed."""
    building_size_m: tuple[SomeLength, SomeLength] = (15.0, 40.0)
    """Least and greatest width and depth of a seeded building."""
    building_height_m: tuple[SomeLength, SomeLength] = (8.0, 30.0)
    """Least and greatest height of a seeded building."""
    terrain_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Height of the highest hill above the plain at 0; 0: no hills."""
    terrain_scale_m: Annotated[float, Field(ge=1, le=1e6)] = 400.0
    """Distance from hill to hill."""
    heightmap: str = ""
    """File with the heights of the ground, in place of seeded hills: an ASCII grid (.asc), or a grayscale picture
    (.png). Its middle is the origin, its lowest point is at 0. A path is taken from the scenario file's folder."""
    heightmap_white_m: Annotated[float, Field(gt=0, le=9000)] = 100.0
    """Height of a white pixel above a black one."""
    heightmap_pixel_m: Annotated[float, Field(gt=0, le=1e5)] = 10.0
    """Width of a pixel."""
    buildings_geojson: str = ""
    """File with the outlines of buildings (GeoJSON), in place of `buildings`. A path is taken from the scenario file's
    folder."""
    origin_deg: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None = None
    """Latitude and longitude that become the origin; unset: the middle of the buildings of the file."""
    no_fly_m: tuple[tuple[Coordinate, Coordinate, SomeLength], ...] = ()
    """Areas that no UAV may enter, each as [east, north, radius]; the world counts entries."""
    gps_hz: Annotated[float, Field(ge=1e-6, le=1000)] = 5.0
    """Position fixes of each UAV per second."""
    gps_sigma_m: Annotated[float, Field(ge=0, le=1000)] = 1.5
    """Standard deviation of a fix along each axis."""

    @model_validator(mode="after")
    def _obstacles_agree(self) -> Self:
        if self.buildings_geojson and self.buildings:
            raise ValueError("world.buildings and world.buildings_geojson exclude each other")
        if self.heightmap and self.terrain_m:
            raise ValueError("world.terrain_m and world.heightmap exclude each other")
        if self.engine != "rotors" and (any(self.wind_m_s) or self.gusts_m_s):
            raise ValueError(f'world.wind_m_s and world.gusts_m_s need world.engine = "rotors", not "{self.engine}"')
        for key in ("building_size_m", "building_height_m", "charge"):
            least, greatest = getattr(self, key)
            if least > greatest:
                raise ValueError(f"world.{key} = [{least:g}, {greatest:g}] must be [least, greatest]")
        return self

    @property
    def has_obstacles(self) -> bool:
        """True if anything but a plain can stand between two nodes."""
        return bool(self.buildings or self.buildings_geojson or self.heightmap) or self.terrain_m > 0

    @property
    def tick_ns(self) -> int:
        return round(self.tick_ms * MS)


LEAST_REPORT_BYTES: Final = 96
"""A report of 79 bytes, and the shortest filler."""
ApproachSpeed = Annotated[float, Field(ge=1e-3, le=1000)]


class Mission(Section):
    """Search and rescue: survivors, the sensor that finds their phones, and the rule that moves the UAVs."""

    survivors: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Number of survivors, at seeded places of the area."""
    survivor_positions_m: tuple[tuple[Coordinate, Coordinate], ...] = ()
    """East and north of each survivor; empty: seeded places."""
    survivors_in: Literal["area", "buildings"] = "area"
    """Where seeded places are: anywhere in the open area, or within its buildings."""
    buried: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the survivors that lie under rubble (`sensors.burial_phone_db`, `sensors.burial_voice_db`)."""
    reports_to_approach: Count = 3
    """A UAV approaches when this many different nodes have reported the same survivor (paper, 4.1)."""
    search: Literal["none", "lines", "spiral", "sectors"] = "none"
    """UAVs search by a plan that one of them makes and hands out over the air; of those that find, `responders` go.
    `lines`: two lines abreast part from the middle of the area, with a chain between them. `spiral`: arms abreast turn
    about the middle, or a single one winds outward; any number of UAVs will do. `sectors`: a team abreast for each of
    `clusters.count` sectors, not held together. `none`: the paper's rule, by which every UAV goes that has heard enough
    reports."""
    formation: Literal["none", "clusters"] = "none"
    """`clusters`: the members of each cluster fly on a circle around their head, evenly apart, other heads on one
    around the leader, and the leader, the head with the lowest id, flies `route_m` once `warmup_s` is over; each UAV
    decides by received positions alone. Needs `mobility.model = "onboard"`, `search = "none"`, at most 7 clusters."""
    formation_m: Annotated[float, Field(ge=20, le=10_000)] = 200.0
    """`formation`: the radius of the circle around a head; heads fly 2.2 times as far from the leader."""
    route_m: tuple[tuple[Coordinate, Coordinate], ...] = ()
    """`formation`: east and north of the points through which the leader flies at `mobility.speed_m_s`; empty: it
    stays where it is."""
    coverage_map: bool = False
    """`search`: whether UAVs tell their neighbors every 4 s which cells of the area have been searched, so that those
    who are free search at once what a lost UAV, or one that responds, has left out; 143 B more in such a hello."""
    avoid_by: tuple[Literal["hellos", "radar"], ...] = ("hellos", "radar")
    """`search`: what UAVs keep clear of others by: the positions in the hellos of others, their own radar."""
    reserve_charge: Annotated[float, Field(ge=0, le=1)] = 0.15
    """`search`: a UAV that would come home with less of its battery than this flies home, lands, and hands place and
    task on; needs `sensors.battery_hz`."""
    responders: Annotated[int, Field(ge=1, le=1000)] = 3
    """`search`: as many UAVs go to a survivor, chosen by auction; the others search on."""
    report_interval_s: Interval = 5.0
    """How often a UAV repeats its report of a survivor it still hears."""
    report_bytes: Annotated[int, Field(ge=0, le=2304)] = 0
    """UDP payload of a report on the air, the routing header included; 0: no more than it needs, which is 79 bytes."""
    report_priority: Literal["safety", "report", "bulk"] = "report"
    """Which reports go first where several packets wait, and after which time they expire (`routing`)."""
    scan_interval_s: Interval = 1.0
    """How often the Wi-Fi sensor of a UAV looks for phones."""
    phone_power_dbm: Level = 15.0
    """Transmit power of a survivor's phone."""
    phone_exponent: Annotated[float, Field(ge=0.1, le=10)] = 3.0
    """Path loss exponent from a phone to the sensor."""
    detection_dbm: Level = -90.0
    """The sensor hears a phone at this level or above."""
    shadowing_db: Annotated[float, Field(ge=0, le=30)] = 4.0
    """Standard deviation of the shadowing of a phone's signal."""
    approach_speed_m_s: ApproachSpeed | tuple[ApproachSpeed, ApproachSpeed] = 10.0
    """Speed at which a UAV approaches a survivor; as [least, greatest], each UAV has a speed of its own, drawn by the
    seed."""
    arrival_m: SomeLength = 30.0
    """A UAV that is this near to a survivor has arrived."""
    dwell_s: Duration = 10.0
    """How long a UAV stays with a survivor before it turns to the next one it knows of."""
    collision_distance_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """UAVs nearer to each other have lost separation, which the world counts; 0: it is not looked for."""
    collision_horizon_s: Annotated[float, Field(ge=0, le=120)] = 0.0
    """A UAV that foresees a loss of separation within this time warns the other one, and both avoid; 0: no warnings."""
    collision_repeat_s: Annotated[float, Field(gt=0, le=120)] = 1.0
    """A warning is repeated at this interval until the closest point of approach."""

    @property
    def approach_speeds_m_s(self) -> tuple[float, float]:
        """Least and greatest."""
        given = self.approach_speed_m_s
        return given if isinstance(given, tuple) else (given, given)

    @model_validator(mode="after")
    def _report_fits_its_content(self) -> Self:
        least, most = self.approach_speeds_m_s
        if least > most:
            raise ValueError(f"mission.approach_speed_m_s = [{least:g}, {most:g}] must be [least, greatest]")
        if 0 < self.report_bytes < LEAST_REPORT_BYTES:
            raise ValueError(f"mission.report_bytes = {self.report_bytes} must be 0 or >= {LEAST_REPORT_BYTES}")
        return self

    @model_validator(mode="after")
    def _survivors_have_positions(self) -> Self:
        if self.survivor_positions_m and len(self.survivor_positions_m) != self.survivors:
            raise ValueError(
                f"mission.survivor_positions_m has {len(self.survivor_positions_m)} entries; "
                f"it must have mission.survivors = {self.survivors}"
            )
        return self


class Scenario(Section):
    """One file; one execution of it with one seed is a run."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")] = "unnamed"
    """Name of the scenario, and of its swarm on the bus; by default the file's name."""
    description: str = ""
    """One sentence for `fanet scenarios`."""
    duration_s: SomeTime = 100.0
    """Length of a run in swarm time."""
    warmup_s: Duration = 0.0
    """Application traffic begins here; nothing before it is measured."""
    drain_s: Duration = 0.0
    """Application traffic ends this long before the end, so that what is under way can arrive."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """Seed of every random stream: the same scenario and seed give the same trace, byte by byte."""
    time_scale: Annotated[float, Field(ge=1e-3, le=100)] = 1.0
    """Real time only: swarm seconds per wall second."""
    nodes: Nodes = Nodes()
    traffic: Traffic = Traffic()
    routing: Routing = Routing()
    clusters: Clusters = Clusters()
    radio: Radio = Radio()
    mobility: Mobility = Mobility()
    clock: Clock = Clock()
    world: World = World()
    mission: Mission = Mission()
    sensors: Sensors = Sensors()
    applications: tuple[ForeignApplication, ...] = ()
    """They run in the order in which they stand, after those of fanet-mw."""
    faults: tuple[AnyFault, ...] = ()
    """What happens to the air, and when; by message too (`fanet air`)."""
    further_traffic: tuple[Traffic, ...] = ()
    """Classes of traffic beside the first one: in a file, the second and every later `[[traffic]]`."""

    @model_validator(mode="before")
    @classmethod
    def _several_classes(cls, tree: object) -> object:
        """`[[traffic]]`: the first is the traffic, the others go with it."""
        if not isinstance(tree, Mapping) or not isinstance(tree.get("traffic"), list | tuple):
            return tree
        first, *others = tree["traffic"] or [{"arrivals": "none"}]
        return {**tree, "traffic": first, "further_traffic": [*others, *tree.get("further_traffic", ())]}

    @model_serializer(mode="wrap")
    def _as_in_a_file(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """All classes of traffic as one array, if there are several."""
        tree: dict[str, Any] = write(self)
        others = tree.pop("further_traffic", ())
        if others:
            tree["traffic"] = [tree.get("traffic", {}), *others]
        return tree

    @property
    def traffic_classes(self) -> Mapping[str, Traffic]:
        """All classes of traffic by their names, in the order of the file."""
        return {
            traffic.name or ("traffic" if index == 1 else f"traffic_{index}"): traffic
            for index, traffic in enumerate((self.traffic, *self.further_traffic), start=1)
        }

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        problems = list(disagreements(self))
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def measures_links(self) -> bool:
        """True if timetables are made from measured links (`clusters.links`)."""
        chosen, lossy = self.clusters.links, self.radio.shadowing_db > 0 or self.radio.fading != "none"
        wanted = chosen == "measured" or (chosen == "auto" and lossy)
        return wanted and self.clusters.relay == "scheduled" and self.routing.hello_interval_s > 0

    @property
    def repair_ns(self) -> int:
        """For how long packets are repaired; with measured links always, because frames do get lost."""
        return seconds_to_ns(self.clusters.repair_s or (_REPAIR_S if self.measures_links else 0.0))

    @property
    def saturated(self) -> bool:
        """True if a class of traffic always has one more packet to send."""
        return any(traffic.arrivals == "saturated" for traffic in self.traffic_classes.values())

    @property
    def mac_lifetime_ns(self) -> int:
        """The time for which a frame may wait in the MAC queue (`radio.lifetime_ms`)."""
        unset_ms = _FOREVER_MS if self.saturated else _LIFETIME_MS
        return round((self.radio.lifetime_ms or unset_ms) * MS)

    @property
    def duration_ns(self) -> int:
        return seconds_to_ns(self.duration_s)

    @property
    def traffic_window_ns(self) -> tuple[int, int]:
        """Application packets are generated, and measured, in [start, end)."""
        return seconds_to_ns(self.warmup_s), seconds_to_ns(self.duration_s - self.drain_s)

    @property
    def planned_faults(self) -> list[tuple[int, Control]]:
        """(instant ns, what happens), in the order of the file."""
        return [(seconds_to_ns(fault.at_s), fault.control()) for fault in self.faults]

    @property
    def node_ids(self) -> range:
        return range(1, self.nodes.count + 1)

    @property
    def leader(self) -> NodeId:
        return NodeId(1)


_LIFETIME_MS: Final = 500.0
_FOREVER_MS: Final = 1e6


def grid_columns(count: int) -> int:
    """Columns of the default grid: the factorisation nearest to 9:5, else the square root rounded up."""
    wanted = math.sqrt(count * 9 / 5)
    divisors = [d for d in range(1, count + 1) if count % d == 0 and d * d >= count]
    best = min(divisors, key=lambda d: abs(d - wanted))
    return best if best <= 2 * wanted else math.ceil(wanted)


__all__ = [
    "Clock", "Clusters", "Mission", "Mobility", "Nodes", "Radio", "Routing", "Scenario", "Section", "Sensors",
    "Traffic", "World", "grid_columns",
]  # fmt: skip

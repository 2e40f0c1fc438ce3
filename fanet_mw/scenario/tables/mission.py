"""The `[mission]` table: search and rescue, formation flight, and collision warnings."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, field_validator, model_validator

from fanet_mw.scenario.tables.sections import (
    Coordinate,
    Count,
    Duration,
    Interval,
    Level,
    Section,
    SomeLength,
    read_with_file,
)

LEAST_REPORT_BYTES: Final = 96
"""The least length of a report: 79 bytes, and the shortest filler."""
_LONGEST_APART_S: Final = 3600
ApproachSpeed = Annotated[float, Field(ge=1e-3, le=1000)]


class Mission(Section):
    """Search and rescue: the survivors, the receiver that detects their phones, and the rule by
    which UAVs fly to them.
    """

    survivors: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Number of survivors, at random places drawn by the seed."""
    survivor_positions_m: tuple[tuple[Coordinate, Coordinate], ...] = ()
    """East and north of each survivor; empty: random places."""
    survivors_at: Annotated[str, read_with_file("mission.survivors_at")] = ""
    """A file with a point for each survivor (.kml, .kmz, .geojson, .plan, .waypoints), read with the scenario; its path
    is relative to the scenario file's folder."""
    area: Annotated[str, read_with_file("mission.area")] = ""
    """A file with the area to search (.plan, .kml, .kmz, .geojson, .waypoints), read with the scenario:
    `world.origin_deg` is the middle of its polygons and `world.area_m` the least square around them, unless those keys
    are there and all polygons lie within."""
    survivors_in: Literal["area", "buildings"] = "area"
    """Where the random places are: anywhere in the open area, or inside buildings."""
    buried: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of the survivors who lie under rubble (`sensors.burial_phone_db`, `sensors.burial_voice_db`)."""
    rubble_db: Annotated[float, Field(ge=0, le=100)] = 0.0
    """`search`: the loss through rubble that the plan allows for. Lanes lie so near to each other that a phone which is
    weaker by this is received between them, and its power is taken to be anywhere in between. Needs a low
    `nodes.altitude_m`: with 20 dB, a phone is received within 31 m."""
    reports_to_approach: Count = 3
    """A UAV approaches a survivor when this many different nodes have reported that survivor (paper, 4.1)."""
    search: Literal["none", "lines", "ring", "spiral", "sectors", "circuit", "fan", "fastest"] = "none"
    """`none`: the paper's rule, by which every UAV that has received enough reports flies there. Otherwise UAVs search
    by a plan that one of them makes and floods, and `responders` of them fly to each survivor. `lines`: two lines
    abreast part from the middle of the area, with a chain between them; with UAVs enough more of them, in step, each
    over its strip, with few of them one line. `ring`: all UAVs on a square that grows from the middle to the edges, so
    that the loss of one separates nobody; lines if they are too few for that. `fan`: all UAVs on a front that spreads
    from `world.base_m`, which is beside the area, to its far sides; lines if they are too few for these, or the base is
    not beside it. `spiral`: arms abreast turn about the
    middle, or a single one winds outward; any number of UAVs is enough. `sectors`: a team abreast for each of
    `clusters.count` sectors, which may lose contact with each other. `circuit`: all UAVs at equal distances on one
    closed way over the area, which n of them have searched when each has flown the n-th part, out of each other's reach
    or not. `fastest`: that of these shapes, with any number of sectors, which sweeps the area in the shortest time with
    this number of UAVs, whether or not they stay connected."""
    formation: Literal["none", "clusters"] = "none"
    """`clusters`: formation flight by clusters. The members of each cluster fly on a circle around their head, the
    other heads on a circle around the leader, and the leader, which is the head with the lowest id, flies `route_m`
    once `warmup_s` is over. Each UAV decides by received positions alone. Needs `mobility.model = "onboard"`, `search =
    "none"`, at most 7 clusters."""
    formation_m: Annotated[float, Field(ge=20, le=10_000)] = 200.0
    """`formation`: the radius of the circle around a head; heads fly 2.2 times as far from the leader."""
    route_m: tuple[tuple[Coordinate, Coordinate], ...] = ()
    """`formation`: east and north of the waypoints through which the leader flies at `mobility.speed_m_s`, within the
    geofence, 50 m outside the area; empty: it stays where it is."""
    reserve_charge: Annotated[float, Field(ge=0, le=1)] = 0.15
    """`search`: the share of its battery with which a UAV must come home. If it would come home with less, it flies
    home and lands, and others take over its place and task; needs `sensors.battery_hz`."""
    lost_link_s: Duration = 0.0
    """`search`: a UAV that has received no hello and no message of the search for this long flies home and lands; if it
    hears somebody again before it lands, it takes part again. 0: it searches on, however long it hears nobody. Needs
    hellos."""
    ceiling_m: Annotated[float, Field(ge=5, le=1000)] = 120.0
    """`search`: the height above ground beyond which no UAV flies: what open-category rules of the EU allow (the USA:
    400 ft). Followers, UAVs that fly home, and those that nobody hears fly above `nodes.altitude_m`, within it."""
    sweeps: Annotated[int, Field(ge=0, le=1000)] = 0
    """`search`: after the area was swept this often, UAVs fly home and land as soon as no survivor is sought any more,
    at the latest after one more sweep. 0: they search until their batteries take them home."""
    responders: Annotated[int, Field(ge=1, le=1000)] = 3
    """`search`: the number of UAVs that fly to each survivor, chosen by auction; the others go on searching."""
    connection: Literal["always", "none"] | Annotated[float, Field(gt=0, le=_LONGEST_APART_S)] = "always"
    """`search`: how far UAVs may go from the others for a survivor. `always`: never out of their reach. A number: so
    far that they are within reach again, and tell what they have found, so many seconds after they have left the
    survivor. `none`: as far as they like. Who has no survivor to go to stays in reach."""
    report_interval_s: Interval = 5.0
    """The interval at which a UAV repeats its report of a survivor whose phone it still receives."""
    report_bytes: Annotated[int, Field(ge=0, le=2304)] = 0
    """UDP payload of a report on the air, including the routing header; 0: as short as possible, which is 79 bytes."""
    scan_interval_s: Interval = 1.0
    """The interval at which the Wi-Fi receiver of a UAV scans for phones."""
    phone_power_dbm: Level = 15.0
    """Transmit power of a survivor's phone."""
    phone_exponent: Annotated[float, Field(ge=0.1, le=10)] = 3.0
    """Path loss exponent from a phone to the receiver."""
    detection_dbm: Level = -90.0
    """The weakest phone signal that the receiver detects."""
    shadowing_db: Annotated[float, Field(ge=0, le=30)] = 4.0
    """Standard deviation of the shadowing of a phone's signal, which is correlated over `radio.shadowing_corr_m`."""
    phone_rice_db: Annotated[float, Field(ge=-100, le=100)] = 10.0
    """Rician K of the fading of a phone's signal: the power of the direct path over that of all others; it is new for
    each scan."""
    rssi_sigma_db: Annotated[float, Field(ge=0, le=30)] = 1.5
    """Standard deviation of the noise of a phone's measured power, which is told in steps of 1 dB."""
    approach_speed_m_s: ApproachSpeed | tuple[ApproachSpeed, ApproachSpeed] = 10.0
    """Speed at which a UAV approaches a survivor. With [least, greatest] each UAV has a speed of its own, drawn by the
    seed."""
    arrival_m: SomeLength = 30.0
    """A UAV this near to a survivor has arrived."""
    dwell_s: Duration = 10.0
    """How long a UAV stays with a survivor before it flies to the next one it knows."""
    collision_distance_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """UAVs nearer to each other than this have lost separation, which the world counts; 0:
    separation is not watched."""
    collision_horizon_s: Annotated[float, Field(ge=0, le=120)] = 0.0
    """A UAV that foresees a loss of separation within this time warns the other UAV, and both avoid each other; 0: no
    warnings."""
    collision_repeat_s: Annotated[float, Field(gt=0, le=120)] = 1.0
    """The interval at which a warning is repeated until the closest point of approach."""

    @field_validator("connection", mode="before")
    @classmethod
    def _connection_is_known(cls, value: object) -> object:
        seconds = isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= _LONGEST_APART_S
        if value in ("always", "none") or seconds:
            return value
        raise ValueError(
            f"mission.connection = {value!r} must be always, none, or a number of seconds in (0, {_LONGEST_APART_S}]"
        )

    @property
    def approach_speeds_m_s(self) -> tuple[float, float]:
        """The least and the greatest approach speed."""
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

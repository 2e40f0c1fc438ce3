"""`[mission]`: search and rescue."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.sections import (
    Coordinate,
    Count,
    Duration,
    Interval,
    Level,
    Section,
    SomeLength,
)

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

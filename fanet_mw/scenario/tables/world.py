"""The `[world]` table: the engine that moves bodies, the area, and the obstacles in it."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.tables.sections import (
    Coordinate,
    Section,
    SomeLength,
)
from fanet_mw.units import MS

WindSpeed = Annotated[float, Field(ge=-50, le=50)]
Building = tuple[Coordinate, Coordinate, SomeLength, SomeLength, SomeLength]


class World(Section):
    """The engine that moves the bodies, the area in which they move, and the obstacles in it."""

    engine: Literal["pybullet", "kinematic", "rotors"] = "kinematic"
    """The model of flight: rigid bodies with collisions (`pybullet`, an extra of the package), point masses with
    limited acceleration (`kinematic`), or multirotors with rotors, motors, control loops and wind (`rotors`)."""
    vehicle: Literal["iris", "crazyflie"] = "iris"
    """The type of vehicle, whose battery is drained and which `rotors` flies: a 3DR Iris of 1.5 kg, or a Crazyflie of
    30 g."""
    charge: tuple[Annotated[float, Field(gt=0, le=1)], Annotated[float, Field(gt=0, le=1)]] = (1.0, 1.0)
    """The least and the greatest charge of a battery at the start, as a share of its capacity; each is drawn by the
    seed."""
    wind_m_s: tuple[WindSpeed, WindSpeed] = (0.0, 0.0)
    """`rotors`: velocity of the mean wind, to the east and to the north."""
    gusts_m_s: Annotated[float, Field(ge=0, le=50)] = 0.0
    """`rotors`: strength of the gusts by the Dryden model, as the wind 6 m above ground; upwards they have a tenth of
    it."""
    area_m: SomeLength = 2500.0
    """Side of the square area, whose middle is the origin."""
    tick_ms: Annotated[float, Field(ge=1, le=10_000)] = 100.0
    """The interval at which poses are published."""
    base_m: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    """East and north of the base, which is the middle of the layout in which the swarm starts; each at most twice
    `area_m`."""
    crash: Literal["none", "falls"] = "none"
    """The effect of a contact on a vehicle: `none`, it is only counted; `falls`, the vehicle falls to the ground and
    stays there."""
    crash_radio: Literal["survives", "dies"] = "dies"
    """Whether the radio of a crashed vehicle continues to work."""
    physics_hz: Annotated[int, Field(ge=10, le=2000)] = 240
    """`pybullet`: steps of the physics per second."""
    buildings: Annotated[int, Field(ge=0, le=10_000)] | tuple[Building, ...] = 0
    """A number of boxes at random places, or each building as [east, north, width, depth, height] in metres: its
    middle, its extent to the east and to the north, and the height of its roof above ground. UAVs collide with
    buildings, and radio links are obstructed."""
    building_size_m: tuple[SomeLength, SomeLength] = (15.0, 40.0)
    """The least and the greatest width and depth of a random building."""
    building_height_m: tuple[SomeLength, SomeLength] = (8.0, 30.0)
    """The least and the greatest height of a random building."""
    terrain_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    """Height of the highest hill above 0; 0: no hills."""
    terrain_scale_m: Annotated[float, Field(ge=1, le=1e6)] = 400.0
    """Distance between neighboring hills."""
    heightmap: str = ""
    """A file with heights of the ground, in place of random hills: an ASCII grid (.asc), or a grayscale picture (.png).
    Its middle is put at the origin, its lowest point at height 0. A path is relative to the scenario file's folder."""
    heightmap_white_m: Annotated[float, Field(gt=0, le=9000)] = 100.0
    """Height of a white pixel above a black one."""
    heightmap_pixel_m: Annotated[float, Field(gt=0, le=1e5)] = 10.0
    """Width of a pixel."""
    buildings_geojson: str = ""
    """A file with outlines of buildings (GeoJSON), in place of `buildings`. A path is relative to the scenario file's
    folder."""
    origin_deg: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None = None
    """Latitude and longitude of the origin; unset: those of the middle of the buildings in the file."""
    no_fly_m: tuple[tuple[Coordinate, Coordinate, SomeLength], ...] = ()
    """No-fly areas, each as [east, north, radius]; the world counts entries."""
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
        """True if anything except the flat ground can stand between two nodes."""
        return bool(self.buildings or self.buildings_geojson or self.heightmap) or self.terrain_m > 0

    @property
    def tick_ns(self) -> int:
        return round(self.tick_ms * MS)

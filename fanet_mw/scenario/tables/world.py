"""The `[world]` table: the engine that moves bodies, the area, and the obstacles in it."""

import math
from collections.abc import Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.named_files import digest_of, middle_deg
from fanet_mw.scenario.tables.sections import Coordinate, Section, SomeLength, read_with_file
from fanet_mw.units import DEFAULT_ORIGIN_DEG, MS

FILE_KEYS: Final = {"heightmap": "heightmap_sha256", "buildings_geojson": "buildings_sha256"}
"""The keys that name files, and those of their digests."""
WindSpeed = Annotated[float, Field(ge=-50, le=50)]
Sha256 = Annotated[str, Field(pattern=r"^([0-9a-f]{16})?$")]
Building = tuple[Coordinate, Coordinate, SomeLength, SomeLength, SomeLength]


FASTEST_AIR_M_S: Final = {"iris": 19.0, "crazyflie": 10.0}
"""The airspeed in level flight at the tilt limit of each type of vehicle, rounded down
(`sim/world/engines/rotors/vehicle_types.py`)."""

NO_AID_S: Final = 5.0
"""A flight controller that has had no position for so long does not know its place (PX4's EKF2_NOAID_TOUT)."""


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
    navigation: Literal["estimated", "perfect"] = "estimated"
    """Where flight controllers that carry out setpoints believe their UAVs to be: `estimated` by GPS, barometer and
    inertial sensors with their errors, so that a UAV without any fix or optical flow for 5 s lands; or `perfect`, at
    the true place. The tracks of mobility models are flown exactly."""
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
    physics_hz: Annotated[int, Field(ge=60, le=1980, multiple_of=60)] = 240
    """`pybullet`: steps of the physics per second, a multiple of the 60 at which thrust is set."""
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
    """A file with heights of the ground, in place of random hills: an ASCII grid (.asc), an SRTM tile (.hgt), a GeoTIFF
    (.tif, an extra of the package). What says where on earth it lies is laid there; of an ASCII grid in metres the
    middle is put at the origin. The lowest point is at height 0. A path is relative to the scenario file's folder."""
    heightmap_sha256: Sha256 = ""
    """Beginning of the SHA-256 of that file, which is filled in when the scenario is read. Another file is refused."""
    buildings_geojson: str = ""
    """A file with outlines of buildings (GeoJSON), in place of `buildings`. A path is relative to the scenario file's
    folder."""
    buildings_sha256: Sha256 = ""
    """The same for the file of buildings."""
    origin_deg: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] = (
        DEFAULT_ORIGIN_DEG
    )
    """Latitude and longitude of the origin, also in MAVLink; unset: the middle of the buildings in their file, or else
    of an ASCII grid in degrees, or else Seoul."""
    no_fly_m: tuple[tuple[Coordinate, Coordinate, SomeLength], ...] = ()
    """No-fly areas, each as [east, north, radius]; the world counts entries."""
    no_fly: Annotated[str, read_with_file("world.no_fly")] = ""
    """A file with further ones (.plan, .kml, .kmz, .geojson): circles, and a circle around each polygon. It is read
    with the scenario, and its path is relative to the scenario file's folder."""
    gps_hz: Annotated[float, Field(ge=1e-6, le=1000)] = 5.0
    """Position fixes of each UAV per second, at most one a tick; one a second while nothing moves."""
    gps_sigma_m: Annotated[float, Field(ge=0, le=1000)] = 0.3
    """Standard deviation of the noise of each fix along each horizontal axis; slow errors come on top (table
    `[sensors]`)."""

    @model_validator(mode="before")
    @classmethod
    def _read_files(cls, tree: object) -> object:
        """The digests of the files, and the origin that they give."""
        if not isinstance(tree, Mapping):
            return tree
        found = dict(tree)
        for key, digest_key in FILE_KEYS.items():
            path, said = tree.get(key), tree.get(digest_key)
            digest = digest_of(path) if path and isinstance(path, str) else ""
            if said and digest and said != digest:
                raise ValueError(
                    f"world.{key} = {path}: the file has the digest {digest}, and world.{digest_key} = {said} is that "
                    "of another one; leave it out to take this file"
                )
            if digest:
                found[digest_key] = digest
        if tree.get("origin_deg") is None:
            found.pop("origin_deg", None)
            place = middle_deg(
                heightmap=str(tree.get("heightmap") or ""), buildings=str(tree.get("buildings_geojson") or "")
            )
            if place is not None:
                found["origin_deg"] = place
        return found

    @model_validator(mode="after")
    def _obstacles_agree(self) -> Self:
        if self.buildings_geojson and self.buildings:
            raise ValueError("world.buildings and world.buildings_geojson exclude each other")
        if self.heightmap and self.terrain_m:
            raise ValueError("world.terrain_m and world.heightmap exclude each other")
        if self.engine != "rotors" and (any(self.wind_m_s) or self.gusts_m_s):
            raise ValueError(f'world.wind_m_s and world.gusts_m_s need world.engine = "rotors", not "{self.engine}"')
        wind_m_s, most_m_s = math.hypot(*self.wind_m_s), FASTEST_AIR_M_S[self.vehicle]
        if wind_m_s > most_m_s:
            raise ValueError(
                f"world.wind_m_s = [{self.wind_m_s[0]:g}, {self.wind_m_s[1]:g}] must be <= {most_m_s:g} m/s together, "
                f"the airspeed at which world.vehicle = {self.vehicle} leans as far as it can"
            )
        if self.gusts_m_s and not wind_m_s:
            raise ValueError(
                f"world.gusts_m_s = {self.gusts_m_s:g} is a wind near the ground and needs world.wind_m_s other than 0"
            )
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

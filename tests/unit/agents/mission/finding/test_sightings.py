"""People on a hillside are seen where they are, and each sighting is as certain as its direction."""

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import MakeScenario
from seeing_uav import MODEL, UP_M

from agents.mission.finding.camera_view import CameraView
from agents.mission.finding.identities import Identities, Sighting
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.sightings import Sightings, ground_place
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.bus.messages import Call, Person
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Sighted
from fanet_mw.units import STILL, Enu, NodeId, S

SLOPE = OnboardMap((), tuple(tuple(0.5 * 50.0 * column for column in range(-4, 5)) for _ in range(9)), 50.0)
"""It rises eastward, by one in two."""


@pytest.mark.parametrize("east_m", [-60.0, 0.0, 40.0])
def test_a_person_on_a_hillside_is_seen_where_the_ray_meets_it(make_scenario: MakeScenario, east_m: float) -> None:
    own, outbox = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(SLOPE)), Outbox()
    own.fix(Enu(0, 0, UP_M), STILL, now_ns=S)
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    sightings = Sightings(scenario, NodeId(1), KnownSurvivors(MODEL), own, outbox)
    down_m = UP_M - SLOPE.ground_m(east_m, 10.0)
    elevation_rad = -math.atan2(down_m, math.hypot(east_m, 10.0))
    sightings.camera([Person(math.atan2(east_m, 10.0), elevation_rad, 20.0)], now_ns=S)
    (seen,) = [record for record in outbox.records if isinstance(record, Sighted)]
    assert (seen.east_m, seen.north_m) == pytest.approx((east_m, 10.0), abs=0.1)


class Heard(NamedTuple):
    """What the tests look at: one call of `Identities.on_reading`, or of `on_images`."""

    sightings: tuple[Sighting, ...]
    evidence: float


class Watched:
    """The sightings of a UAV that hovers at a place, and what they tell its identities."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, scenario: Scenario, *, up_m: float = 50.0) -> None:
        self.readings: list[Heard] = []
        self.images: list[tuple[int, float]] = []
        self.outbox = Outbox()
        self.survivor: int | None = None
        """Whom the identities take everybody for."""
        own = OwnMotion(Enu(3, 4, up_m), KnownObstacles(OnboardMap()))
        own.fix(Enu(3, 4, up_m), STILL, now_ns=0)
        self.sightings = Sightings(scenario, NodeId(1), KnownSurvivors(MODEL), own, self.outbox)

        def on_reading(_: Identities, sightings: list[Sighting], *, evidence: float, **more: Any) -> list[Any]:
            self.readings.append(Heard(tuple(sightings), evidence))
            return [SimpleNamespace(survivor=self.survivor) for _ in sightings]

        def on_images(_: Identities, count: int, shows: Any, *, evidence: float, but: Any = ()) -> None:
            self.images.append((count, evidence))

        monkeypatch.setattr(Identities, "on_reading", on_reading)
        monkeypatch.setattr(Identities, "on_images", on_images)


def call_from(slant_m: float, *, up_m: float = 50.0, snr_db: float = 0.0) -> Call:
    return Call(0.5, -math.asin(up_m / slant_m), 40.0, snr_db)


def test_a_call_counts_as_close_up_to_100_m_and_is_heard_up_to_200_m(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario
) -> None:
    uav = Watched(monkeypatch, make_scenario())
    uav.sightings.voice([call_from(slant_m) for slant_m in (200.1, 99.9, 100.1, 199.9)], now_ns=S)
    assert [sighting.close for sighting in uav.readings[0].sightings] == [True, False, False]
    assert uav.readings[0].evidence == 9.0


def test_whom_a_camera_shows_is_close_however_far(monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    uav = Watched(monkeypatch, scenario, up_m=120.0)
    uav.sightings.camera([Person(0.0, -math.asin(120.0 / 300.0), 20.0)], now_ns=S)
    assert uav.readings == [Heard(uav.readings[0].sightings, CameraView(scenario).sighting_evidence(120.0))]
    (shown,) = uav.readings[0].sightings
    assert (shown.close, shown.sigma_m) == (True, pytest.approx(0.03 * 300.0**2 / 120.0))
    assert uav.images == [(1, CameraView(scenario).empty_evidence(120.0))]


@pytest.mark.parametrize(("snr_db", "sigma_rad"), [(0.0, 0.2), (6.0, 0.2 / 10**0.3), (60.0, 0.03)])
def test_the_place_of_a_call_is_as_certain_as_its_direction_which_noise_blurs(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario, snr_db: float, sigma_rad: float
) -> None:
    scenario = make_scenario(**{"sensors.voice_sigma_deg": math.degrees(0.2)})
    uav = Watched(monkeypatch, scenario)
    uav.sightings.voice([call_from(80.0, snr_db=snr_db)], now_ns=S)
    assert uav.readings[0].sightings[0].sigma_m == pytest.approx(sigma_rad * 80.0**2 / 50.0)


def test_no_sighting_is_more_certain_than_a_metre_and_none_is_divided_by_a_height_below_one(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario
) -> None:
    scenario = make_scenario(**{"sensors.voice_sigma_deg": math.degrees(0.2)})
    above = Watched(monkeypatch, scenario, up_m=10.0)
    above.sightings.voice([call_from(10.0, up_m=10.0, snr_db=60.0)], now_ns=S)
    assert above.readings[0].sightings[0].sigma_m == 1.0
    low = Watched(monkeypatch, scenario, up_m=0.5)
    low.sightings.voice([call_from(5.0, up_m=0.5)], now_ns=S)
    assert low.readings[0].sightings[0].sigma_m == pytest.approx(0.2 * 25.0)


def test_images_that_did_not_come_have_shown_nobody_each_once(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario
) -> None:
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    uav, empty = Watched(monkeypatch, scenario), CameraView(scenario).empty_evidence(50.0)
    uav.sightings.review(9 * S)
    assert uav.images == [], "no image has come, so there may be no camera"
    uav.sightings.camera([], now_ns=10 * S)
    assert uav.images == [(1, empty)], "one that has come"
    uav.sightings.review(10 * S + S // 5 + 3 * S // 4)
    assert uav.images[1:] == [], "the next one may still come"
    uav.sightings.review(10 * S + S // 5 + 3 * S // 4 + 1)
    assert uav.images[1:] == [(1, empty)]
    uav.sightings.review(12 * S + S // 5)
    assert uav.images[2:] == [(2, empty)], "of half a second each, but for the last"
    uav.sightings.camera([], now_ns=12 * S)
    assert uav.images[3:] == [(1, empty)], "which comes now"
    uav.sightings.camera([], now_ns=14 * S)
    assert uav.images[4:] == [(3, empty), (1, empty)], "those that have not come are counted before one that has"


@given(
    up_m=st.floats(1, 300), bearing=st.floats(-math.pi, math.pi), depression=st.floats(0.0501, 1.5),
    east=st.floats(-500, 500), north=st.floats(-500, 500),
)  # fmt: skip
def test_over_level_ground_a_direction_meets_the_place_from_which_it_comes(
    up_m: float, bearing: float, depression: float, east: float, north: float
) -> None:
    found = ground_place(Enu(east, north, up_m), bearing_rad=bearing, elevation_rad=-depression)
    assert found is not None
    de, dn = found[0] - east, found[1] - north
    assert math.atan2(up_m, math.hypot(de, dn)) == pytest.approx(depression, rel=1e-6)
    assert (de, dn) == pytest.approx(
        (math.hypot(de, dn) * math.sin(bearing), math.hypot(de, dn) * math.cos(bearing)), abs=1e-6
    )
    assert found[2] == pytest.approx(math.hypot(de, dn, up_m))
    level = ground_place(Enu(east, north, up_m), bearing_rad=bearing, elevation_rad=-depression, rise_m=lambda *_: 0.0)
    if up_m / math.tan(depression) > 991.0:
        assert level is None, "a map is followed for 1 km"
    elif up_m / math.tan(depression) < 989.0:
        assert level == pytest.approx(found, abs=0.05 + 0.05 / math.sin(depression))


@pytest.mark.parametrize("elevation_rad", [0.5, 0.0, -0.04, -0.05])
def test_a_direction_that_is_hardly_below_the_horizon_meets_no_ground(elevation_rad: float) -> None:
    assert ground_place(Enu(0, 0, 50), bearing_rad=0.0, elevation_rad=elevation_rad) is None


def test_a_ray_ends_at_the_first_ground_that_it_meets_not_behind_a_ridge() -> None:
    def ridge_m(east_m: float, north_m: float) -> float:
        return 40.0 if 95.0 <= north_m <= 125.0 else 0.0

    at = Enu(0, 0, 50)
    found = ground_place(at, bearing_rad=0.0, elevation_rad=-math.atan2(50, 200), rise_m=ridge_m)
    assert found is not None
    assert found[1] == pytest.approx(95.0, abs=0.05)
    over = ground_place(at, bearing_rad=math.pi / 2, elevation_rad=-math.atan2(50, 200), rise_m=ridge_m)
    assert over is not None
    assert (over[0], over[2]) == pytest.approx((200.0, math.hypot(200, 50)), abs=0.05)


def test_what_an_image_shows_on_a_hillside_is_judged_by_the_height_of_the_ground_there(
    make_scenario: MakeScenario,
) -> None:
    own = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(SLOPE))
    own.fix(Enu(0, 0, UP_M), STILL, now_ns=S)
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    sightings = Sightings(scenario, NodeId(1), KnownSurvivors(MODEL), own, Outbox())
    for east_m in (-60.0, 50.0):  # 95 m and 40 m below
        sightings.camera([person_at(Enu(east_m, 0, 0.5 * east_m))], now_ns=S)
    people = sightings._identities._people
    for person in people:
        person.evidence = 0.0
    sightings.camera([], now_ns=2 * S)
    assert [person.evidence < 0 for person in people] == [True, False]


def person_at(at: Enu) -> Person:
    return Person(math.atan2(at.east, at.north), -math.atan2(UP_M - at.up, math.hypot(at.east, at.north)), 20.0)


def test_a_sighting_is_recorded_to_the_centimetre_with_the_survivor_if_there_is_one(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario
) -> None:
    uav = Watched(monkeypatch, make_scenario())
    for survivor in (None, 7):
        uav.survivor = survivor
        uav.sightings.voice([call_from(80.0)], now_ns=S)
    level_m = math.sqrt(80.0**2 - 50.0**2)
    east_m, north_m = round(3 + level_m * math.sin(0.5), 2), round(4 + level_m * math.cos(0.5), 2)
    assert uav.outbox.records == [
        Sighted(S, NodeId(1), "voice", 0, east_m, north_m), Sighted(S, NodeId(1), "voice", 7, east_m, north_m)
    ]  # fmt: skip


def test_the_part_of_errors_that_lasts_is_that_of_a_metre_and_the_bias_of_fixes(make_scenario: MakeScenario) -> None:
    own = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(OnboardMap()))
    scenario = make_scenario(**{"sensors.gps_bias_m": 3.0})
    assert Sightings(scenario, NodeId(1), KnownSurvivors(MODEL), own, Outbox()).steady_m2 == 1.0 + 9.0

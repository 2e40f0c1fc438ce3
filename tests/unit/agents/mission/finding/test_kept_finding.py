"""What UAVs make of powers, silence and sightings is the same in every release: they share tasks out by it."""

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from kept_values import kept
from kit import MakeScenario
from seeing_uav import MODEL, UP_M, mean_dbm
from test_identities import Pass

from agents.mission.finding.calibration import common_offset, likelihood
from agents.mission.finding.camera_view import CameraView
from agents.mission.finding.least_squares import PowerReading, estimate
from agents.mission.finding.phone_localization import Estimate, PhoneFilter, PhoneOffset
from fanet_mw.units import Enu


@pytest.mark.parametrize("apart_m", [5, 15, 60, 130])
def test_who_is_named_where_after_a_flight_past_is_what_it_was_before(apart_m: float) -> None:
    def values() -> Iterator[Any]:
        for seed in range(3):
            passed = Pass(seed, apart_m=apart_m)
            passed.fly()
            survivors, identities = passed.uav.survivors, passed.uav.identities
            yield passed.uav.named, survivors.unconfirmed(), survivors.sought(), identities.unreported(75 * 10**9)
            for survivor, known in survivors.by_id.items():
                yield survivor, known.place(), known.filter.estimate_by_power(), known.filter.received_powers
                yield known.confirmed and identities.against(known.confirmed)

    kept(f"finding, {apart_m} m apart", values())


@pytest.mark.parametrize("off_db", [-9.0, 0.0, 14.0])
@pytest.mark.parametrize("half_m", [math.inf, 60.0])
def test_where_a_phone_is_thought_is_what_it_was_before(off_db: float, half_m: float) -> None:
    model = MODEL._replace(half_m=half_m)

    def values() -> Iterator[Any]:
        for seed in range(3):
            drawn = random.Random(seed)
            phone, truth, readings = PhoneFilter(model), Enu(drawn.uniform(-90, 90), drawn.uniform(-90, 90), 0), []
            for step in range(24):
                at = Enu(-150 + 13 * step, drawn.uniform(-160, 160), UP_M)
                rssi_dbm = round(mean_dbm(truth, at) + off_db + drawn.gauss(0, 4))
                if rssi_dbm < MODEL.threshold_dbm:
                    phone.on_silence(at)
                elif phone.on_rssi(step % 4, at, rssi_dbm):
                    readings.append((at, float(rssi_dbm)))
                if step % 6 == 5:
                    yield phone.estimate(), phone.deficit(0.0, 0.0), phone.included_powers
            phone.calibrate(PhoneOffset(off_db / 2, 1.5))
            yield phone.estimate(), len(list(phone.likely_cells(9.0)))
            yield phone.estimate_elsewhere(lambda east_m, north_m: (east_m + north_m) % 50 < 25)
            powers = [PowerReading(*reading) for reading in readings]
            yield estimate(powers, phone_power_dbm=15, exponent=3) if powers else None
            told = likelihood(Estimate(truth.east, truth.north, 4, 0, 4), readings, model)
            yield told, [common_offset([told] * count) for count in (0, 1, 2, 5)]

    kept(f"phones, {off_db} dB, within {half_m} m", values())


def test_what_an_image_tells_is_what_it_was_before(make_scenario: MakeScenario) -> None:
    keys = {"mission.survivors": 1, "sensors.camera_hz": 2}
    views = [CameraView(make_scenario(**keys, **{"sensors.camera_false_per_hour": rate})) for rate in (0, 3, 3000)]
    heights_m = (0.0, 2.0, 10.0, 30.0, 65.0, 200.0)
    evidence = [(v.sighting_evidence(h), v.empty_evidence(h), v.recognized(h)) for v in views for h in heights_m]
    here, spots = Enu(10, 20, 50), [Enu(10 + 7.0 * i, 20 + 5.0 * j, 4) for i in range(-6, 7) for j in range(-6, 7)]
    kept("images", [*evidence, *(views[0].shows(spot, here) for spot in spots)])

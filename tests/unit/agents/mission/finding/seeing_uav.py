"""A UAV that sees people and hears phones, for the tests of what it makes of them."""

import math
from typing import Final

from agents.mission.finding.identities import Identities, Sighting
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from fanet_mw.units import US, Enu
from fanet_mw.wire.survivors import Found, Standing, Survivor

MODEL: Final = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
UP_M: Final = 65.0


def mean_dbm(truth: Enu, at: Enu) -> float:
    return MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm())


class Uav:
    """What one UAV knows."""

    def __init__(self) -> None:
        self.survivors = KnownSurvivors(MODEL)
        self.identities = Identities(self.survivors)
        self.here = Enu(0, 0, UP_M)
        self.named: dict[int, Enu] = {}

    def hear(self, survivor: int, node: int, at: Enu, rssi_dbm: float, *, now_ns: int = 0) -> None:
        self.survivors.take_report(Survivor(now_ns // US, survivor, node, at, rssi_dbm), now_ns=now_ns)

    def see(self, *people: Enu, now_ns: int) -> list[int]:
        """An image from close by; who may be confirmed, is."""
        sightings = [Sighting(at, 2.0, close=True) for at in people]
        self.identities.on_reading(sightings, here=self.here, evidence=9.0, now_ns=now_ns)
        sure = self.identities.review(now_ns)
        for survivor in sure:
            place = self.survivors.by_id[survivor].place()
            assert place is not None
            self.survivors.on_found(Found(now_ns // US, survivor, *place, 1, Standing.CONFIRMED), now_ns=now_ns)
            self.named[survivor] = Enu(place.east_m, place.north_m, 0)
        return sure

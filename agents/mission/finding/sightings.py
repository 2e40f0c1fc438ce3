"""The people whom a UAV's camera shows and whose voices its microphones make out, as places on the ground."""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.contradictions import Contradictions
from agents.mission.finding.finds import Finds, ground_place
from agents.mission.finding.identities import Identities
from agents.mission.navigation.navigation import Navigation
from agents.mission.outbox import Outbox
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Sighted
from fanet_mw.units import Enu, NodeId

_CLOSE_M: Final = 100.0
"""Slant range of a sighting that confirms."""
_ANGLE_RAD: Final = 0.03
"""Standard deviation of the direction of a camera, attitude included."""


class Sightings:
    """What the camera and the microphones of one UAV show of people, whom neither of them can name."""

    def __init__(self, scenario: Scenario, node: NodeId, finds: Finds, navigation: Navigation, outbox: Outbox) -> None:
        self._node = node
        self._identities = Identities(finds)
        self._contradictions = Contradictions(finds, self._identities)
        self._navigation, self._outbox = navigation, outbox
        self._voice_rad = math.radians(scenario.sensors.voice_sigma_deg)

    def camera(self, people: Sequence[tuple[float, float]], *, now_ns: int) -> None:
        """The camera shows people at these bearings and elevations [rad]."""
        for direction in people:
            self._sighted("camera", direction, sigma_rad=_ANGLE_RAD, now_ns=now_ns)

    def voice(self, calls: Sequence[tuple[float, float, float]], *, now_ns: int) -> None:
        """The microphones make out calls at these bearings and elevations [rad], so far above noise [dB]."""
        for bearing_rad, elevation_rad, snr_db in calls:
            sigma_rad = max(_ANGLE_RAD, self._voice_rad * math.pow(10.0, -snr_db / 20))
            self._sighted("voice", (bearing_rad, elevation_rad), sigma_rad=sigma_rad, now_ns=now_ns)

    def review(self, now_ns: int) -> list[int]:
        """The survivors who may be confirmed now, because their phones are surely those of people that were seen."""
        return self._identities.review(now_ns)

    def contradicted(self) -> list[int]:
        """The survivors whose confirmation what was heard and seen since contradicts."""
        return self._contradictions.review()

    def _sighted(self, sensor: str, direction: tuple[float, float], *, sigma_rad: float, now_ns: int) -> None:
        """Take in that a sensor shows a person in a direction, if the place on the ground is not too far away."""
        here = self._navigation.over_ground(now_ns)
        looked = ground_place(here, bearing_rad=direction[0], elevation_rad=direction[1])
        if looked is None or looked[2] > 2 * _CLOSE_M:
            return
        sigma_m = max(1.0, sigma_rad * looked[2] * looked[2] / max(1.0, here.up))
        at = Enu(looked[0], looked[1], 0.0)
        survivor = self._identities.on_sighting(at, sigma_m=sigma_m, close=looked[2] <= _CLOSE_M, now_ns=now_ns)
        self._outbox.records.append(
            Sighted(now_ns, self._node, sensor, survivor or 0, round(at.east, 2), round(at.north, 2))
        )

"""How far a UAV may go from its place for a survivor, out of the others' reach, as `mission.connection` says.

always    not at all: it stays on the leash of its place (`search_formation/search_place.py`); before the sweep it
          stays in reach of others, and near its way or so near to its place that it is there in time (`bidding.py`)
t         so far that it can be within reach of its team again t seconds later, and tell what it has found; before the
          sweep, so far that it is at its place at most t seconds after the sweep begins
none      as far as it likes
"""

import math
from typing import Final, Literal

from agents.mission.finding.phone_localization import Estimate
from agents.mission.search_formation.search_place import SearchPlace
from fanet_mw.units import Enu, S

Connection = Literal["always", "none"] | float

_SPEED_SHARE: Final = 0.9
"""The share of its greatest speed that a UAV relies on for the way back."""


class Absence:
    """The rule by which one UAV may be out of reach."""

    def __init__(self, formation: SearchPlace, connection: Connection, *, speed_m_s: float) -> None:
        self._formation = formation
        self._most_s = {"always": 0.0, "none": math.inf}[connection] if isinstance(connection, str) else connection
        self._speed_m_s = _SPEED_SHARE * speed_m_s

    @property
    def is_permitted(self) -> bool:
        """True if a UAV may be out of reach at all."""
        return self._most_s > 0

    def late_s(self, at: Enu, now_ns: int, *, after_s: float) -> float:
        """How much later than the sweep this UAV is at its place if it leaves a position after some time; 0 once it has
        begun, and for a follower where UAVs may be out of reach: nobody waits for it.
        """
        begins_ns = self._formation.sweep_starts_ns()
        if begins_ns is None or now_ns >= begins_ns or (self.is_permitted and self._formation.is_free(now_ns)):
            return 0.0
        first, _ = self._formation.lane(begins_ns)
        return max(0.0, first.horizontal_to(at) / self._speed_m_s + after_s - (begins_ns - now_ns) / S)

    def permits(self, place: Estimate, now_ns: int, *, after_s: float = 0.0) -> bool:
        """True if a UAV that leaves a survivor's place after some time is within reach of its team soon enough."""
        if not self.is_permitted or math.isinf(self._most_s):
            return self.is_permitted
        begins_ns = self._formation.sweep_starts_ns()
        if begins_ns is not None and now_ns < begins_ns:
            return self.late_s(place.at, now_ns, after_s=after_s) <= self._most_s
        at_ns = now_ns + round((after_s + self._most_s) * S)
        return self._formation.beyond_reception_m(place.east_m, place.north_m, at_ns) <= self._most_s * self._speed_m_s

"""The missed cells: cells of the coverage map that the formation has passed, by its plan, but that no UAV is known to
have searched. The lane of a lost UAV goes to another one by the plan (`formation_planner.py`).
"""

import math
from typing import Final

from agents.mission.finding.coverage_map import CoverageMap
from agents.mission.search_formation.formation_place import FormationPlace
from fanet_mw.units import Enu, S

_EXPECT_NS: Final = 4 * S
"""The interval at which the cells passed by the formation are added; a place moves about one cell in this time."""
_LATE_S: Final = 18.0
"""If a cell was passed more recently than this, the UAV that searched it may not have told this UAV yet."""
_LANE: Final = 0.5
"""A UAV of a team is expected to search the cells up to this share of the distance of two lanes away from it."""
_NEAR_M: Final = 450.0
"""A UAV flies to a missed cell at most this far away, because its knowledge of farther places is older."""


class MissedCells:
    """The missed cells that one UAV knows."""

    def __init__(self, coverage: CoverageMap, formation: FormationPlace) -> None:
        self._coverage, self._formation = coverage, formation
        self._expected = 0
        """The cells that the formation has passed, as bits."""
        self._expected_ns: int | None = None

    def nearest(self, here: Enu, now_ns: int) -> tuple[float, float] | None:
        """East and north of the missed cells to which the UAV may fly: the mean of the cells around the nearest one
        from which the UAV's team is within radio reach. None if there is no such cell.
        """
        self._expect(now_ns)
        coverage, formation = self._coverage, self._formation
        missed = [
            (math.hypot(east - here.east, north - here.north), east, north)
            for east, north in coverage.middles(self._expected & ~coverage.cells)
        ]
        near = sorted(
            cell for cell in missed if cell[0] <= _NEAR_M and formation.keeps_line(*cell[1:], now_ns, within_s=0.0)
        )
        if not near:
            return None
        _, east, north = near[0]
        around = [cell for cell in near if math.hypot(cell[1] - east, cell[2] - north) <= coverage.seen_m]
        return math.fsum(cell[1] for cell in around) / len(around), math.fsum(cell[2] for cell in around) / len(around)

    def _expect(self, now_ns: int) -> None:
        """Add the cells that the formation has passed since the last time."""
        pattern, swept_s = self._formation.pattern, self._formation.swept_s(now_ns)
        if pattern is None or swept_s is None or swept_s < _LATE_S:
            return
        if self._expected_ns is not None and now_ns - self._expected_ns < _EXPECT_NS:
            return
        self._expected_ns = now_ns
        for place in range(pattern.dimensions.teams * pattern.dimensions.lanes):
            at = pattern.at(place, swept_s - _LATE_S)
            self._expected |= self._coverage.around(at, _LANE * pattern.shape.lane_m)

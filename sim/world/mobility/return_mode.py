"""The return mode of the flight controllers, which needs no computer on board: when a UAV returns
(docs/explanation/search-flight.md, What the flight controller does by itself), and its way home.

It climbs to the height of its return, flies straight to its home, and lands. A flight controller does not know where
other UAVs are, so each has heights of its own, `mobility.return_step_m` apart (`_Heights`). Those that climb or land
are not kept clear.
"""

import math
from collections.abc import Callable, Collection, Iterator
from typing import Final, NamedTuple

from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu
from sim.world.arrays import Flags, Rows, Values
from sim.world.mobility.geofence import CEILING_M

_HOME_M: Final = 2.0
"""A UAV lands once it is within this horizontal distance of its home."""
_BELOW_M: Final = 0.5
"""A UAV that is no farther than this below the height of its return flies on its way; it climbs the rest there."""


class Homeward(NamedTuple):
    """The command to return."""

    home: Enu
    """The place above the home of the UAV, at the height of its return."""
    speed_m_s: float

    def goal(self, here: Enu) -> Enu | None:
        """The place to fly to now; None if it is time to land."""
        if here.horizontal_to(self.home) <= _HOME_M:
            return None
        return here._replace(up=self.home.up) if here.up < self.home.up - _BELOW_M else self.home


class _Heights:
    """Heights above the highest home at which UAVs return, such that no two share one: row k is k steps above
    `mobility.return_height_m`; a higher UAV takes the next height of its own, as it never sinks before it is home.
    Below the ceiling a large swarm shares heights.
    """

    def __init__(self, scenario: Scenario) -> None:
        mobility = scenario.mobility
        self._least_m, self._step_m = mobility.return_height_m, mobility.return_step_m
        fitting = 1 + int((CEILING_M - self._least_m) / self._step_m) if self._step_m else 1
        self._levels = min(scenario.nodes.count, fitting)

    def of(self, row: int, height_m: float) -> float:
        """The height at which a UAV returns that is this high now."""
        own_m = self._least_m + self._step_m * (row % self._levels)
        every_m = self._step_m * self._levels
        if height_m <= own_m + _BELOW_M:
            return own_m
        return own_m + math.ceil((height_m - _BELOW_M - own_m) / every_m) * every_m if every_m else height_m


class ReturnMode:
    """Which UAVs of a swarm have to return, and how."""

    def __init__(self, starts: Rows, scenario: Scenario, *, surface_m: Callable[[Rows], Values]) -> None:
        """`starts`: the homes of the UAVs, at any height. `surface_m`: the height of the roof or ground below."""
        mobility = scenario.mobility
        self._after_s = mobility.return_after_s
        self._speed_m_s = mobility.speed_m_s
        self.at_fence: Final = mobility.geofence == "return"
        self._homes = starts.copy()
        self._homes[:, 2] = surface_m(starts).max()
        """The homes of the UAVs, each as high as the ground at the highest of them."""
        self._heights = _Heights(scenario)
        self._told_s: dict[int, float] = {}
        """The instant of the last setpoint of each row that has had one, or at which it last stood on the ground."""
        self.from_fence: set[int] = set()
        """The rows that return, or have landed, because they were beyond the geofence."""

    @property
    def watches(self) -> bool:
        """False if the scenario has no UAV return."""
        return self.at_fence or self._after_s > 0

    def on_setpoint(self, row: int, t_s: float) -> None:
        """The computer of a UAV has commanded something."""
        self._told_s[row] = t_s

    def way(self, row: int, here: Enu, speed_m_s: float = 0.0) -> Homeward:
        """The way home of a UAV that is at a place; a speed of 0 or less means that of the scenario."""
        east, north, ground_m = self._homes[row].tolist()
        height_m = self._heights.of(row, here.up - ground_m)
        return Homeward(Enu(east, north, ground_m + height_m), speed_m_s if speed_m_s > 0 else self._speed_m_s)

    def due(self, able: Collection[int], at: Rows, beyond: Flags, t_s: float) -> Iterator[tuple[int, Homeward]]:
        """The rows of `able` that have to return now, each with its way; silence counts from when a UAV is able to."""
        self._told_s |= dict.fromkeys(self._told_s.keys() - set(able), t_s)
        for row in able:
            silent = bool(self._after_s) and t_s - self._told_s.get(row, t_s) >= self._after_s
            fenced = self.at_fence and bool(beyond[row])
            if fenced:
                self.from_fence.add(row)
            if silent or fenced:
                yield row, self.way(row, Enu(*at[row].tolist()))

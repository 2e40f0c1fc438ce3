"""The return mode of the flight controllers, which needs no computer on board: when a UAV returns, and its way home.

    lower than the height of return    it climbs straight up where it is
    high enough                        it flies straight to its home, as high as it is
    above its home                     it lands

A UAV returns when its last setpoint is older than `mobility.return_after_s` while it flies, and is steered again by the
next setpoint; with `mobility.geofence = "return"` also when it is beyond the geofence, and then it obeys nothing before
it stands on the ground. A flight controller does not know where other UAVs are: returns are not kept clear of each
other.
"""

import math
from collections.abc import Callable, Collection, Iterator
from typing import Final, NamedTuple

from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu
from sim.world.engines.contract import Flags, Rows, Values

_HOME_M: Final = 2.0
"""A UAV lands once it is within this horizontal distance of its home."""
_BELOW_M: Final = 2.0
"""A UAV that is no farther than this below the height of return flies on its way; it climbs the rest there."""


class Homeward(NamedTuple):
    """The command to return."""

    home: Enu
    """The place above the home of the UAV, at the height of return or that from which the UAV returns."""
    speed_m_s: float

    def goal(self, here: Enu) -> Enu | None:
        """The place to fly to now; None if it is time to land."""
        if math.hypot(here.east - self.home.east, here.north - self.home.north) <= _HOME_M:
            return None
        return here._replace(up=self.home.up) if here.up < self.home.up - _BELOW_M else self.home


class ReturnMode:
    """Which UAVs of a swarm have to return."""

    def __init__(self, starts: Rows, scenario: Scenario, *, ground_m: Callable[[Rows], Values]) -> None:
        """`starts`: the homes of the UAVs, at any height. `ground_m`: the height of the ground below places."""
        mobility = scenario.mobility
        self._after_s = mobility.return_after_s
        self._speed_m_s = mobility.speed_m_s
        self.at_fence: Final = mobility.geofence == "return"
        self._homes = starts.copy()
        self._homes[:, 2] = ground_m(starts) + mobility.return_height_m
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

    def due(self, able: Collection[int], at: Rows, beyond: Flags, t_s: float) -> Iterator[tuple[int, Homeward]]:
        """Those UAVs of the rows `able` that have to return now, each with its way. The silence of a UAV that is not
        able to, because it stands on the ground, begins when it is.
        """
        self._told_s |= dict.fromkeys(self._told_s.keys() - set(able), t_s)
        for row in able:
            silent = bool(self._after_s) and t_s - self._told_s.get(row, t_s) >= self._after_s
            fenced = self.at_fence and bool(beyond[row])
            if fenced:
                self.from_fence.add(row)
            if silent or fenced:
                home = Enu(*self._homes[row].tolist())
                yield row, Homeward(home._replace(up=max(home.up, float(at[row, 2]))), self._speed_m_s)

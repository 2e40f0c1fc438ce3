"""The flight of a searching UAV from one position fix to the next: to its goal or home, within its constraints."""

from collections.abc import Collection
from typing import Final

from agents.mission.flight.connectivity_maintenance import ConnectivityMaintenance
from agents.mission.flight.goal import Goal
from agents.mission.flight.return_home import HOME_HIGHER_M, ReturnHome
from agents.mission.flight.take_off import TakeOff
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.roll_call import MUTE_LEVELS, RollCall
from agents.mission.search_formation.search_place import SearchPlace
from fanet_mw.units import STILL, Enu, NodeId

_MUTE_LEVEL_M: Final = 8.0
"""A mute UAV flies above those who fly home, by this for each level, or by less if the ceiling is too low: others fly
where it should be, because they take it for lost, and two levels should not be in each other's way."""
CEILING_MARGIN_M: Final = 4.0
"""Goals end so far below the ceiling: heights are wrong by 2 m (rescue, seed 1: 122.2 m where 120 was wanted)."""
_PASS_M: Final = 18.0
"""UAVs that give way to another part of the swarm fly so much higher: between the places of others and who is mute."""


class Flight:
    """Chooses the velocity of one UAV."""

    def __init__(
        self,
        own_motion: OwnMotion,
        place: SearchPlace,
        goal: Goal,
        velocity_choice: VelocityChoice,
        connectivity: ConnectivityMaintenance,
        *,
        roll_call: RollCall,
        take_off: TakeOff | None,
        return_home: ReturnHome,
        height_m: float,
        ceiling_m: float,
    ) -> None:
        """`take_off`: None for a UAV that is in the air from the start. `height_m`: of the lanes above ground."""
        self._highest_m, self._home_m = max(height_m, ceiling_m - CEILING_MARGIN_M), height_m + HOME_HIGHER_M
        self._level_m = min(_MUTE_LEVEL_M, max(0.0, self._highest_m - self._home_m) / MUTE_LEVELS)
        self._own_motion, self._place, self._goal = own_motion, place, goal
        self._velocity_choice, self._connectivity = velocity_choice, connectivity
        self._roll_call, self._take_off, self._return_home = roll_call, take_off, return_home
        self.velocity: Enu | None = None
        """A new velocity to fly, until the application takes it; None if there is no new one."""
        self.held: Collection[NodeId] = ()
        """The neighbors that stay in reach, because this UAV flies so."""

    def fix(self, position: Enu, velocity: Enu, survivor: int | None, *, now_ns: int) -> None:
        self._own_motion.fix(position, velocity, now_ns=now_ns)
        self.held = ()
        if self.takes_off and self._climbs(now_ns):
            self.velocity = None
        elif not self._return_home.leaves:
            goal, feed = self._goal.at(survivor, now_ns)
            hastily = self._place.closing_s(now_ns) is not None
            missed = self._connectivity.missed(now_ns)
            if missed is not None:
                self._roll_call.miss(missed, now_ns=now_ns)
            beyond = self._connectivity.beyond_gap(now_ns)
            if beyond is not None:
                goal, feed = beyond.position._replace(up=goal.up), beyond.velocity
            level = self._roll_call.mute_level(now_ns)
            if level:
                goal = goal._replace(up=self._home_m + level * self._level_m)
            elif self._place.passes_above:
                goal = goal._replace(up=goal.up + _PASS_M)
            self.velocity = self._velocity_choice.velocity(self._below(goal), feed, now_ns, hastily=hastily)
            self.held = self._connectivity.held(self.velocity)
        elif self._return_home.land_if_there(now_ns):
            self.velocity = None
        else:
            self.velocity = self._velocity_choice.velocity(self._below(self._return_home.goal(now_ns)), STILL, now_ns)

    def _below(self, goal: Enu) -> Enu:
        """A goal below the ceiling."""
        return goal._replace(up=min(goal.up, self._highest_m))

    @property
    def takes_off(self) -> bool:
        """True from the start of a UAV that stands on the ground until it has taken off, or leaves its mission."""
        return self._take_off is not None and self._take_off.lasts and not self._return_home.leaves

    @property
    def take_off_s(self) -> float:
        """The time that the take-off still takes; 0 for a UAV in the air."""
        return self._take_off.left_s if self._take_off is not None else 0.0

    def _climbs(self, now_ns: int) -> bool:
        """Go on with the take-off; returns False once it is over, and the UAV departs for its place."""
        assert self._take_off is not None, "who takes off stood on the ground"
        if self._take_off.stands:
            self._return_home.stands_on_pad()
        self._take_off.fix(now_ns)
        if not self._take_off.lasts:
            self._place.depart(now_ns)
        return self._take_off.lasts

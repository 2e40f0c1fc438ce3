"""The flight of a searching UAV from one position fix to the next: to its goal or home, within its constraints."""

from agents.mission.flight.goal import Goal
from agents.mission.flight.return_home import ReturnHome
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.navigation import Navigation
from fanet_mw.units import STILL, Enu


class Flight:
    """Chooses the velocity of one UAV."""

    def __init__(
        self, navigation: Navigation, goal: Goal, velocity_choice: VelocityChoice, return_home: ReturnHome
    ) -> None:
        self._navigation, self._goal = navigation, goal
        self._velocity_choice, self._return_home = velocity_choice, return_home
        self.velocity: Enu | None = None
        """A new velocity to fly, until the application takes it; None if there is no new one."""

    def altimeter(self, above_ground_m: float | None, *, now_ns: int) -> None:
        """The rangefinder has measured the height over whatever is below; None if nothing is within its range."""
        self._navigation.altimeter(above_ground_m, now_ns=now_ns)

    def fix(self, position: Enu, velocity: Enu, survivor: int | None, *, now_ns: int) -> None:
        """A position fix: choose a velocity. `survivor` is the one to whom this UAV flies, if any."""
        self._navigation.fix(position, velocity, now_ns=now_ns)
        if not self._return_home.leaves:
            goal, feed = self._goal.at(survivor, now_ns)
            self.velocity = self._velocity_choice.velocity(goal, feed, now_ns)
        elif self._return_home.land_if_there():
            self.velocity = None
        else:
            self.velocity = self._velocity_choice.velocity(self._return_home.goal, STILL, now_ns)

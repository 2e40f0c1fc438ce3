"""The flight of one UAV as its operator commands it: PX4's modes, and the course that each of them flies.

In the mode of missions without an upload the swarm's own task flies, and nothing of the operator's. While it commands,
the pilot objects to courses of other applications, but for those that avoid a collision.
"""

import math
from collections.abc import Callable
from typing import Final

from agents.ground_control import settings as names
from agents.ground_control.mission_flight import LAND, TAKEOFF, MissionFlight
from agents.ground_control.plans import USUAL_SPEED, Area, RefusedError, Step, allowed
from agents.ground_control.settings import Setting, Settings
from fanet_mw.application import HOME, Course
from fanet_mw.flavors import Mode
from fanet_mw.mavlink import common
from fanet_mw.units import MS, Enu, S

SETPOINT_LASTS_NS: Final = 1000 * MS
"""Velocities of a ground station must come more often than this; afterwards the UAV holds (PX4's COM_OF_LOSS_T)."""
_THERE_M: Final = 2.5
"""A take-off or climb has ended within this distance of its height: a barometer drifts by that much."""
_SINK_M_S: Final = 1.5
_STANDS_M_S: Final = 0.25
_STANDS_NS: Final = 2 * S
"""A UAV that lands stands on the ground when it has sunk more slowly than that for so long; none lands so gently."""
_OBEYS_NS: Final = 15 * S
"""A UAV that has not begun to sink this long after it was told to land stood on the ground already. Until then its
flight controller may still be busy with earlier commands.
"""
_OVER_M: Final = 3.0
"""A landing begins within this distance of its place."""
_INSIDE_M: Final = 3.0
"""This far from the edge of a fence a UAV is well inside."""
_UP_M: Final = 2.5
"""A UAV that climbs, and is this high above the place where it stood, has taken off."""
_CLIMBS_M_S: Final = 0.4
_DRIFTS: Final = 0.1
"""While it stands, the height of its place follows what its instruments say, by this share of the difference."""
_BRAKE_M_S: Final = 5.0
_LOWEST_M: Final = 5.0
"""No simulated flight controller flies to a place below this height, or above the other, over the origin."""
_HIGHEST_M: Final = 1000.0
Say = Callable[[int, str], None]
"""Tells operators something: severity (MAV_SEVERITY) and text."""
_WARNING, _NOTICE = 4, 5


class Pilot:
    """What one UAV is commanded to do, and what it does."""

    def __init__(
        self, *, home: Enu, on_ground: bool, has_task: bool, area_m: Enu | None, settings: Settings, say: Say
    ) -> None:
        """`has_task`: the swarm has a task for it. `area_m`: half of the area that none leaves; None: anywhere."""
        self.home = home
        self.position = home
        self.velocity = Enu(0.0, 0.0, 0.0)
        self.has_task = has_task
        self.mode = Mode.MISSION if has_task else Mode.HOLD
        self.armed = not on_ground
        self._stands_ns: int | None = None
        """The instant since which it has not sunk while it was landing; None: it sinks, or does not land."""
        self._sank = False
        """Whether it has sunk since it was told to land."""
        self.on_ground = on_ground
        self.settings = settings
        self.fence: tuple[Area, ...] = ()
        self.rally: tuple[Enu, ...] = ()
        self.mission = MissionFlight()
        self.speed_m_s: float | None = None
        """The speed that an operator has asked for in flight; None: that of the parameter."""
        self._area_m = area_m
        self._say = say
        self._course: Course | None = None
        self._fly: Course | None = None
        self._setpoint_ns: int | None = None
        self._commanded = False
        """True once it has commanded anything."""
        self._ground_m = home.up
        self.beyond = False
        self._left_fence = False
        """True from when it leaves the fence until it is well inside."""

    @property
    def commands(self) -> bool:
        """True while an operator's commands fly the UAV, and no application of the swarm does."""
        return self._commanded and not (self.mode is Mode.MISSION and self.mission.idle and self.has_task)

    @property
    def flies(self) -> bool:
        return self.armed and not self.on_ground

    @property
    def cruise_m_s(self) -> float:
        return self.settings[names.SPEED] if self.speed_m_s is None else self.speed_m_s

    @property
    def _speeds(self) -> Setting:
        """The parameter of the usual speed, with the least and the greatest one."""
        return self.settings.known[self.settings.index(names.SPEED) or 0]

    def take_course(self) -> Course | None:
        course, self._fly = self._fly, None
        return course

    # --- what operators command; False: not now -------------------------------------------------------------------

    def allows(self, place: Enu) -> bool:
        """True for a place to which an operator may send the UAV: inside the area, the fence, and above the ground."""
        return self._objection(place) is None

    def _objection(self, place: Enu) -> int | None:
        """The MAV_MISSION_RESULT for a place that is out of bounds; None if it is not."""
        area = self._area_m
        why: int | None = None
        if area is not None and abs(place.north) > area.north:
            why = common.MAV_MISSION_INVALID_PARAM5_X
        elif area is not None and abs(place.east) > area.east:
            why = common.MAV_MISSION_INVALID_PARAM6_Y
        elif not _LOWEST_M <= place.up <= _HIGHEST_M:
            why = common.MAV_MISSION_INVALID_PARAM7
        elif not allowed(self.fence, place):
            why = common.MAV_MISSION_INVALID
        return why

    def require_flyable(self, step: Step) -> None:
        """Raise RefusedError if the place of a mission's item is out of bounds; a landing leads to the ground."""
        place = step.place
        if place is None:
            return
        if math.isnan(place.east):
            place = self.home._replace(up=place.up)
        why = self._objection(place._replace(up=max(_LOWEST_M, place.up)) if step.command == LAND else place)
        if why is not None:
            raise RefusedError(why)

    def arm(self) -> bool:
        self.armed = self._commanded = True
        return True

    def disarm(self) -> bool:
        if self.on_ground:
            self.armed = False
            if not self.mission.idle:
                self.hold()
        return self.on_ground

    def take_off(self, up_m: float | None) -> bool:
        """Climb straight up to a height over the origin; None: the parameter's height over home."""
        up_m = self.home.up + self.settings[names.TAKEOFF_HEIGHT] if up_m is None else up_m
        place = self.position._replace(up=up_m)
        if not self.armed or not self.allows(place) or up_m < self.position.up - _THERE_M:
            return False
        self._enter(Mode.TAKEOFF, Course(place, min(3.0, self.cruise_m_s), take_off=True))
        return True

    def land(self) -> bool:
        if self.on_ground:
            return False
        self._enter(Mode.LAND, self._landing_at(self.position))
        return True

    def hold(self) -> bool:
        climbs = self._course is not None and self._course.take_off
        self._enter(Mode.HOLD, None if self.on_ground and not climbs else Course(self.position, _BRAKE_M_S))
        return True

    def go_home(self) -> bool:
        if self.on_ground:
            return False
        self._enter(Mode.RETURN, None)
        self._return()
        return True

    def go_to(self, place: Enu, *, guided: bool) -> bool:
        """Fly to a place and hold there; the mode is then hold, as PX4's is, or remains guided."""
        if not self.flies or not self.allows(place):
            return False
        self._enter(Mode.GUIDED if guided else Mode.HOLD, Course(place, self.cruise_m_s))
        return True

    def guide(self) -> bool:
        """Take setpoints from now on, and hold until one comes."""
        if self.mode is not Mode.GUIDED:
            self._enter(Mode.GUIDED, self._course if self.on_ground else Course(self.position, _BRAKE_M_S))
        return True

    def setpoint(self, place: Enu | None, velocity: Enu | None, now_ns: int) -> bool:
        """One of an operator's setpoints: a place, or a velocity; it counts in the guided mode alone."""
        self._setpoint_ns = now_ns
        if self.mode is not Mode.GUIDED or not self.flies:
            return False
        if velocity is not None:
            speed, most = velocity.norm(), self._speeds.most
            if speed > most:
                speed, velocity = most, Enu(*(part * most / speed for part in velocity))
            course = Course(self.position, max(0.1, speed), velocity)
        else:
            if place is None or not self.allows(place):
                return False
            course = Course(place, self.cruise_m_s)
        self._course = self._fly = course
        return True

    def start_mission(self, now_ns: int) -> bool:
        """Fly the uploaded mission from where it was left; without one, the swarm's own task goes on."""
        if self.mission.steps:
            if not self.armed:
                return False
            self.mission.resume()
            self._enter(Mode.MISSION, None)
            self._fly_step(now_ns)
            return True
        if not self.has_task:
            return False
        self._enter(Mode.MISSION, None)
        self._fly = Course(self.position, HOME)
        return True

    def change_speed(self, speed_m_s: float | None) -> bool:
        """Fly faster or slower until told otherwise; None: as fast as the parameter says, again."""
        if speed_m_s is not None and not self._speeds.least <= speed_m_s <= self._speeds.most:
            return False
        self.speed_m_s = speed_m_s
        course = self._course
        if course is not None and not (course.land or course.take_off) and course.velocity is None:
            self._course = self._fly = course._replace(speed_m_s=self.cruise_m_s)
        return True

    # --- what happens ---------------------------------------------------------------------------------------------

    def on_fix(self, position: Enu, velocity: Enu, now_ns: int) -> None:
        self.position, self.velocity = position, velocity
        if self.on_ground and abs(velocity.up) <= _CLIMBS_M_S:
            self._ground_m += _DRIFTS * (position.up - self._ground_m)
        elif self.on_ground and position.up > self._ground_m + _UP_M:
            self.took_off()  # the swarm's own task may have done so
        if self.mode is Mode.MISSION and not self.mission.idle:
            self._fly_step(now_ns)
        if self.on_ground:
            return
        if self.mode is Mode.LAND or (self._course is not None and self._course.land):
            self._watch_landing(now_ns)
        elif self.mode is Mode.TAKEOFF and self._course is not None:
            if abs(position.up - self._course.position.up) <= _THERE_M:
                self._enter(Mode.HOLD, Course(self._course.position, _BRAKE_M_S))
        elif self.mode is Mode.RETURN:
            self._return()
        elif self.mode is Mode.GUIDED and self._course is not None and self._course.velocity is not None:
            assert self._setpoint_ns is not None, "a velocity came as a setpoint"
            if now_ns - self._setpoint_ns > SETPOINT_LASTS_NS:
                self._say(_WARNING, "No more setpoints: holding")
                self.hold()
        self._watch_fence()

    def took_off(self) -> None:
        self.on_ground, self.armed = False, True

    def silent(self) -> None:
        if not self.commands or self.on_ground:
            return
        action = round(self.settings[names.SILENCE_ACTION])
        if action == 0 or self.mode in (Mode.RETURN, Mode.LAND) or (self.mode is Mode.MISSION and action == 1):
            return
        self._say(_WARNING, "Operator lost: " + ("holding", "returning", "landing")[action - 1])
        (self.hold, self.go_home, self.land)[action - 1]()

    @property
    def _well_inside(self) -> bool:
        here = self.position
        around = ((math.sin(turn), math.cos(turn)) for turn in (math.tau * eighth / 8 for eighth in range(8)))
        return all(
            allowed(self.fence, here._replace(east=here.east + _INSIDE_M * east, north=here.north + _INSIDE_M * north))
            for east, north in around
        )

    # --- how it is done -------------------------------------------------------------------------------------------

    def _enter(self, mode: Mode, course: Course | None) -> None:
        if mode is not Mode.MISSION and self.mode is Mode.MISSION:
            self.mission.pause()
        self._commanded = True
        self.mode = mode
        self._command(course)

    def _command(self, course: Course | None) -> None:
        """Command a course, unless it is the one that is flown already."""
        if course is not None and course != self._course:
            self._fly = course
        self._course = course

    def _return(self) -> None:
        """The next part of a return: up, over, down."""
        here = self.position
        target = min(
            (self.home, *self.rally), key=lambda place: math.hypot(here.east - place.east, here.north - place.north)
        ) if self.rally else self.home  # fmt: skip
        away_m = math.hypot(here.east - target.east, here.north - target.north)
        least_m = min(_HIGHEST_M, self.home.up + self.settings[names.RETURN_HEIGHT])
        if away_m <= _OVER_M:
            self._command(self._landing_at(target._replace(up=0.0)))
        elif here.up < least_m - _THERE_M and away_m > 2 * _OVER_M and not self._crosses:
            self._command(Course(self._column(here)._replace(up=least_m), self.cruise_m_s))
        else:
            up_m = self._course.position.up if self._crosses and self._course else max(least_m, here.up)
            self._command(Course(Enu(target.east, target.north, up_m), self.cruise_m_s))

    @property
    def _crosses(self) -> bool:
        """True if a return is on its way over, when its height is not looked at any more."""
        course = self._course
        if course is None or course.land:
            return False
        return any(course.position[:2] == place[:2] for place in (self.home, *self.rally))

    def _column(self, here: Enu) -> Enu:
        """The place above which a climb stays: that of the climb that is flown already, whatever a fix says."""
        course = self._course
        return here if course is None or course.land else course.position

    def _fly_step(self, now_ns: int) -> None:
        mission = self.mission
        reached = self.settings[names.ACCEPTANCE]
        wanted = mission.fly(self.position, now_ns, reached_m=reached, on_ground=self.on_ground)
        if mission.speed_m_s is not None:
            usual = mission.speed_m_s == USUAL_SPEED
            within_m_s = max(self._speeds.least, min(self._speeds.most, mission.speed_m_s))
            self.speed_m_s = None if usual else within_m_s
            mission.speed_m_s = None
        if mission.returns:
            self._say(_NOTICE, "Mission: returning")
            if not self.go_home():
                self.hold()
        elif wanted is None:
            self._say(_NOTICE, "Mission finished: holding")
            self.hold()
        else:
            self._command(self._course_of(wanted))

    def _course_of(self, step: Step) -> Course | None:
        place, here = step.place, self.position
        if place is None:
            return self._course
        if step.command == TAKEOFF:
            if self._course is not None and self._course.take_off and self._course.position.up == place.up:
                return self._course
            return Course(here._replace(up=place.up), min(3.0, self.cruise_m_s), take_off=True)
        if math.isnan(place.east):
            place = (self._column(here) if self._course is not None else here)._replace(up=place.up)
        if step.command == LAND:
            over_m = math.hypot(here.east - place.east, here.north - place.north)
            landing = self._course is not None and self._course.land
            if landing or over_m <= _OVER_M:
                return self._course if landing else self._landing_at(place)
            place = place._replace(up=max(place.up, here.up) if self._course is None else self._course.position.up)
        return Course(place, self.cruise_m_s)

    def _landing_at(self, place: Enu) -> Course:
        """The course of a landing that begins now; this UAV has not sunk for it yet."""
        self._stands_ns, self._sank = None, False
        return Course(place, _SINK_M_S, land=True)

    def _watch_landing(self, now_ns: int) -> None:
        if self.velocity.up < -_STANDS_M_S:
            self._stands_ns, self._sank = None, True
        elif self._stands_ns is None:
            self._stands_ns = now_ns
        elif now_ns - self._stands_ns >= (_STANDS_NS if self._sank else _OBEYS_NS):
            self.on_ground, self.armed = True, False
            self._ground_m = self.position.up
            self._course = None
            self.mission.landed()
            self.mode = Mode.HOLD
            self._say(_NOTICE, "Landed and disarmed")

    def take_fence(self, areas: tuple[Area, ...]) -> None:
        self.fence, self._left_fence = areas, False

    def _watch_fence(self) -> None:
        """Act once the UAV has left the fence, and not again before it is well inside: fixes at its edge are noisy."""
        self.beyond = not allowed(self.fence, self.position)
        if self._left_fence or not self.beyond:
            self._left_fence = self._left_fence and not self._well_inside
            return
        self._left_fence = True
        action = round(self.settings[names.FENCE_ACTION])
        if action == 0:
            return
        if self.mode is Mode.LAND or (self.mode is Mode.RETURN and action in (2, 3)):
            action = 1  # it does as much already
        self._say(
            _WARNING - 2, "Beyond the geofence" + {2: ": holding", 3: ": returning", 5: ": landing"}.get(action, "")
        )
        if action in (2, 3, 5):
            {2: self.hold, 3: self.go_home, 5: self.land}[action]()

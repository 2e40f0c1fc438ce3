"""One UAV's side of a ground station, flown by a simple model: what is said to it, and what it answers."""

import math
from typing import Any

from agents.applications.telemetry_streams import TelemetryStreams
from agents.ground_control.application import GroundControl
from fanet_mw import mavlink
from fanet_mw.application import Course
from fanet_mw.bus.messages import Gps
from fanet_mw.mavlink import Geodetic, common
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import MS, STILL, Enu, NodeId, S

NODE = NodeId(1)
GCS = (255, 190)
LAT, LON = 37.5665, 126.978
FIX_NS = 200 * MS


def scenario(**changes: Any) -> Scenario:
    return config.build(
        {
            "nodes": {"count": 2, "on_ground": True, "altitude_m": 20},
            "clusters": {"count": 1},
            "mobility": {"model": "onboard", "speed_m_s": 10},
            "traffic": {"arrivals": "none"},
            "world": {"area_m": 1000},
            **changes,
        }
    )


class Bench:
    """`GroundControl` with its port, and a point that flies its courses."""

    def __init__(self, chosen: Scenario | None = None, *, at: Enu = STILL) -> None:
        self.scenario = chosen or scenario()
        self.node = NODE
        self.now_ns = 0
        self.position, self.velocity = at, Enu(0.0, 0.0, 0.0)
        self.courses: list[Course] = []
        self.heard: list[Any] = []
        """All that was put on the tap, decoded."""
        self.numbers: list[int] = []
        self.reports_ns: list[int] = []
        """The instants at which it sent something over the air."""
        self.streams = TelemetryStreams(NODE, position=at, telemetry_hz=0)
        self.control = GroundControl(self.scenario, NODE, self.streams, position=at)
        self.control.start(self, 0)  # type: ignore[arg-type]

    # --- the port -------------------------------------------------------------------------------------------------

    def fly(self, course: Course) -> None:
        self.courses.append(course)

    def tap(self, frames: bytes) -> None:
        decoded = mavlink.decode(frames)
        self.heard += decoded
        self.numbers += [message.get_seq() for message in decoded]

    def send(self, content: bytes, **_: object) -> int:
        self.reports_ns.append(self.now_ns)
        return len(self.reports_ns)

    # --- what is done ---------------------------------------------------------------------------------------------

    def say(self, *messages: Any, sender: tuple[int, int] = GCS) -> list[Any]:
        """Say something as a ground station; returns what is answered at once."""
        mav = common.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])
        before = len(self.heard)
        self.control.on_operator(b"".join(bytes(message.pack(mav)) for message in messages), self.now_ns)
        return self.heard[before:]

    def command(self, number: int, *params: float, sender: tuple[int, int] = GCS) -> int:
        """Say a COMMAND_LONG; returns the result that acknowledges it."""
        seven = [*params, *[0.0] * (7 - len(params))]
        answers = self.say(common.MAVLink_command_long_message(1, 1, number, 0, *seven), sender=sender)
        (ack,) = [answer for answer in answers if answer.get_type() == "COMMAND_ACK"]
        assert (ack.command, ack.target_system, ack.target_component) == (number, *sender)
        return int(ack.result)

    def run(self, seconds: float, *, heartbeats: bool = True) -> None:
        """Let time pass: the point flies, the receiver gives fixes, and the operator's heartbeats come."""
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            self.now_ns += FIX_NS
            self._move(FIX_NS / S)
            if heartbeats and self.now_ns % S == 0:
                self.say(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            due_ns = self.control.next_wake_ns()
            if due_ns is not None and due_ns <= self.now_ns:
                self.control.wake(self.now_ns)
            fix = Gps(self.now_ns, self.position, self.velocity)
            self.streams.fix(fix)
            self.control.on_fix(fix, self.now_ns)

    def _move(self, seconds: float) -> None:
        if not self.courses:
            return
        course, here = self.courses[-1], self.position
        goal = (
            here._replace(up=0.0)
            if course.land
            else here._replace(up=course.position.up)
            if course.take_off
            else course.position
        )
        wanted = course.velocity or goal.minus(here)
        speed = course.speed_m_s if course.velocity is None else wanted.norm()
        step = min(wanted.norm(), speed * seconds) if course.velocity is None else speed * seconds
        share = step / wanted.norm() if wanted.norm() else 0.0
        moved = Enu(wanted.east * share, wanted.north * share, wanted.up * share)
        self.position = Enu(here.east + moved.east, here.north + moved.north, max(0.0, here.up + moved.up))
        self.velocity = Enu(moved.east / seconds, moved.north / seconds, (self.position.up - here.up) / seconds)

    # --- what is read ---------------------------------------------------------------------------------------------

    def told(self, kind: str) -> list[Any]:
        return [message for message in self.heard if message.get_type() == kind]

    @property
    def flown(self) -> Any:
        return self.streams.flown

    def airborne(self, up_m: float = 20.0) -> "Bench":
        """Take off as an operator, and hover."""
        assert self.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        assert self.command(common.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, up_m) == 0
        self.run(up_m / 3 + 2)
        assert abs(self.position.up - up_m) < 0.5
        return self


def degrees(east: float, north: float) -> tuple[int, int]:
    place = mavlink.to_geodetic(Enu(east, north, 0.0), Geodetic(LAT, LON, 0.0))
    return round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)

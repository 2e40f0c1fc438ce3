"""Search and rescue as an application of a node, in two kinds of which a node runs one: by the rule of the paper
("Reliable Flying IoT Networks for UAV Disaster Rescue Operations", section 4.1), or as a search planned in the air.

Both have the name `report`, by which results count the reports of survivors, whichever of the two has sent them.
"""

from typing import Final

from agents.mission.courses import course_at
from agents.mission.finding.plausibility import Plausibility
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.mission.navigation.silent_neighbors import HeardByRadio
from agents.mission.outbox import Outbox
from agents.mission.paper_rule import PaperRule
from agents.mission.searcher import Searcher, phone_model
from fanet_mw.application import Application, AppPort, Received
from fanet_mw.bus.messages import Gps, SensorReading, WifiScan
from fanet_mw.errors import MalformedFrameError
from fanet_mw.geodesy import Geodetic
from fanet_mw.node.reader import decoded, motion_in
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire import BIDS, FOUND, ORDER, ROLL, SEARCH, STATUS, SURVIVOR
from fanet_mw.wire.search_messages import Told, ToldOrder, told_in
from fanet_mw.wire.search_plan import Search, SearchStatus
from fanet_mw.wire.survivors import Found, Standing, Survivor


class Rescue(Application):
    """The rescue by the paper's rule, at one UAV."""

    name: Final = "report"
    listens = (SURVIVOR.msgid,)

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._outbox = Outbox()
        self._rule = PaperRule(scenario, node, self._outbox)

    def on_message(self, message: Received, now_ns: int) -> None:
        report = Survivor.decode_frame(message.frame)
        if report.reporter != message.origin:
            raise MalformedFrameError(f"report of {report.reporter} by {message.origin}")
        self._rule.reported(report, position=self.port.position, now_ns=now_ns)
        self.port.tap(message.frame)
        self._outbox.empty(self.port)

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self._rule.moved(fix.position, now_ns=now_ns)
        self._outbox.empty(self.port)

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, WifiScan):
            self._rule.scan(reading.heard, position=self.port.position, now_ns=now_ns)
            self._outbox.empty(self.port)

    def wake(self, now_ns: int) -> None:
        self._rule.wake(now_ns)
        self._outbox.empty(self.port)

    def next_wake_ns(self) -> int | None:
        return self._rule.next_wake_ns()


class PlannedSearch(Application):
    """The planned search at one UAV: its inputs go to a searcher, and the searcher's decisions go out."""

    name: Final = "report"
    listens = (
        SURVIVOR.msgid, SEARCH.msgid, STATUS.msgid, BIDS.msgid, FOUND.msgid, ROLL.msgid, ORDER.msgid,
    )  # fmt: skip

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        *,
        position: Enu,
        onboard_map: OnboardMap = NO_MAP,
        limits: SearchLimits | None = None,
        radio: HeardByRadio | None = None,
    ) -> None:
        """`limits`: what an operator may change. `radio`: what the search asks its node about links."""
        self._outbox = Outbox()
        self._searcher = Searcher(
            scenario, node, position=position, outbox=self._outbox, onboard_map=onboard_map,
            limits=limits or SearchLimits(scenario), radio=radio,
        )  # fmt: skip
        self._plausibility = Plausibility(phone_model(scenario))
        self._origin = Geodetic(*scenario.world.origin_deg, 0.0)
        self._bad_positions = 0
        """The number of hellos without a credible position."""

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        self._searcher.start(now_ns)

    def on_message(self, message: Received, now_ns: int) -> None:
        for told in told_in(message.frame):
            if _sole_origin(told) not in (None, message.origin):
                raise MalformedFrameError(f"{type(told).__name__} of {_sole_origin(told)} by {message.origin}")
            if not self._plausibility.holds(told, now_ns=now_ns):
                raise MalformedFrameError(f"{told} at {now_ns} ns")
            self._searcher.on_message(told, now_ns=now_ns)
        self.port.tap(message.frame)
        self._settle()

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        messages = decoded(frame, told_in)
        heard = motion_in(frame, own=self.port.node, now_ns=now_ns, place=self._origin)
        if heard is None:
            self._bad_positions += 1
            return
        origin, motion = heard
        self._searcher.hello(origin, motion, now_ns=now_ns)
        for told in messages:
            if self._plausibility.holds(told, now_ns=now_ns):  # else the sender passes on what another one has made up
                self._searcher.on_message(told, flooded=False, now_ns=now_ns)
        self._settle()

    def hello_frames(self, now_ns: int) -> bytes:
        return self._searcher.hello_frames(now_ns)

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self._searcher.fix(fix.position, fix.velocity, now_ns=now_ns)
        self._settle()

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        self._searcher.on_sensor(reading, now_ns=now_ns)
        self._settle()

    def wake(self, now_ns: int) -> None:
        self._searcher.wake(now_ns)
        self._settle()

    def next_wake_ns(self) -> int | None:
        return self._searcher.next_wake_ns()

    def report(self) -> dict[str, int]:
        return {"bad_positions": self._bad_positions}

    def _settle(self) -> None:
        velocity = self._searcher.take_velocity()
        if velocity is not None:
            self._outbox.course = course_at(self.port.position, velocity)
        self._outbox.empty(self.port)


def _sole_origin(told: Told) -> int | None:
    """The only node that may flood this message; None for what any node may repeat."""
    if isinstance(told, Survivor):
        return told.reporter
    if isinstance(told, Search):
        return told.planner
    if isinstance(told, SearchStatus):
        return told.node
    if isinstance(told, ToldOrder):
        return told.post
    return None if not isinstance(told, Found) or told.standing is not Standing.ESTIMATED else told.node

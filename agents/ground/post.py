"""The post on the ground as an application of its node: it takes in all that the swarm tells of survivors.

Finds reach it as floods where a chain of UAVs does, and in the hellos of UAVs that come within its reach later
(`agents/mission/finding/announcing.py`).
"""

from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.plausibility import Plausibility
from agents.mission.searcher import phone_model
from fanet_mw.application import Application, Received
from fanet_mw.node.reader import decoded
from fanet_mw.scenario import Scenario
from fanet_mw.trace import KnownOnGround
from fanet_mw.wire import BIDS, COVERED, FOUND, ROLL, SEARCH, STATUS, SURVIVOR
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.survivors import Found, Standing


class Post(Application):
    """What the post knows of survivors."""

    name: Final = "report"
    listens = (SURVIVOR.msgid, SEARCH.msgid, STATUS.msgid, BIDS.msgid, FOUND.msgid, COVERED.msgid, ROLL.msgid)

    def __init__(self, scenario: Scenario) -> None:
        model = phone_model(scenario)
        self.survivors = KnownSurvivors(model)
        self._plausibility = Plausibility(model)

    def on_message(self, message: Received, now_ns: int) -> None:
        self._take(message.frame, now_ns)
        self.port.tap(message.frame)

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        self._take(frame, now_ns)

    def _take(self, frame: bytes, now_ns: int) -> None:
        for told in decoded(frame, told_in):
            if not isinstance(told, Found) or not self._plausibility.holds(told, now_ns=now_ns):
                continue
            if self.survivors.on_found(told, now_ns=now_ns) and told.standing is not Standing.REFUTED:
                east_m, north_m = round(told.east_m, 2), round(told.north_m, 2)
                self.port.record(KnownOnGround(now_ns, self.port.node, told.survivor, east_m, north_m))

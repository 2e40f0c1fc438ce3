"""The parts of one UAV's search that act in time, wired as in a search of 45 UAVs."""

import math

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from agents.mission.flight.goal import Goal
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.search_formation.pattern import fitted
from agents.mission.search_formation.search_place import SearchPlace
from agents.mission.search_formation.shapes.contract import Demands
from agents.mission.tasking.absence import Absence, Connection
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.bidding import Bidding
from fanet_mw.scenario import config
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.search_plan import Search
from fanet_mw.wire.survivors import Survivor

MODEL = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
REACH_M = 250.0
COUNT = 45
UP_M = 65.0
SCENARIO = config.build(
    {"nodes": {"count": COUNT}, "clusters": {"count": 1}, "mission": {"survivors": 3}, "world": {"area_m": 2500}}
)


def a_plan() -> Search:
    pattern = fitted(COUNT, Demands(area_m=2500, seen_m=131, reach_m=REACH_M, height_m=UP_M, speed_m_s=7.5))
    assert pattern is not None
    return plan_of(pattern, tuple(range(1, COUNT + 1)), planner=1, start_us=10_000_000, deploy_ds=500)


OPEN = KnownObstacles(NO_MAP)
PLAN = a_plan()
TAKEN_UP_NS = 60 * S
FOLLOWER, LINE = NodeId(COUNT), NodeId(5)


class Board:
    """The parts of one UAV, wired as in a search."""

    def __init__(
        self,
        node: NodeId,
        at: Enu,
        *,
        plan: Search | None = PLAN,
        connection: Connection = "always",
        looked_at: LookedAt | None = None,
        look_m: float = math.inf,
    ) -> None:
        self.out = Outbox()
        self.survivors = KnownSurvivors(MODEL)
        self.own_motion, self.neighbors = OwnMotion(at, OPEN), NeighborMotions()
        self.place = SearchPlace(node, self.own_motion, reach_m=REACH_M, look_m=look_m)
        if plan is not None:
            self.place.adopt(plan, 0)
        self.approach = Approach(
            node, self.survivors, self.own_motion, self.neighbors, self.out,
            arrival_m=30, speed_m_s=10.0, looked_at=looked_at or LookedAt(),
        )  # fmt: skip
        absence = Absence(self.place, connection, speed_m_s=10.0)
        self.tasks = Bidding(
            SCENARIO, node, survivors=self.survivors, own_motion=self.own_motion, formation=self.place,
            approach=self.approach, absence=absence, outbox=self.out, speed_m_s=10.0,
        )  # fmt: skip
        self.goal = Goal(self.survivors, self.own_motion, self.place, self.approach, None, None, absence=absence)
        self.announcing = Announcing(node, self.survivors, self.out)

    def hear(self, survivor: int, truth: Enu, reporters: range, *, now_ns: int) -> None:
        """Each of these nodes reports a phone from three places on two sides of it."""
        for node in reporters:
            for step in (-60, 0, 60):
                at = Enu(truth.east + (40 if node % 2 else -60), truth.north + step + node, UP_M)
                rssi_dbm = MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm())
                report = Survivor(now_ns // US, survivor, node, at, rssi_dbm)
                self.survivors.take_report(report, now_ns=now_ns)


def lane_of(node: int, at_ns: int) -> Enu:
    place = SearchPlace(NodeId(node), OwnMotion(Enu(0, 0, UP_M), OPEN), reach_m=REACH_M)
    place.adopt(PLAN, 0)
    return place.lane(at_ns)[0]

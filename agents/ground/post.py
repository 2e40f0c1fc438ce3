"""The post on the ground as an application of its node: it takes in what the swarm tells, and gives orders.

finds    reach it as floods where a chain of UAVs does, and in the hellos of UAVs that come within its reach later
         (`agents/mission/finding/announcing.py`)
orders   are flooded several times, and said in its hellos, all in turn; UAVs tell them on (`agents/mission/orders.py`)
"""

import math
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.plausibility import Plausibility
from agents.mission.orders import record_of
from agents.mission.search_formation.formation_planner import pattern_of
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.searcher import phone_model
from fanet_mw.application import Application, Received
from fanet_mw.node.reader import decoded
from fanet_mw.orders import Order, is_told, wrong
from fanet_mw.scenario import Scenario
from fanet_mw.serial_number import newer
from fanet_mw.trace import KnownOnGround
from fanet_mw.units import US, NodeId, S, seconds_to_ns
from fanet_mw.wire import BIDS, FOUND, ORDER, PRIORITY_SAFETY, ROLL, SEARCH, STATUS, SURVIVOR
from fanet_mw.wire.search_messages import Roll, ToldOrder, told_in
from fanet_mw.wire.search_plan import Search, SearchStatus
from fanet_mw.wire.survivors import Found, Standing

_TELLINGS: Final = 3
"""The number of times that an order is flooded."""
_AGAIN_NS: Final = 5 * S
"""The time between two of these floods."""
_IN_HELLO: Final = 2
_MOST_ORDERS: Final = 1000
_NUMBER_NS: Final = 10 * S
"""Numbers of orders count up at least as fast as this time passes, so that a post that was started again begins above
its earlier ones.
"""
_NUMBERS: Final = 1 << 16
_SILENT_NS: Final = 70 * S
"""After this time without a status a UAV is chosen only if all others are as silent, or lost."""

_REVISION_BITS = 16


class KnownUavs:
    """The latest status of each UAV, the newest plan, and who is lost by the rolls that reach the post."""

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        """`node`: the post itself."""
        self._calls = RollCall(node, hello_interval_s=scenario.routing.hello_interval_s)
        self._reach_m = scenario.radio.range_m
        self._statuses: dict[int, SearchStatus] = {}
        self._plan: Search | None = None

    def on_status(self, status: SearchStatus) -> None:
        before = self._statuses.get(status.node)
        if before is None or status.t_us > before.t_us:
            self._statuses[status.node] = status

    def on_plan(self, plan: Search) -> None:
        if self._plan is None or newer(plan.revision, self._plan.revision, bits=_REVISION_BITS):
            self._plan = plan

    def on_roll(self, roll: Roll, *, now_ns: int) -> None:
        self._calls.on_roll(roll, self._plan, now_ns=now_ns)

    def _is_lost(self, status: SearchStatus) -> bool:
        """True if the UAV was called lost and has said nothing since."""
        lost_ns = self._calls.lost.get(status.node)
        return lost_ns is not None and status.t_us * US <= lost_ns

    def nearest(self, east_m: float, north_m: float, *, now_ns: int) -> int | None:
        """The nearest follower that takes part in the search, otherwise the nearest UAV that does; None without any.
        UAVs that were silent for long come after all others, and lost ones after those.
        """
        followers: set[int] = set()
        if self._plan is not None:
            places = pattern_of(self._plan, reach_m=self._reach_m).followers
            followers = {self._plan.nodes[place] for place in places if place < len(self._plan.nodes)}
        found = [
            (
                self._is_lost(at),
                now_ns - at.t_us * US > _SILENT_NS,
                node not in followers,
                math.hypot(at.position.east - east_m, at.position.north - north_m),
                node,
            )
            for node, at in self._statuses.items()
            if at.charge > 0
        ]
        return min(found)[-1] if found else None


class Post(Application):
    """What the post knows of survivors and UAVs, and its orders."""

    name: Final = "report"
    listens = (
        SURVIVOR.msgid, SEARCH.msgid, STATUS.msgid, BIDS.msgid, FOUND.msgid, ROLL.msgid, ORDER.msgid,
    )  # fmt: skip

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        model = phone_model(scenario)
        self.survivors = KnownSurvivors(model)
        self._uavs = KnownUavs(scenario, node)
        self._plausibility = Plausibility(model)
        self._planned = sorted((seconds_to_ns(entry.at_s), index) for index, entry in enumerate(scenario.orders))
        self._orders = [entry.what for entry in scenario.orders]
        self.asked: list[Order] = []
        """The orders of operators that are given at the next wake-up."""
        self._refused = 0
        self._given: list[ToldOrder] = []
        self._number = 0
        self._tellings: list[tuple[int, int, ToldOrder]] = []
        """When an order is flooded next, and how often it still is."""
        self._in_hellos = 0

    # --- what it learns -------------------------------------------------------------------------------------------

    def on_message(self, message: Received, now_ns: int) -> None:
        self._take(message.frame, now_ns)
        self.port.tap(message.frame)

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        self._take(frame, now_ns)

    def _take(self, frame: bytes, now_ns: int) -> None:
        for told in decoded(frame, told_in):
            if isinstance(told, SearchStatus):
                self._uavs.on_status(told)
            elif isinstance(told, Search):
                self._uavs.on_plan(told)
            elif isinstance(told, Roll):
                self._uavs.on_roll(told, now_ns=now_ns)
            elif isinstance(told, Found) and self._plausibility.holds(told, now_ns=now_ns):
                self._on_found(told, now_ns)

    def _on_found(self, found: Found, now_ns: int) -> None:
        if self.survivors.on_found(found, now_ns=now_ns) and found.standing is not Standing.REFUTED:
            east_m, north_m = round(found.east_m, 2), round(found.north_m, 2)
            self.port.record(KnownOnGround(now_ns, self.port.node, found.survivor, east_m, north_m))

    # --- what it orders -------------------------------------------------------------------------------------------

    def give(self, order: Order, now_ns: int, *, planned_ns: int | None = None) -> str | None:
        """Give an order; returns why that is not possible, or None.

        A planned one has the time and the number of its plan: it is the same order if the post is started again.
        """
        why = wrong(order, uavs=self.port.scenario.nodes.count)
        if why is not None or len(self._given) >= _MOST_ORDERS:
            return why or f"{_MOST_ORDERS} orders were given already"
        if not is_told(order):
            chosen = self._uavs.nearest(order.east_m, order.north_m, now_ns=now_ns)
            if chosen is None:
                return "no UAV that takes part has been heard"
            order = order._replace(node=chosen)
        given_ns = now_ns if planned_ns is None else planned_ns
        self._number = max(self._number + 1, given_ns // _NUMBER_NS)
        told = ToldOrder(given_ns // US, self.port.node, self._number % _NUMBERS or _NUMBERS - 1, order)
        self._given.append(told)
        self._tellings.append((now_ns, _TELLINGS, told))
        self.port.record(record_of(told, self.port.node, now_ns))
        self._tell(now_ns)
        return None

    def wake(self, now_ns: int) -> None:
        while self._planned and self._planned[0][0] <= now_ns:
            planned_ns, index = self._planned.pop(0)
            self._refused += self.give(self._orders[index], now_ns, planned_ns=planned_ns) is not None
        asked, self.asked = self.asked, []
        self._refused += sum(self.give(order, now_ns) is not None for order in asked)
        self._tell(now_ns)

    def next_wake_ns(self) -> int | None:
        if self.asked:
            return 0  # at once
        planned = [self._planned[0][0]] if self._planned else []
        return min([*planned, *(due_ns for due_ns, _, _ in self._tellings)], default=None)

    def _tell(self, now_ns: int) -> None:
        due = [telling for telling in self._tellings if telling[0] <= now_ns]
        self._tellings = [telling for telling in self._tellings if telling[0] > now_ns]
        for _, left, told in due:
            self.port.send(told.encode_frame(self.port.node), priority=PRIORITY_SAFETY)
            if left > 1:
                self._tellings.append((now_ns + _AGAIN_NS, left - 1, told))

    def report(self) -> dict[str, int]:
        return {"orders_given": len(self._given), "orders_refused": self._refused}

    def hello_frames(self, now_ns: int) -> bytes:
        """The inner frames for the next hello: the newest order, and the others in turn."""
        newest, others = self._given[-1:], self._given[:-1]
        turn = self._in_hellos % max(1, len(others))
        self._in_hellos += 1
        chosen = [*newest, *others[turn : turn + _IN_HELLO - 1]]
        return b"".join(told.encode_frame(self.port.node) for told in chosen)

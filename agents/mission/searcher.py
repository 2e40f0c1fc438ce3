"""One UAV's part in a planned search: it keeps its lane, reports, bids, responds, confirms, and keeps clear of others.

    plan over the air   -> a lane: where to be at every instant of swarm time
    phones in reach     -> reports: flooded, and passed from neighbor to neighbor with hellos
    enough reporters    -> an auction; winners leave their lanes as far as the swarm's coherence lets them
    too few reporters   -> the auction names one that has not reported, who fetches a further bearing
    seen at close range -> confirmed, announced, struck off; responders return to their lanes

Everything it knows it has sensed or was told over the air. Each fix gives one velocity: the wanted one, changed as
little as its constraints allow; first to keep clear of others, then to stay in reach of those it is tied to.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, assert_never

from agents.mission.auction import Auction
from agents.mission.chart import Chart
from agents.mission.constraints import avoiding, grown_m, staying_near
from agents.mission.finds import Find, Finds, ground_place
from agents.mission.half_planes import HalfPlane, nearest
from agents.mission.obstacles import Obstacles
from agents.mission.outbox import Outbox, Packet, ReportFormat
from agents.mission.pattern import Pattern, fitted
from agents.mission.phone_filter import REFERENCE_LOSS_DB, Estimate, PhoneModel
from agents.mission.planner import STATUS_S, Planner, pattern_of
from agents.mission.speed import approach_speed_m_s
from fanet_mw.bus.messages import Echo
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Arrived, Confirmed, Detected, Planned
from fanet_mw.units import MAX_NODES, MS, US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Bid, Bids, Found, Search, Status, Told, encode_bids

_OFFSET_DB: Final = 1.0
"""How much one phone's power is taken to differ from another's: standard deviation."""
_REVIEW_NS: Final = 1 * S
_HEARD_FOR_NS: Final = seconds_to_ns(6.0)
"""A neighbor that was not heard for so long is no longer avoided, nor are we tied to it."""
_FIX_GAIN: Final = 0.15
"""Weight of a position fix against dead reckoning by its velocity."""
_LANE_GAIN: Final = 0.4
"""How fast a deviation from the lane is made good [1/s]."""
_RANGED_NS: Final = 1 * S
"""A height over the ground is used for so long."""
_CLIMB_M_S: Final = 2.5
_LEVEL_M: Final = 4.0
"""Heights farther apart than twice this are different levels: nobody there is in the way, once both keep theirs."""
_CLEARANCE_M: Final = 10.0
_HORIZON_S: Final = 6.0
_WATCH_M: Final = 150.0
_TETHER: Final = 0.95
"""Share of the radio's reach at which a tether ends."""
_TETHER_S: Final = 4.0
_FREE_REACH: Final = 0.84
"""Share of the reach within which a follower stays of its line, so that it is heard there wherever it goes."""
_VAGUE_M: Final = 50.0
"""An estimate whose standard deviation is larger leads nobody off its lane."""
_SHARED_M: Final = 35.0
"""An estimate so near to the border of two lanes belongs to both."""
_ASIDE_M: Final = 70.0
"""How far aside of the leash a survivor may be to be looked at still."""
_FAR_M: Final = 450.0
"""Who is farther from a survivor than this leaves it to others."""
_AHEAD_M: Final = 250.0
_STILL: Final = Enu(0.0, 0.0, 0.0)
_LEAST_M_S: Final = 1.0
"""Nobody creeps around a corner more slowly than this."""
_LEASH_M: Final = 58.0
"""How far to the side a UAV of a line may leave its lane."""
_LAG_M: Final = 140.0
"""How far it may fall behind its line."""
_SCOUT_AFTER_NS: Final = 4 * S
"""How long a survivor may be short of reporters before somebody is sent to be another one."""
_CLOSE_M: Final = 100.0
"""Slant range of a sighting that confirms."""
_ANGLE_RAD: Final = 0.03
"""Standard deviation of where a camera looks, attitude included."""
_SIGHTINGS: Final = 2
_SURE_M: Final = 3.5
"""A find is confirmed when its place is known to this standard deviation."""
_CONFIRMATIONS: Final = 3
_CONFIRM_AGAIN_NS: Final = 7 * S
_WORSE: Final = 0.8
"""An estimate is told again when its standard deviation has shrunk to this share."""
_SPIRAL_M: Final = 30.0
"""Distance of the turns of the spiral that is flown around an estimate which nobody is seen at."""
_RETURN_AFTER_S: Final = 45.0
"""A responder that has found nobody for so long takes its bid back."""
_RING_M: Final = 14.0
_GOLDEN_ANGLE: Final = math.pi * (3 - math.sqrt(5))


class Heard(NamedTuple):
    """A neighbor's motion as its hello told it."""

    position: Enu
    velocity: Enu
    at_ns: int

    def now(self, now_ns: int) -> Enu:
        seconds = (now_ns - self.at_ns) / S
        return Enu(
            self.position.east + self.velocity.east * seconds,
            self.position.north + self.velocity.north * seconds,
            self.position.up + self.velocity.up * seconds,
        )


@dataclass
class _Response:
    """The task that is being flown."""

    survivor: int
    began_ns: int
    announced: bool = False


class Searcher:
    """One UAV."""

    def __init__(self, scenario: Scenario, node: NodeId, *, position: Enu, outbox: Outbox, chart: Chart) -> None:
        mission = scenario.mission
        self._node = node
        self._config = mission
        self._reach_m = scenario.radio.range_m
        self._most_m_s = approach_speed_m_s(scenario, node)
        self._config_speed_m_s = max(0.1, scenario.mobility.speed_m_s)
        self._report_ns = seconds_to_ns(mission.report_interval_s)
        self._random = stream(scenario.seed, "mission", node).random
        self._heights = scenario.nodes.altitude_m
        model = phone_model(scenario)
        self._fitted = formation(scenario, scenario.nodes.count)
        least_m_s, _ = mission.approach_speeds_m_s
        self._planner = Planner(node, expected=scenario.nodes.count, deploy_speed_m_s=0.9 * least_m_s)
        self._auction = Auction(node)
        self.finds = Finds(model)
        self._outbox = outbox
        self._report_format = ReportFormat(scenario, node)
        self.velocity: Enu | None = None
        """A new velocity to fly, for the host to take."""
        self._position, self._own_velocity = position, Enu(0.0, 0.0, 0.0)
        self._fix_ns: int | None = None
        self._scan_ns = 0
        self._above_ground: tuple[float, int] | None = None
        self._neighbors: dict[int, Heard] = {}
        self._obstacles = Obstacles(chart, scenario.world.no_fly_m)
        self._pattern: Pattern | None = None
        self._place: int | None = None
        self._left_from: Enu | None = None
        self._left_ns = 0
        self._response: _Response | None = None
        self._told_ns: dict[int, int] = {}
        self._told_sigma: dict[int, float] = {}
        self._confirming: dict[int, tuple[int, int]] = {}
        """Of our own finds: how often they are still to be announced, and when next."""
        self._struck_ns: dict[int, int] = {}
        self._arrived_ns: dict[int, int] = {}
        self._bid_ns: dict[int, int] = {}
        self._next_review_ns: int | None = None
        self._next_status_ns = 0

    # --- the actor's side -----------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._next_review_ns = now_ns + round(self._random() * _REVIEW_NS)
        self._next_status_ns = now_ns + round(self._random() * 2 * S)

    def next_wake_ns(self) -> int | None:
        return self._next_review_ns

    def wake(self, now_ns: int) -> None:
        if self._next_review_ns is None or now_ns < self._next_review_ns:
            return
        self._next_review_ns = now_ns + _REVIEW_NS
        if now_ns - self._scan_ns > 1.5 * self._config.scan_interval_s * S:
            self.scan((), now_ns=now_ns)  # a receiver that hears nobody says nothing
        if now_ns >= self._next_status_ns:
            self._say_status(now_ns)
        if self._planner.review(self._fitted, now_ns=now_ns):
            self._adopt(now_ns)
        plans, self._planner.to_tell = self._planner.to_tell, []
        self._outbox.packets += [Packet(plan.encode_frame(self._node)) for plan in plans]
        for survivor in self.finds.open():
            self._confirm(survivor, now_ns)
        self._tell_finds(now_ns)
        self._bid(now_ns)
        self._choose(now_ns)

    # --- what comes in --------------------------------------------------------------------------------------------

    def fix(self, position: Enu, velocity: Enu, *, now_ns: int) -> None:
        """A position fix: where we are, and then how to fly on."""
        if self._fix_ns is None:
            self._position = position
        else:
            seconds, k = (now_ns - self._fix_ns) / S, _FIX_GAIN
            here = Heard(self._position, velocity, 0).now(round(seconds * S))
            off = position.minus(here)
            self._position = Enu(here.east + k * off.east, here.north + k * off.north, here.up + k * off.up)
        self._fix_ns, self._own_velocity = now_ns, velocity
        self.velocity = self._steer(now_ns)

    def scan(self, heard: Sequence[tuple[int, float]], *, now_ns: int) -> None:
        """Our own receiver hears these phones, and no others."""
        self._scan_ns = now_ns
        ours = {survivor for survivor, _ in heard}
        for survivor in self.finds.open():
            if survivor not in ours:
                self.finds.known[survivor].filter.silent(self._position)
        for survivor, rssi_dbm in heard:
            report = Survivor(now_ns // US, survivor, self._node, self._position, rssi_dbm)
            find = self.finds.known.get(survivor)
            if find is None or self._node not in find.reporters:
                self._outbox.records.append(Detected(now_ns, self._node, survivor, round(rssi_dbm, 2)))
            find = self.finds.report(report, now_ns=now_ns, own=True)
            last_ns = self._told_ns.get(survivor)
            if find.confirmed is None and (last_ns is None or now_ns - last_ns >= self._report_ns):
                self._told_ns[survivor] = now_ns
                self._outbox.packets.append(self._report_format.packet(report))

    def altimeter(self, above_ground_m: float | None, *, now_ns: int) -> None:
        """The rangefinder tells how high we are over whatever is below; None: nothing is within its range."""
        if above_ground_m is not None:
            self._above_ground = above_ground_m, now_ns

    def radar(self, echoes: Sequence[Echo], *, now_ns: int) -> None:
        """Our radar shows what is around us."""
        if "radar" in self._config.avoid_by:
            neighbors = [heard.now(now_ns) for heard in self._lately_heard(now_ns)]
            self._obstacles.radar(
                echoes, at=self._position, velocity=self._own_velocity, neighbors=neighbors, now_ns=now_ns
            )

    def _height_m(self, now_ns: int) -> float:
        """Over the ground, as far as a rangefinder has told lately and no roof is below us; else by the map."""
        ranged = self._above_ground is not None and now_ns - self._above_ground[1] <= _RANGED_NS
        if ranged and self._above_ground is not None and self._obstacles.roof_m(self._position) is None:
            return self._above_ground[0]
        return self._position.up - self._obstacles.ground_m(self._position)

    def camera(self, people: Sequence[tuple[float, float]], *, now_ns: int) -> None:
        """Our camera shows people at these bearings and elevations [rad]."""
        for bearing_rad, elevation_rad in people:
            here = self._position._replace(up=self._height_m(now_ns))
            looked = ground_place(here, bearing_rad=bearing_rad, elevation_rad=elevation_rad)
            if looked is None or looked[2] > 2 * _CLOSE_M:
                continue
            sigma_m = max(1.0, _ANGLE_RAD * looked[2] * looked[2] / max(1.0, here.up))
            at = Enu(looked[0], looked[1], 0.0)
            survivor = self.finds.seen(at, by=here, sigma_m=sigma_m, now_ns=now_ns)
            if survivor is not None and looked[2] <= _CLOSE_M:
                self._confirm(survivor, now_ns)

    def hello(self, origin: int, heard: Heard, *, now_ns: int) -> None:
        """A neighbor's hello told how it flies."""
        self._neighbors[origin] = heard
        self._planner.alive(origin, heard.position, now_ns=now_ns)

    def reported(self, report: Survivor, *, now_ns: int) -> None:
        """Another node hears a phone."""
        if report.reporter == self._node:
            return
        find = self.finds.report(report, now_ns=now_ns, own=False)
        if find.confirmed is not None and now_ns - self._struck_ns.get(report.survivor, now_ns) > _CONFIRM_AGAIN_NS:
            self._struck_ns[report.survivor] = now_ns
            if self._place is not None and (report.reporter + self._node) % 4 == 0:
                self._outbox.packets.append(Packet(find.confirmed.encode_frame(self._node)))

    def bids(self, bids: Sequence[Bid], *, now_ns: int) -> None:
        """A neighbor passed bids on."""
        self._auction.merge((bid for bid in bids if not self._is_confirmed(bid.survivor)), now_ns=now_ns)

    def found(self, found: Found, *, now_ns: int) -> None:
        """A node told its estimate, or confirmed a survivor."""
        if self.finds.told(found, now_ns=now_ns):
            self._strike(found.survivor, now_ns)

    def status(self, status: Status, *, now_ns: int) -> None:
        """A UAV said how it is."""
        self._planner.status(status, now_ns=now_ns)

    def search(self, plan: Search, *, now_ns: int) -> None:
        """A plan came."""
        if self._planner.planned(plan):
            self._adopt(now_ns)

    def told(self, message: Told, *, now_ns: int) -> None:
        """Another node told something, to its neighbors or to everyone."""
        match message:
            case Survivor():
                self.reported(message, now_ns=now_ns)
            case Search():
                self.search(message, now_ns=now_ns)
            case Status():
                self.status(message, now_ns=now_ns)
            case Bids():
                self.bids(message.bids, now_ns=now_ns)
            case Found():
                self.found(message, now_ns=now_ns)
            case _:
                assert_never(message)

    # --- what goes out with hellos --------------------------------------------------------------------------------

    def hello_frames(self, now_ns: int) -> bytes:
        """Inner frames for the next hello: the latest reports, the best bids, what was found lately."""
        frames = b"".join(report.encode_frame(self._node) for report in self.finds.news(now_ns=now_ns))
        bids = self._auction.told(self.finds.open(), now_ns=now_ns)
        if bids:
            frames += encode_bids(bids, node=self._node)
        recent = [
            (struck_ns, survivor) for survivor, struck_ns in self._struck_ns.items() if now_ns - struck_ns < 12 * S
        ]
        for _, survivor in sorted(recent, reverse=True)[:3]:
            confirmed = self.finds.known[survivor].confirmed
            if confirmed is not None:
                frames += confirmed.encode_frame(self._node)
        return frames

    # --- telling --------------------------------------------------------------------------------------------------

    def _say_status(self, now_ns: int) -> None:
        plan = self._planner.plan
        status = Status(now_ns // US, self._position, self._node, plan.revision if plan else 0, 100)
        self._planner.status(status, now_ns=now_ns)
        self._outbox.packets.append(Packet(status.encode_frame(self._node)))
        self._next_status_ns = now_ns + round((0.8 + 0.4 * self._random()) * STATUS_S * S)

    def _tell_finds(self, now_ns: int) -> None:
        for survivor, (left, next_ns) in sorted(self._confirming.items()):
            if now_ns < next_ns:
                continue
            found = self.finds.known[survivor].confirmed
            assert found is not None, "only what is confirmed is announced"
            self._outbox.packets.append(Packet(found.encode_frame(self._node)))
            if left > 1:
                self._confirming[survivor] = left - 1, now_ns + _CONFIRM_AGAIN_NS
            else:
                del self._confirming[survivor]
        response = self._response
        if response is not None:
            self._tell_estimate(response.survivor, now_ns)

    def _tell_estimate(self, survivor: int, now_ns: int) -> None:
        """A responder shares its estimate when that has become clearly better."""
        place = self.finds.known[survivor].filter.estimate()
        before = self._told_sigma.get(survivor, math.inf)
        if place is None or place.sigma_m > _WORSE * before or place.sigma_m > 60.0:
            return
        self._told_sigma[survivor] = place.sigma_m
        self._outbox.packets.append(
            Packet(Found(now_ns // US, survivor, *place, self._node, confirmed=False).encode_frame(self._node))
        )

    # --- finds ----------------------------------------------------------------------------------------------------

    def _confirm(self, survivor: int, now_ns: int) -> None:
        """A survivor was seen at close range: announce it when its place is sure."""
        find = self.finds.known[survivor]
        place = find.filter.estimate() if find.sightings else None
        if find.confirmed is not None or place is None or find.sightings < _SIGHTINGS or place.sigma_m > _SURE_M:
            return
        if not self.finds.borne_out(survivor):
            return
        found = Found(now_ns // US, survivor, *place, self._node, confirmed=True)
        self.finds.told(found, now_ns=now_ns)
        self._outbox.records.append(
            Confirmed(now_ns, self._node, survivor, round(place.east_m, 2), round(place.north_m, 2))
        )
        self._confirming[survivor] = _CONFIRMATIONS, now_ns
        self._strike(survivor, now_ns)

    def _strike(self, survivor: int, now_ns: int) -> None:
        self._struck_ns[survivor] = now_ns
        self._auction.close(survivor)
        if self._response is not None and self._response.survivor == survivor:
            self._response = None
            self._choose(now_ns)

    def _is_confirmed(self, survivor: int) -> bool:
        find = self.finds.known.get(survivor)
        return find is not None and find.confirmed is not None

    # --- tasks ----------------------------------------------------------------------------------------------------

    def _wanted(self, find: Find) -> int:
        """How many UAVs a survivor needs now."""
        return self._config.responders if len(find.reporters) >= self._config.reports_to_approach else 1

    def _bid(self, now_ns: int) -> None:
        """Bid where we would be among the best, and take bids back that we can no longer keep."""
        if self._pattern is None:
            return
        for survivor in self.finds.open():
            find = self.finds.known[survivor]
            enough = len(find.reporters) >= self._config.reports_to_approach
            if self._auction.has_bid(survivor) or not find.filter.near(self._position, within_m=_FAR_M):
                continue
            if not enough and (self._node in find.reporters or now_ns - find.first_ns < _SCOUT_AFTER_NS):
                continue
            if now_ns - self._bid_ns.get(survivor, -(10**18)) < 20 * S:
                continue
            eta_s = self._eta_s(survivor, now_ns)
            if eta_s is None:
                continue
            count = self._wanted(find)
            if self._auction.would_win(survivor, eta_s=eta_s, count=count, now_ns=now_ns):
                self._auction.bid(survivor, eta_s=eta_s, now_ns=now_ns)

    def _choose(self, now_ns: int) -> None:
        """Fly the task that we have won and can be done with first; none: back to the lane."""
        response = self._response
        if response is not None:
            find = self.finds.known[response.survivor]
            lost = self._node not in self._auction.winners(response.survivor, count=self._wanted(find), now_ns=now_ns)
            arrived_ns = self._arrived_ns.get(response.survivor)
            late = arrived_ns is not None and now_ns - arrived_ns > _RETURN_AFTER_S * S
            late = late or (self._free and not self._still_coherent(find, now_ns))
            if late:
                self._auction.withdraw(response.survivor, now_ns=now_ns)
                self._bid_ns[response.survivor] = now_ns
            if lost or late:
                self._response = response = None
        if response is None:
            won = [
                (self._distance_m(survivor), survivor)
                for survivor in self.finds.open()
                if self._node
                in self._auction.winners(survivor, count=self._wanted(self.finds.known[survivor]), now_ns=now_ns)
            ]
            if won:
                response = self._response = _Response(min(won)[1], now_ns)
        if response is not None and not response.announced:
            find = self.finds.known[response.survivor]
            place = find.place()
            if place is not None and len(find.reporters) >= self._config.reports_to_approach:
                response.announced = True
                self._outbox.records.append(
                    Approaching(
                        now_ns, self._node, response.survivor, len(find.reporters),
                        round(place.east_m, 2), round(place.north_m, 2),
                    )
                )  # fmt: skip

    def _still_coherent(self, find: Find, now_ns: int) -> bool:
        place = find.place()
        return place is not None and self._coherent(place, now_ns, within_s=-5.0)

    def _distance_m(self, survivor: int) -> float:
        place = self.finds.known[survivor].place()
        return math.inf if place is None else place.distance_m(self._position)

    def _eta_s(self, survivor: int, now_ns: int) -> float | None:
        """When we would be with a survivor; None when our place in the formation forbids it."""
        place = self.finds.known[survivor].place()
        if place is None or (place.sigma_m > _VAGUE_M and not self._free):
            return None
        busy_s = 0.0 if self._response is None else 15.0 + self._distance_m(self._response.survivor) / self._most_m_s
        eta_s = busy_s + place.distance_m(self._position) / self._most_m_s
        if self._free:
            return eta_s if self._coherent(place, now_ns, within_s=eta_s) else None
        lane, moves = self._lane(now_ns)
        if not self._sweeping(now_ns) or not self._leashed(survivor, lane, moves):
            return None
        ahead_m = abs(place.north_m - self._position.north) if moves.norm() else 0.0
        return max(eta_s, ahead_m / self._config_speed_m_s)

    # --- flight ---------------------------------------------------------------------------------------------------

    def _adopt(self, now_ns: int) -> None:
        plan = self._planner.plan
        assert plan is not None, "there is a plan to adopt"
        first = self._place is None
        self._pattern = pattern_of(plan)
        self._place = plan.nodes.index(self._node) if self._node in plan.nodes else None
        if first:
            self._left_from, self._left_ns = self._position, max(now_ns, plan.start_us * US)
        self._outbox.records.append(
            Planned(now_ns, self._node, plan.revision, -1 if self._place is None else self._place)
        )

    def _lane(self, now_ns: int) -> tuple[Enu, Enu]:
        """Where our lane wants us now, and how that place moves."""
        plan, pattern, place = self._planner.plan, self._pattern, self._place
        if plan is None or pattern is None or place is None:
            return self._left_from or self._position, Enu(0.0, 0.0, 0.0)
        arrival_ns = plan.start_us * US + plan.deploy_ds * 100 * MS
        if now_ns >= arrival_ns or self._left_from is None:
            swept_s = (now_ns - arrival_ns) / S
            return pattern.at(place, swept_s), pattern.velocity(place, swept_s)
        goal, start, span_ns = pattern.at(place, 0.0), self._left_from, arrival_ns - self._left_ns
        if now_ns <= self._left_ns or span_ns <= 0:
            return start, Enu(0.0, 0.0, 0.0)
        share, per_s = (now_ns - self._left_ns) / span_ns, S / span_ns
        way = goal.minus(start)
        return (
            Enu(start.east + share * way.east, start.north + share * way.north, start.up + share * way.up),
            Enu(way.east * per_s, way.north * per_s, way.up * per_s),
        )

    @property
    def _free(self) -> bool:
        """True for a UAV that may go anywhere, because the swarm holds together without it."""
        return self._pattern is None or self._place is None or self._pattern.kind(self._place) == "follower"

    def _goal(self, now_ns: int) -> tuple[Enu, Enu]:
        """Where to be now and how that place moves: our lane, or a survivor as far as our lane lets us."""
        lane, moves = self._lane(now_ns)
        survivor = self._response.survivor if self._response is not None else None
        if not self._free and (survivor is None or not self._leashed(survivor, lane, moves)):
            survivor = self._in_lane(lane, moves, now_ns)
        place = None if survivor is None else self.finds.known[survivor].place()
        if survivor is None or place is None:
            return lane, moves
        east, north = self._around(survivor, place.east_m, place.north_m, now_ns)
        if self._free:
            return Enu(east, north, lane.up), _STILL
        east = lane.east + max(-_LEASH_M, min(_LEASH_M, east - lane.east))
        sign = 1 if moves.north >= 0 else -1
        behind_m = (lane.north - north) * sign
        if behind_m <= 0:  # still ahead: the line brings us there
            return Enu(east, lane.north, lane.up), moves
        if behind_m > _LAG_M:
            return Enu(east, lane.north - sign * _LAG_M, lane.up), moves
        return Enu(east, north, lane.up), _STILL

    def _in_lane(self, lane: Enu, moves: Enu, now_ns: int) -> int | None:
        """The nearest survivor of those that our lane leads by; we look at it as we pass, within the formation."""
        pattern, place = self._pattern, self._place
        if pattern is None or place is None or pattern.kind(place) != "line" or not self._sweeping(now_ns):
            return None
        best: tuple[float, int] | None = None
        for survivor in self.finds.open():
            find = self.finds.known[survivor]
            estimate = find.place() if find.filter.near(self._position, within_m=_FAR_M) else None
            if estimate is None or estimate.sigma_m > _VAGUE_M:
                continue
            if abs(estimate.east_m - lane.east) > 0.5 * pattern.lane_m + _SHARED_M:
                continue
            if self._leashed(survivor, lane, moves):
                candidate = estimate.distance_m(self._position), survivor
                best = candidate if best is None else min(best, candidate)
        return None if best is None else best[1]

    def _leashed(self, survivor: int, lane: Enu, moves: Enu) -> bool:
        """Whether a survivor is near enough to our lane to be looked at without leaving the formation."""
        place = self.finds.known[survivor].place()
        if place is None or abs(place.east_m - lane.east) > _LEASH_M + _ASIDE_M:
            return False
        ahead_m = (place.north_m - lane.north) * (1 if moves.north >= 0 else -1)
        return -_LAG_M <= ahead_m <= _AHEAD_M

    def _sweeping(self, now_ns: int) -> bool:
        """Whether the formation has been taken up."""
        plan = self._planner.plan
        return plan is not None and now_ns >= plan.start_us * US + plan.deploy_ds * 100 * MS

    def _coherent(self, place: Estimate, now_ns: int, *, within_s: float) -> bool:
        """Whether somebody there would be in reach of our line for the next while."""
        plan, pattern = self._planner.plan, self._pattern
        if plan is None or pattern is None:
            return False
        if self._place is None or not self._sweeping(now_ns):
            return False
        line = pattern.line_of(self._place)
        at_s = (now_ns - plan.start_us * US - plan.deploy_ds * 100 * MS) / S
        most_m = _FREE_REACH * self._reach_m
        return all(
            abs(place.north_m - pattern.line_north(line, at_s + ahead_s)) <= most_m
            for ahead_s in (within_s, within_s + 5.0)
        )

    def _around(self, survivor: int, east_m: float, north_m: float, now_ns: int) -> tuple[float, float]:
        """A point about the estimate: each UAV at an angle of its own, on a spiral while nobody is seen."""
        response = self._response
        arrived_ns = self._arrived_ns.get(survivor)
        if arrived_ns is None:
            distance = math.hypot(east_m - self._position.east, north_m - self._position.north)
            if distance > self._config.arrival_m:
                return east_m, north_m
            arrived_ns = self._arrived_ns[survivor] = now_ns
            if response is not None and response.survivor == survivor:
                self._outbox.records.append(Arrived(now_ns, self._node, survivor))
        seen = self.finds.known[survivor].filter.is_seen
        searched_s = (now_ns - arrived_ns) / S
        radius = _RING_M if seen else _RING_M + _SPIRAL_M * searched_s / 20.0
        angle = self._node * _GOLDEN_ANGLE + (0.0 if seen else searched_s / 3.0)
        return east_m + radius * math.cos(angle), north_m + radius * math.sin(angle)

    def _steer(self, now_ns: int) -> Enu:
        """The velocity to fly from this fix on."""
        goal, feed = self._goal(now_ns)
        off = goal.minus(self._position)
        wanted = feed.east + _LANE_GAIN * off.east, feed.north + _LANE_GAIN * off.north
        corner = self._obstacles.way_to(self._position, goal, feed, now_ns=now_ns)
        if corner is not None:
            wanted = self._towards(corner, speed_m_s=math.hypot(*wanted))
        speed = math.hypot(*wanted)
        if speed > self._most_m_s:
            wanted = wanted[0] * self._most_m_s / speed, wanted[1] * self._most_m_s / speed
        planes = self._obstacles.planes(self._position, now_ns)
        planes += self._clear_of_others(now_ns)
        hard = len(planes)
        planes += self._tied(now_ns)
        east, north = nearest(wanted, planes, limit=self._most_m_s, hard=hard) if planes else wanted
        velocity = Enu(east, north, 0.0)
        climb_m = goal.up + self._obstacles.climb_m(self._position, velocity) - self._height_m(now_ns)
        climb_m = max(climb_m, self._obstacles.least_up_m(self._position, velocity) - self._position.up)
        return velocity._replace(up=max(-_CLIMB_M_S, min(_CLIMB_M_S, 0.5 * climb_m)))

    def _towards(self, corner: Enu, *, speed_m_s: float) -> tuple[float, float]:
        """The velocity to a place on the way around an obstacle; near it as slow as the goal itself would have it."""
        off = corner.minus(self._position)
        distance = math.hypot(off.east, off.north)
        speed = min(self._most_m_s, max(speed_m_s, 0.5 * self._most_m_s), max(_LEAST_M_S, distance))
        return off.east / max(distance, 1e-6) * speed, off.north / max(distance, 1e-6) * speed

    def _lately_heard(self, now_ns: int) -> list[Heard]:
        """The neighbors whose hellos tell where they are now."""
        return [heard for _, heard in sorted(self._neighbors.items()) if now_ns - heard.at_ns <= _HEARD_FOR_NS]

    def _clear_of_others(self, now_ns: int) -> list[HalfPlane]:
        """Constraints of all that are heard, or that our radar shows, the nearest one's first."""
        own = self._own_velocity.east, self._own_velocity.north
        planes: list[tuple[float, HalfPlane]] = []
        heard_of = self._lately_heard(now_ns) if "hellos" in self._config.avoid_by else []
        seen = [Heard(*mover) for mover in self._obstacles.movers(now_ns)]
        for heard in (*heard_of, *seen):
            age_s = (now_ns - heard.at_ns) / S
            offset = heard.now(now_ns).minus(self._position)
            distance = math.hypot(offset.east, offset.north)
            climb = self._own_velocity.up - heard.velocity.up
            apart_soon = abs(offset.up - climb * 3.0)
            if distance > _WATCH_M or (abs(offset.up) > 2 * _LEVEL_M and apart_soon > _LEVEL_M):
                continue
            plane = avoiding(
                offset,
                own,
                (heard.velocity.east, heard.velocity.north),
                clearance_m=_CLEARANCE_M + grown_m(age_s),
                horizon_s=_HORIZON_S,
                share=0.5,
            )
            planes.append((distance, plane))
        return [plane for _, plane in sorted(planes)]

    def _nearest_anchor(self, now_ns: int) -> tuple[int, ...]:
        """Of a follower: the place of its own line whose holder is nearest to us."""
        plan, pattern = self._planner.plan, self._pattern
        assert plan is not None, "who has a place has a plan"
        assert pattern is not None, "a plan has a pattern"
        assert self._place is not None, "a follower has a place"
        line = pattern.line_of(self._place)
        near = [
            (heard.now(now_ns).minus(self._position).norm(), other)
            for other in range(line * pattern.lanes, (line + 1) * pattern.lanes)
            if (heard := self._neighbors.get(plan.nodes[other])) is not None and now_ns - heard.at_ns <= _HEARD_FOR_NS
        ]
        return (min(near)[1],) if near else ()

    def _tied(self, now_ns: int) -> list[HalfPlane]:
        """Who is in a line or in the chain stays in reach of its neighbors there."""
        plan, pattern, place = self._planner.plan, self._pattern, self._place
        if plan is None or pattern is None or place is None or now_ns < plan.start_us * US + plan.deploy_ds * 100 * MS:
            return []
        planes = []
        tethers = pattern.tethers(place) or self._nearest_anchor(now_ns)
        for other in tethers:
            heard = self._neighbors.get(plan.nodes[other])
            if heard is None or now_ns - heard.at_ns > _HEARD_FOR_NS:
                continue
            plane = staying_near(
                heard.now(now_ns).minus(self._position),
                (heard.velocity.east, heard.velocity.north),
                tether_m=_TETHER * self._reach_m,
                within_s=_TETHER_S,
            )
            if plane is not None:
                planes.append(plane)
        return planes


def phone_model(scenario: Scenario) -> PhoneModel:
    """How the phones of a scenario are heard."""
    mission = scenario.mission
    return PhoneModel(
        mission.phone_power_dbm,
        mission.phone_exponent,
        mission.shadowing_db,
        _OFFSET_DB,
        mission.detection_dbm,
        scenario.world.area_m / 2,
    )


def formation(scenario: Scenario, count: int) -> Pattern | None:
    """The formation in which so many UAVs search the area of a scenario; None when they are too few."""
    return fitted(
        count,
        area_m=scenario.world.area_m,
        seen_m=_ground_range_m(phone_model(scenario), scenario.nodes.altitude_m),
        reach_m=scenario.radio.range_m,
        height_m=scenario.nodes.altitude_m,
        speed_m_s=scenario.mobility.speed_m_s,
    )


def least_nodes(scenario: Scenario) -> int:
    """How many UAVs the search in lines needs in the area of a scenario."""
    return next(count for count in range(1, MAX_NODES + 1) if formation(scenario, count) is not None)


def _ground_range_m(model: PhoneModel, height_m: float) -> float:
    """How far to the side a phone on the ground is heard, without shadowing."""
    slant = 10 ** ((model.power_dbm - REFERENCE_LOSS_DB - model.threshold_dbm) / (10 * model.exponent))
    return math.sqrt(max(1.0, slant * slant - height_m * height_m))

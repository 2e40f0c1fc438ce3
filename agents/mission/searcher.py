"""The planned search at one UAV: it keeps its lane, reports phones, bids for survivors, responds, and confirms.

This file wires the parts of a search together; docs/explanation/search.md says which part decides what. All that a UAV
knows beside the scenario and its map it has sensed itself, or received over the air.
"""

import math
from collections.abc import Iterator
from typing import Final, assert_never

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.camera_view import CameraView
from agents.mission.finding.in_building import place_in_building
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from agents.mission.finding.phone_reception import PhoneReception
from agents.mission.finding.sightings import Sightings
from agents.mission.flight.approach_speed import approach_speed_m_s
from agents.mission.flight.connectivity_maintenance import ConnectivityMaintenance
from agents.mission.flight.errand import Errand
from agents.mission.flight.flight import Flight
from agents.mission.flight.goal import Goal
from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance
from agents.mission.flight.return_home import ReturnHome, ReturnReason
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.flight.take_off import TakeOff, take_off_ns, turns_ns
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.lines_of_sight import LinesOfSight
from agents.mission.navigation.neighbor_motions import NeighborMotions, RadarWatch
from agents.mission.navigation.onboard_map import OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.navigation.silent_neighbors import HeardByRadio, SilentNeighbors
from agents.mission.orders import KnownOrders, record_of
from agents.mission.outbox import Outbox
from agents.mission.search_formation.formation_planner import (
    NOTICE_IN_ROUNDS_NS,
    NOTICE_NS,
    FormationPlanner,
    size_factor,
)
from agents.mission.search_formation.pattern import Pattern, fastest, fitted, of_few
from agents.mission.search_formation.plan_exchange import PlanExchange
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.search_place import SearchPlace
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from agents.mission.tasking.absence import Absence
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.bidding import Bidding
from agents.mission.tasking.voice_descent import VoiceDescent
from fanet_mw.bus.messages import (
    Altimeter,
    Battery,
    Camera,
    LandingTarget,
    Radar,
    SensorReading,
    Voice,
    WifiScan,
    WindEstimate,
)  # fmt: skip
from fanet_mw.motion import Motion
from fanet_mw.orders import OrderKind
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.world import FASTEST_AIR_M_S
from fanet_mw.trace import MissionModeChanged
from fanet_mw.units import MS, Enu, NodeId, S, earliest
from fanet_mw.wire.search_messages import Bids, Roll, Told, ToldOrder, encode_bids
from fanet_mw.wire.search_plan import MOST_PLACES, Search, SearchStatus
from fanet_mw.wire.survivors import Found, Standing, Survivor, is_person

_MOST_DECADES: Final = 12.0
"""The greatest range of a phone's receiver is 10^12 m, farther than anything is apart; its square is a number."""
_OFFSET_DB: Final = 1.0
"""The standard deviation that is assumed for the difference between one phone's power and the mean of all phones."""
_REVIEW_NS: Final = 1 * S
"""The interval at which a UAV decides all that does not need an answer at once (`Searcher.wake`)."""
_SIGHT_NS: Final = 500 * MS
"""The interval at which a UAV computes when its lines of sight end."""
_ROLL_NS: Final = 200 * MS
"""The interval at which a UAV decides which others are lost."""
_LEAST_RECOGNIZED: Final = 0.1
"""The least share of the people in an image that a camera must recognize from the height of the search."""
_LOOKED_NS: Final = 10 * S
"""How long a UAV looks for a survivor before the verdict that the survivor is inside a building."""
_DOUBTED_NS: Final = 45 * S
"""How long it looks for a survivor who may be in one of several buildings, before it states a place amid them."""
_DEPLOY: Final = 0.9
"""The share of its greatest speed at which the slowest UAV flies to its first place."""


class Searcher:
    """The parts of one UAV's search (its attributes), and the order in which they get its inputs."""

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        *,
        position: Enu,
        outbox: Outbox,
        onboard_map: OnboardMap,
        limits: SearchLimits,
        radio: HeardByRadio | None = None,
    ) -> None:
        mission, reach_m, speed_m_s = scenario.mission, scenario.radio.range_m, approach_speed_m_s(scenario, node)
        self._random = stream(scenario.seed, "mission", node).random
        self._radio = radio
        self._looked_at = looked_at = LookedAt(_view_m(scenario), height_m=scenario.nodes.altitude_m)
        self._survivors = survivors = KnownSurvivors(phone_model(scenario), looked_at)
        obstacles = KnownObstacles(onboard_map, scenario.world.no_fly_m)
        self._own_motion = own_motion = OwnMotion(position, obstacles)
        self._neighbors = neighbors = NeighborMotions(hello_interval_s=scenario.routing.hello_interval_s)
        self._radar = RadarWatch(own_motion, obstacles, neighbors)
        aside_m, ahead_m = _view_m(scenario)
        around = mission.search in ("ring", "fan")  # lanes lead east and west as well
        look_m = min(aside_m, ahead_m) if around else aside_m
        self._place = place = SearchPlace(node, own_motion, reach_m=reach_m, look_m=look_m)
        least_m_s, _ = mission.approach_speeds_m_s
        nodes = scenario.nodes
        silent = None if radio is None else SilentNeighbors(radio, neighbors, own_motion, obstacles, reach_m=reach_m)
        self._roll_call = roll_call = RollCall(node, hello_interval_s=scenario.routing.hello_interval_s, silent=silent)
        notice_ns = NOTICE_IN_ROUNDS_NS if scenario.routing.protocol == "rounds" else NOTICE_NS
        planner = FormationPlanner(
            node, roll_call, expected=nodes.count, deploy_speed_m_s=_DEPLOY * least_m_s,
            notice_ns=round(size_factor(nodes.count) * notice_ns),
            take_off_ns=take_off_ns(nodes.altitude_m) if nodes.on_ground else 0, turns_ns=turns_ns,
            random=stream(scenario.seed, "plan", node).random,
            of_few=lambda count, now_ns: None if self._is_swept(now_ns) else _of_few(scenario, count),
        )  # fmt: skip
        self._plans = PlanExchange(
            node, planner, roll_call, place, own_motion, outbox,
            pattern=formation(scenario, nodes.count), random=self._random, uavs=nodes.count,
        )  # fmt: skip
        self._reception = PhoneReception(scenario, node, survivors, own_motion, outbox, neighbors)
        self._sightings = Sightings(scenario, node, survivors, own_motion, outbox)
        self._announcing = Announcing(node, survivors, outbox)
        self._map = onboard_map
        self._sight = LinesOfSight(onboard_map) if scenario.buildings_cut_links else None
        self._next_sight_ns = 0
        self._approach = approach = Approach(
            node, survivors, own_motion, neighbors, outbox,
            arrival_m=mission.arrival_m, speed_m_s=speed_m_s, looked_at=looked_at,
        )  # fmt: skip
        absence = Absence(place, mission.connection, speed_m_s=speed_m_s)
        self._bidding = Bidding(
            scenario, node, survivors=survivors, own_motion=own_motion, formation=place, approach=approach,
            absence=absence, outbox=outbox, speed_m_s=speed_m_s,
        )  # fmt: skip
        beside: set[int] = set()
        self._return_home = ReturnHome(
            node, position, own_motion, neighbors, outbox, speed_m_s=speed_m_s,
            airspeed_m_s=FASTEST_AIR_M_S[scenario.world.vehicle], height_m=scenario.nodes.altitude_m, limits=limits,
            fixes_hz=scenario.world.gps_hz, beside=beside,
        )  # fmt: skip
        connectivity = ConnectivityMaintenance(
            own_motion, neighbors, place, self._bidding, reach_m=reach_m, speed_m_s=speed_m_s
        )
        velocity_choice = VelocityChoice(
            own_motion,
            obstacles,
            most_m_s=speed_m_s,
            hard=[ReciprocalAvoidance(own_motion, neighbors, obstacles)],
            soft=[connectivity],
        )
        heard = scenario.sensors.voice_hz > 0
        listening = VoiceDescent(scenario, node, own_motion, neighbors, speed_m_s=speed_m_s) if heard else None
        self._orders = orders = KnownOrders(node)
        self._obstacles = obstacles
        errand = Errand(
            orders, own_motion,
            height_m=nodes.altitude_m, speed_m_s=scenario.mobility.speed_m_s, look_m=min(_view_m(scenario)),
        )  # fmt: skip
        goal = Goal(survivors, own_motion, place, approach, listening, errand, absence=absence)
        take_off = TakeOff(
            node, position,
            own_motion=own_motion, neighbors=neighbors, outbox=outbox, height_m=nodes.altitude_m,
            beside=beside,
        ) if nodes.on_ground else None  # fmt: skip
        self._flight = Flight(
            own_motion, place, goal, velocity_choice, connectivity,
            roll_call=roll_call, take_off=take_off, return_home=self._return_home,
            height_m=nodes.altitude_m, ceiling_m=mission.ceiling_m,
        )  # fmt: skip
        self._last_mode: tuple[str, int] | None = None
        """The mode that was recorded last, and the survivor to whom the UAV flew then."""
        self._node, self._post = node, scenario.post
        self._outbox = outbox
        self._limits = limits
        self._next_review_ns: int | None = None
        self._next_roll_ns = 0

    # --- time -----------------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._next_review_ns = now_ns + round(self._random() * _REVIEW_NS)
        self._plans.start(now_ns)

    def next_wake_ns(self) -> int | None:
        return earliest(self._next_review_ns, self._plans.alarm_ns)

    def wake(self, now_ns: int) -> None:
        self._plans.tell_losses(now_ns)
        if self._next_review_ns is None or now_ns < self._next_review_ns:
            return
        self._next_review_ns = now_ns + _REVIEW_NS
        if self._return_home.loses_link(now_ns) or self._return_home.loses_position(now_ns):
            self._leave(now_ns)
        if not self._return_home.leaves and self._orders.errand is None and self._is_over(now_ns):
            self._return_home.end()
            self._give_up(now_ns)
        self._note_looks(now_ns)
        self._reception.review(now_ns)
        for survivor in self._sightings.refuted():
            self._announcing.keep_person(survivor, now_ns, steady_m2=self._sightings.steady_m2)
            self._announcing.refute(survivor, now_ns)
            self._bidding.reopen(survivor)
        self._plans.review(self._percent, now_ns)
        self._identify(now_ns)
        for survivor, place in self._sightings.take_among().items():
            self._announcing.place_among(survivor, place, now_ns)
            self._bidding.close(survivor, now_ns=now_ns)
        for place in self._sightings.unreported(now_ns):
            self._announcing.report_person(place, now_ns)
        self._announcing.give_up_doubles(now_ns, steady_m2=self._sightings.steady_m2)
        self._place_inside(now_ns)
        self._announcing.tell(self._bidding.survivor, now_ns)
        if not self._return_home.leaves and self._orders.errand is None:
            self._bidding.bid(now_ns, delay_s=self._flight.take_off_s)
            self._bidding.choose(now_ns)
            goes = self._bidding.is_absent(now_ns) or self._place.strays(now_ns)
            goes = goes or (self._place.plan is None and self._bidding.survivor is not None)
            self._plans.be_absent(self._percent, now_ns, goes=goes)
        self._review_mode(now_ns)

    def _note_looks(self, now_ns: int) -> None:
        """Note what the own camera shows now, and those of neighbors: the ground is taken to be level between them."""
        here, position = self._own_motion.over_ground(now_ns), self._own_motion.position
        self._looked_at.note(here, now_ns)
        for motion in self._neighbors.all(now_ns=now_ns):
            at = motion.position_at(now_ns)
            self._looked_at.note(at._replace(up=at.up + here.up - position.up), now_ns)

    @property
    def velocity(self) -> Enu | None:
        """The chosen velocity that has not been taken yet; None if there is none."""
        return self._flight.velocity

    def take_velocity(self) -> Enu | None:
        """Return the chosen velocity, and mark it as taken."""
        velocity, self._flight.velocity = self._flight.velocity, None
        return velocity

    def _review_mode(self, now_ns: int) -> None:
        """Record what this UAV is doing, in one word, whenever it changes."""
        mode = self._mode(now_ns), self._bidding.survivor or 0
        if self._last_mode != mode:
            self._last_mode = mode
            self._outbox.records.append(MissionModeChanged(now_ns, self._node, *mode))

    def _mode(self, now_ns: int) -> str:
        if self._return_home.lands:
            return "land"
        if self._return_home.reason is not None:
            return self._return_home.reason.value
        if self._flight.takes_off:
            return "takeoff"
        if self._orders.errand is not None:
            return "errand"
        if self._bidding.survivor:
            return "respond"
        if self._place.is_taken_up(now_ns):
            return "search"
        return "wait" if self._place.place is None else "deploy"

    # --- what its own sensors say ---------------------------------------------------------------------------------

    def fix(self, position: Enu, velocity: Enu, *, now_ns: int) -> None:
        if self._return_home.on_fix(now_ns):
            self._take_part_again(now_ns)
        if now_ns >= self._next_roll_ns:
            self._next_roll_ns = now_ns + _ROLL_NS
            self._plans.close_ranks(now_ns)
            lost = self._roll_call.lost
            self._obstacles.hovering = self._neighbors.hovering(lost, self._place.lost_at(now_ns)) if lost else ()
        self._flight.fix(position, velocity, self._bidding.survivor, now_ns=now_ns)
        if self._radio is not None:
            self._radio.hold(self._flight.held)
            if self._sight is not None and now_ns >= self._next_sight_ns:
                self._next_sight_ns = now_ns + _SIGHT_NS
                own = Motion(position, velocity, now_ns)
                self._radio.lose_sight(self._sight.ends_ns(own, self._neighbors.by_node(now_ns=now_ns)))

    def on_sensor(self, reading: SensorReading, *, now_ns: int) -> None:
        """Hand a reading to the part that needs it; any other reading is ignored."""
        match reading:
            case WifiScan():
                self._reception.scan(reading.heard, now_ns=now_ns)
            case Camera():
                self._sightings.camera(reading.people, now_ns=now_ns)
                self._identify(now_ns)
            case Voice():
                self._sightings.voice(reading.calls, now_ns=now_ns)
                self._identify(now_ns)
            case Altimeter():
                self._own_motion.altimeter(reading.above_ground_m, now_ns=now_ns)
            case Battery():
                if self._return_home.on_battery(reading.charge, now_ns=now_ns):
                    self._leave(now_ns)
            case WindEstimate():
                self._return_home.on_wind(reading.velocity)
            case LandingTarget():
                self._return_home.on_pad(reading.offset, now_ns)
            case Radar():
                self._radar.scan(reading.echoes, now_ns=now_ns)
            case _:
                pass

    def _leave(self, now_ns: int) -> None:
        """Give up the place and the task, and tell all."""
        self._give_up(now_ns)
        self._plans.say_status(self._percent, now_ns)

    def _give_up(self, now_ns: int) -> None:
        self._bidding.hand_on(now_ns)
        self._plans.leave()
        self._review_mode(now_ns)

    def _is_over(self, now_ns: int) -> bool:
        """True once the area was swept as often as the scenario wants, and nobody is sought any more or it was swept
        once more.
        """
        if not self._is_swept(now_ns):
            return False
        return not self._survivors.sought() or self._place.is_swept(now_ns, times=self._limits.sweeps + 1)

    def _is_swept(self, now_ns: int) -> bool:
        """True once the area was swept as often as the scenario wants; False if it sets no limit."""
        sweeps = self._limits.sweeps
        return bool(sweeps) and self._place.is_swept(now_ns, times=sweeps)

    def _identify(self, now_ns: int) -> None:
        for survivor in self._sightings.review(now_ns):
            self._announcing.confirm(survivor, now_ns)
            self._bidding.close(survivor, now_ns=now_ns)

    def _place_inside(self, now_ns: int) -> None:
        """Decide which survivors at whose places this UAV has looked in vain, or still does, are inside buildings."""
        for survivor in self._survivors.sought():
            known, arrived_ns = self._survivors.by_id[survivor], self._approach.arrived_ns.get(survivor)
            if arrived_ns is None or now_ns - arrived_ns < _LOOKED_NS or known.filter.is_seen:
                continue
            patient = now_ns - arrived_ns < _DOUBTED_NS
            place = place_in_building(known, self._map, self._looked_at.sides, patient=patient)
            if place is not None:
                self._announcing.place_inside(survivor, place, now_ns)
                self._bidding.close(survivor, now_ns=now_ns)

    # --- received messages ----------------------------------------------------------------------------------------

    def hello(self, origin: int, motion: Motion, *, now_ns: int) -> None:
        """A neighbor's hello states how it flies, or that the post on the ground is in reach."""
        self._on_heard(now_ns)
        if origin == self._post:
            self._announcing.on_post(now_ns)
            return
        self._neighbors.on_hello(origin, motion)
        if self._plans.on_hello(origin, motion, now_ns=now_ns):
            self._announcing.on_returned(now_ns)

    def _on_heard(self, now_ns: int) -> None:
        """Another node was heard: if this UAV flies home because it heard nobody, it takes part again."""
        if self._return_home.on_heard(now_ns):
            self._take_part_again(now_ns)

    def _take_part_again(self, now_ns: int) -> None:
        if self._orders.errand is None:
            self._plans.come_back(self._percent, now_ns)
            self._review_mode(now_ns)

    def on_message(self, message: Told, *, flooded: bool = True, now_ns: int) -> None:
        """A message of another node was received, `flooded` to all nodes or sent to its neighbors."""
        self._on_heard(now_ns)
        match message:
            case Survivor():
                if message.reporter != self._node:
                    self._survivors.take_report(message, now_ns=now_ns)
                    if self._place.place is not None:
                        self._announcing.reported(message, now_ns)
            case Search():
                self._plans.on_plan(message, now_ns=now_ns)
            case SearchStatus():
                self._plans.on_status(message, now_ns=now_ns)
            case Bids():
                self._bidding.merge(message.bids, now_ns=now_ns)
            case Found():
                self._on_found(message, now_ns, flooded=flooded)
            case Roll():
                self._plans.on_roll(message, flooded=flooded, now_ns=now_ns)
            case ToldOrder():
                self._on_order(message, now_ns)
            case _:
                assert_never(message)

    def _on_order(self, told: ToldOrder, now_ns: int) -> None:
        """The post on the ground has given an order, to this UAV or to others; nobody else may."""
        if told.post != self._post or not self._orders.learn(told, now_ns):
            return
        self._outbox.records.append(record_of(told, self._node, now_ns))
        if not self._orders.is_to_obey(told):
            return
        order = told.order
        match order.kind:
            case OrderKind.NO_FLY:
                self._obstacles.close(order.east_m, order.north_m, order.radius_m)
            case OrderKind.RECALL | OrderKind.END:
                ends = order.kind is OrderKind.END
                self._return_home.end(ReturnReason.DONE if ends else ReturnReason.RECALLED)
                self._leave(now_ns)
            case OrderKind.STAY | OrderKind.SEARCH:
                self._return_home.release()  # it overrules a recall
                self._leave(now_ns)
            case OrderKind.RELEASE:
                if self._return_home.release() or not self._return_home.leaves:
                    self._plans.come_back(self._percent, now_ns)
                    self._review_mode(now_ns)
            case _:
                assert_never(order.kind)

    @property
    def _percent(self) -> int:
        """The percentage of its battery that this UAV may spend for the search; 0 while it takes no part in it."""
        return 0 if self._orders.errand is not None else self._return_home.percent

    def _on_found(self, found: Found, now_ns: int, *, flooded: bool) -> None:
        """Another node states its estimate of a survivor's place, or a verdict."""
        if self._survivors.on_found(found, now_ns=now_ns):
            self._announcing.decided(found.survivor, now_ns)
            if is_person(found.survivor):
                return
            if found.standing in (Standing.CONFIRMED, Standing.INSIDE, Standing.AMONG):
                self._bidding.close(found.survivor, now_ns=now_ns)
            else:
                self._bidding.reopen(found.survivor)
        elif self._survivors.is_outdated(found):
            self._announcing.outdated(found, now_ns)
        elif flooded and found.standing is not Standing.ESTIMATED:
            self._announcing.repeated(found, now_ns)

    # --- sent messages --------------------------------------------------------------------------------------------

    def hello_frames(self, now_ns: int) -> bytes:
        """The inner frames for the next hello: the latest reports, the best bids, recent verdicts, orders, and who was
        heard when.
        """
        frames = b"".join(report.encode_frame(self._node) for report in self._survivors.recent_reports(now_ns=now_ns))
        bids = self._bidding.bids_to_tell(now_ns=now_ns)
        if bids:
            frames += encode_bids(bids, node=self._node)
        frames += self._announcing.hello_frames(now_ns)
        return frames + self._orders.hello_frames(now_ns) + self._plans.hello_frames(now_ns)


def phone_model(scenario: Scenario) -> PhoneModel:
    """What UAVs assume of phones: rubble takes half of `mission.rubble_db` from the power of each, give or take it."""
    mission = scenario.mission
    half_db = mission.rubble_db / 2
    return PhoneModel(
        mission.phone_power_dbm - half_db,
        mission.phone_exponent,
        mission.shadowing_db,
        math.hypot(_OFFSET_DB, half_db),
        mission.detection_dbm,
        scenario.world.area_m / 2,
    )


def _view_m(scenario: Scenario) -> tuple[float, float]:
    """How far east and north a camera shows the ground from the search's height; infinite without a camera."""
    if not scenario.sensors.camera_hz:
        return math.inf, math.inf
    east, north = scenario.sensors.tan_half_fov
    return scenario.nodes.altitude_m * east, scenario.nodes.altitude_m * north


def formation(scenario: Scenario, count: int) -> Pattern | None:
    """The formation in which this number of UAVs searches the area of a scenario; None if they are too few."""
    demands = demands_of(scenario)
    search = scenario.mission.search
    if search == "fastest":
        return fastest(count, demands)
    shape = ShapeName.LINES if search == "none" else ShapeName[search.upper()]
    return fitted(count, demands, shape=shape, sectors_wanted=scenario.clusters.count)


def _of_few(scenario: Scenario, count: int) -> Pattern:
    """The formation in which UAVs search that are too few for the formation of the scenario."""
    return of_few(count, demands_of(scenario), connected=scenario.mission.connection == "always")


def demands_of(scenario: Scenario) -> Demands:
    """What a scenario demands of the formation of its search."""
    return Demands(
        area_m=scenario.world.area_m,
        seen_m=_ground_range_m(scenario),
        reach_m=scenario.radio.range_m,
        height_m=scenario.nodes.altitude_m,
        speed_m_s=scenario.mobility.speed_m_s,
        base_m=scenario.world.base_m,
    )


def unflyable(scenario: Scenario) -> Iterator[str]:
    """Why a planned search cannot be flown as a scenario wants it: one sentence for each reason."""
    least_m_s, _ = scenario.mission.approach_speeds_m_s
    if scenario.mobility.speed_m_s > least_m_s:
        yield (
            f"mobility.speed_m_s = {scenario.mobility.speed_m_s:g}, at which lanes are flown, must be <= "
            f"mission.approach_speed_m_s = {least_m_s:g}, the greatest speed of a UAV: it would never reach their ends"
        )
    if not scenario.sensors.camera_hz:
        return
    height_m = scenario.nodes.altitude_m
    recognized = CameraView(scenario).recognized(height_m)
    if recognized < _LEAST_RECOGNIZED:
        yield (
            f"nodes.altitude_m = {height_m:g}: from there a camera with sensors.camera_pixels = "
            f"{list(scenario.sensors.camera_pixels)} and camera_fov_deg = {scenario.sensors.camera_fov_deg:g} "
            f"recognizes {recognized:.1%} of the people in an image, which must be >= {_LEAST_RECOGNIZED:.0%}"
        )


def least_nodes(scenario: Scenario) -> int | None:
    """The number of UAVs that a planned search needs in a scenario's area; None if it is more than a plan can name."""
    return next((count for count in range(1, MOST_PLACES + 1) if formation(scenario, count) is not None), None)


def _ground_range_m(scenario: Scenario) -> float:
    """The greatest ground distance at which a phone is received from the search's height, through rubble."""
    mission, height_m = scenario.mission, scenario.nodes.altitude_m
    budget_db = mission.phone_power_dbm - mission.rubble_db - REFERENCE_LOSS_DB - mission.detection_dbm
    slant = math.pow(10.0, min(_MOST_DECADES, budget_db / (10 * mission.phone_exponent)))
    return math.sqrt(max(1.0, slant * slant - height_m * height_m))

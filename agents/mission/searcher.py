"""One UAV's part in a planned search: it keeps its lane, reports, bids, responds, confirms, and keeps clear of others.

    plan over the air   -> a lane: where to be at every instant of swarm time              planner, formation_place
    phones in reach     -> reports: flooded, and passed from neighbor to neighbor with hellos     finds
    enough reporters    -> an auction; winners leave their lanes as far as the swarm's coherence lets them     tasks
    too few reporters   -> the auction names one that has not reported, who fetches a further bearing
    seen at close range -> confirmed, announced, struck off; responders return to their lanes     announcing

Everything it knows it has sensed or was told over the air. Each fix gives one velocity (goal, steering).
"""

import math
from collections.abc import Sequence
from typing import Final, assert_never

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.finds import Finds, ground_place
from agents.mission.finding.identities import Identities
from agents.mission.finding.phone_filter import REFERENCE_LOSS_DB, PhoneModel
from agents.mission.flight.approach_speed import approach_speed_m_s
from agents.mission.flight.goal import Goal
from agents.mission.flight.return_home import ReturnHome
from agents.mission.flight.velocity_choice import ClearOfObstacles, ClearOfOthers, InReach, VelocityChoice
from agents.mission.formation.formation_place import STILL, FormationPlace
from agents.mission.formation.formation_planner import STATUS_S, FormationPlanner
from agents.mission.formation.pattern import Pattern, fitted
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.navigation import Navigation
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import OnboardMap
from agents.mission.outbox import Outbox, OutgoingPacket, ReportFormat
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.bidding import Bidding
from fanet_mw.bus.messages import Echo
from fanet_mw.motion import Motion
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Detected, MissionModeChanged, Planned, Sighted
from fanet_mw.units import MAX_NODES, US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Bids, Found, Search, SearchStatus, Told, encode_bids

_OFFSET_DB: Final = 1.0
"""How much one phone's power is taken to differ from another's: standard deviation."""
_REVIEW_NS: Final = 1 * S
_MISSED_SCANS: Final = 1.5
"""A receiver that hears nobody says nothing: after so many intervals of the scan that is what silence means."""
_CLOSE_M: Final = 100.0
"""Slant range of a sighting that confirms."""
_ANGLE_RAD: Final = 0.03
"""Standard deviation of where a camera looks, attitude included."""
_DEPLOY: Final = 0.9
"""Share of its greatest speed at which the slowest UAV takes up its place."""


class Searcher:
    """One UAV."""

    def __init__(
        self, scenario: Scenario, node: NodeId, *, position: Enu, outbox: Outbox, onboard_map: OnboardMap
    ) -> None:
        mission, reach_m = scenario.mission, scenario.radio.range_m
        self._node = node
        self._scan_for_ns = _MISSED_SCANS * mission.scan_interval_s * S
        self._report_ns = seconds_to_ns(mission.report_interval_s)
        self._report_format = ReportFormat(scenario, node)
        self._random = stream(scenario.seed, "mission", node).random
        self._fitted = formation(scenario, scenario.nodes.count)
        self._outbox = outbox
        least_m_s, _ = mission.approach_speeds_m_s
        speed_m_s = approach_speed_m_s(scenario, node)
        self._planner = FormationPlanner(node, expected=scenario.nodes.count, deploy_speed_m_s=_DEPLOY * least_m_s)
        self._finds = finds = Finds(phone_model(scenario))
        self._obstacles = obstacles = KnownObstacles(onboard_map, scenario.world.no_fly_m)
        self._identities = Identities(finds)
        self._navigation = navigation = Navigation(position, obstacles)
        self._neighbors = neighbors = NeighborMotions()
        self._watches_radar = "radar" in mission.avoid_by
        self._avoided = neighbors if "hellos" in mission.avoid_by else NeighborMotions()
        """Those that are avoided where their hellos say that they are; an echo of one of them tells nothing new."""
        self._formation = place = FormationPlace(node, navigation, reach_m=reach_m)
        approach = Approach(node, finds, navigation, outbox, arrival_m=mission.arrival_m)
        self._bidding = Bidding(
            scenario, node, finds=finds, navigation=navigation, formation=place, approach=approach, outbox=outbox,
            speed_m_s=speed_m_s,
        )  # fmt: skip
        self._announcing = Announcing(node, finds, outbox)
        self._goal = Goal(finds, navigation, place, approach)
        self._velocity_choice = VelocityChoice(
            navigation,
            obstacles,
            most_m_s=speed_m_s,
            hard=[
                ClearOfObstacles(navigation, obstacles),
                ClearOfOthers(navigation, self._avoided, obstacles),
            ],
            soft=[InReach(navigation, neighbors, place, reach_m=reach_m)],
        )
        self._return_home = ReturnHome(
            position, navigation, outbox,
            speed_m_s=speed_m_s, height_m=scenario.nodes.altitude_m, reserve=mission.reserve_charge,
        )  # fmt: skip
        self._voice_rad = math.radians(scenario.sensors.voice_sigma_deg)
        self._mode: tuple[str, int] | None = None
        """What we do, and for which survivor, as the trace has it."""
        self.velocity: Enu | None = None
        """A new velocity to fly, for the host to take."""
        self._scan_ns = 0
        self._reported_ns: dict[int, int] = {}
        self._next_review_ns: int | None = None
        self._next_status_ns = 0

    # --- time -----------------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._next_review_ns = now_ns + round(self._random() * _REVIEW_NS)
        self._next_status_ns = now_ns + round(self._random() * 2 * S)

    def next_wake_ns(self) -> int | None:
        return self._next_review_ns

    def wake(self, now_ns: int) -> None:
        if self._next_review_ns is None or now_ns < self._next_review_ns:
            return
        self._next_review_ns = now_ns + _REVIEW_NS
        if now_ns - self._scan_ns > self._scan_for_ns:
            self.scan((), now_ns=now_ns)
        if now_ns >= self._next_status_ns:
            self._say_status(now_ns)
        if self._planner.review(self._fitted, now_ns=now_ns):
            self._adopt(now_ns)
        plans, self._planner.to_tell = self._planner.to_tell, []
        self._outbox.packets += [OutgoingPacket(plan.encode_frame(self._node)) for plan in plans]
        self._identify(now_ns)
        self._announcing.tell(self._bidding.survivor, now_ns)
        if not self._return_home.leaves:
            self._bidding.bid(now_ns)
            self._bidding.choose(now_ns)
        self._record_mode(now_ns)

    def _record_mode(self, now_ns: int) -> None:
        """Write into the trace what we do, when that has changed."""
        survivor = self._bidding.survivor or 0
        mode = (
            "land" if self._return_home.lands
            else "return" if self._return_home.leaves
            else "respond" if survivor
            else "search" if self._formation.is_taken_up(now_ns)
            else "deploy" if self._formation.place is not None
            else "wait"
        )  # fmt: skip
        if self._mode != (mode, survivor):
            self._mode = mode, survivor
            self._outbox.records.append(MissionModeChanged(now_ns, self._node, mode, survivor))

    # --- our own sensors ------------------------------------------------------------------------------------------

    def fix(self, position: Enu, velocity: Enu, *, now_ns: int) -> None:
        """A position fix: where we are, and then how to fly on."""
        self._navigation.fix(position, velocity, now_ns=now_ns)
        if self._return_home.leaves:
            goal, feed = self._return_home.goal(), STILL
        else:
            goal, feed = self._goal.at(self._bidding.survivor, now_ns)
        self.velocity = None if self._return_home.lands else self._velocity_choice.velocity(goal, feed, now_ns)

    def battery(self, charge: float, *, now_ns: int) -> None:
        """The battery says what is left; who has to leave hands its place and its task on at once."""
        if self._return_home.battery(charge, now_ns=now_ns):
            self._bidding.hand_on(now_ns)
            self._formation.leave()
            self._say_status(now_ns)
            self._record_mode(now_ns)

    def scan(self, heard: Sequence[tuple[int, float]], *, now_ns: int) -> None:
        """Our own receiver hears these phones, and no others."""
        self._scan_ns = now_ns
        here = self._navigation.position
        ours = {survivor for survivor, _ in heard}
        for survivor in self._finds.open():
            if survivor not in ours:
                self._finds.known[survivor].filter.silent(here)
        for survivor, rssi_dbm in heard:
            report = Survivor(now_ns // US, survivor, self._node, here, rssi_dbm)
            find = self._finds.known.get(survivor)
            if find is None or self._node not in find.reporters:
                self._outbox.records.append(Detected(now_ns, self._node, survivor, round(rssi_dbm, 2)))
            find = self._finds.report(report, now_ns=now_ns)
            last_ns = self._reported_ns.get(survivor)
            if find.confirmed is None and (last_ns is None or now_ns - last_ns >= self._report_ns):
                self._reported_ns[survivor] = now_ns
                self._outbox.packets.append(self._report_format.packet(report))

    def altimeter(self, above_ground_m: float | None, *, now_ns: int) -> None:
        """The rangefinder tells how high we are over whatever is below; None: nothing is within its range."""
        self._navigation.altimeter(above_ground_m, now_ns=now_ns)

    def radar(self, echoes: Sequence[Echo], *, now_ns: int) -> None:
        """Our radar shows what is around us."""
        if self._watches_radar:
            own = self._navigation
            others = [motion.position_at(now_ns) for motion in self._avoided.all(now_ns=now_ns)]
            self._obstacles.radar(echoes, at=own.position, velocity=own.velocity, neighbors=others, now_ns=now_ns)

    def camera(self, people: Sequence[tuple[float, float]], *, now_ns: int) -> None:
        """Our camera shows people at these bearings and elevations [rad]."""
        for direction in people:
            self._notice("camera", direction, sigma_rad=_ANGLE_RAD, now_ns=now_ns)
        self._identify(now_ns)

    def voice(self, calls: Sequence[tuple[float, float, float]], *, now_ns: int) -> None:
        """Our microphones make out calls at these bearings and elevations [rad], so far above noise [dB]."""
        for bearing_rad, elevation_rad, snr_db in calls:
            sigma_rad = max(_ANGLE_RAD, self._voice_rad * math.pow(10.0, -snr_db / 20))
            self._notice("voice", (bearing_rad, elevation_rad), sigma_rad=sigma_rad, now_ns=now_ns)
        self._identify(now_ns)

    def _notice(self, sensor: str, direction: tuple[float, float], *, sigma_rad: float, now_ns: int) -> None:
        """A sensor that names nobody has noticed somebody on the ground."""
        here = self._navigation.position._replace(up=self._navigation.height_m(now_ns))
        looked = ground_place(here, bearing_rad=direction[0], elevation_rad=direction[1])
        if looked is None or looked[2] > 2 * _CLOSE_M:
            return
        sigma_m = max(1.0, sigma_rad * looked[2] * looked[2] / max(1.0, here.up))
        at = Enu(looked[0], looked[1], 0.0)
        survivor = self._identities.seen(at, sigma_m=sigma_m, close=looked[2] <= _CLOSE_M, now_ns=now_ns)
        self._outbox.records.append(
            Sighted(now_ns, self._node, sensor, survivor or 0, round(at.east, 2), round(at.north, 2))
        )

    # --- what others tell -----------------------------------------------------------------------------------------

    def hello(self, origin: int, motion: Motion, *, now_ns: int) -> None:
        """A neighbor's hello told how it flies."""
        self._neighbors.on_hello(origin, motion)
        self._planner.alive(origin, motion.position, now_ns=now_ns)

    def told(self, message: Told, *, now_ns: int) -> None:
        """Another node told something, to its neighbors or to everyone."""
        match message:
            case Survivor():
                if message.reporter != self._node:
                    self._finds.report(message, now_ns=now_ns)
                    if self._formation.place is not None:
                        self._announcing.reported(message, now_ns)
            case Search():
                if self._planner.planned(message):
                    self._adopt(now_ns)
            case SearchStatus():
                self._planner.status(message, now_ns=now_ns)
            case Bids():
                self._bidding.merge(message.bids, now_ns=now_ns)
            case Found():
                if self._finds.told(message, now_ns=now_ns):
                    self._announcing.struck(message.survivor, now_ns)
                    self._bidding.close(message.survivor, now_ns=now_ns)
            case _:
                assert_never(message)

    # --- what we tell ---------------------------------------------------------------------------------------------

    def hello_frames(self, now_ns: int) -> bytes:
        """Inner frames for the next hello: the latest reports, the best bids, what was found lately."""
        frames = b"".join(report.encode_frame(self._node) for report in self._finds.news(now_ns=now_ns))
        bids = self._bidding.told(now_ns=now_ns)
        if bids:
            frames += encode_bids(bids, node=self._node)
        return frames + self._announcing.hello_frames(now_ns)

    def _say_status(self, now_ns: int) -> None:
        plan = self._planner.plan
        status = SearchStatus(
            now_ns // US, self._navigation.position, self._node, plan.revision if plan else 0, self._return_home.percent
        )
        self._planner.status(status, now_ns=now_ns)
        self._outbox.packets.append(OutgoingPacket(status.encode_frame(self._node)))
        self._next_status_ns = now_ns + round((0.8 + 0.4 * self._random()) * STATUS_S * S)

    def _identify(self, now_ns: int) -> None:
        """Confirm those of whom it is sure whose phones they carry."""
        for survivor in self._identities.review(now_ns):
            self._announcing.confirm(survivor, now_ns)
            self._bidding.close(survivor, now_ns=now_ns)

    def _adopt(self, now_ns: int) -> None:
        plan = self._planner.plan
        assert plan is not None, "there is a plan to adopt"
        self._formation.adopt(plan, now_ns)
        if self._return_home.leaves:
            self._formation.leave()
        place = self._formation.place
        self._outbox.records.append(Planned(now_ns, self._node, plan.revision, -1 if place is None else place))


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

"""What one UAV of a planned search does with its battery, its tasks and its other sensors: timelines."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.mission.outbox import Outbox
from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.searcher import Searcher, formation, phone_model
from fanet_mw.bus.messages import Battery, Call, Camera, Echo, Person, Radar, Voice, WifiScan
from fanet_mw.motion import Motion
from fanet_mw.orders import Order, OrderKind
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, MissionModeChanged, Sighted
from fanet_mw.units import MS, US, Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.search_messages import ROLL_NS, Bid, Bids, Roll, Told, ToldOrder, told_in
from fanet_mw.wire.search_plan import SearchStatus
from fanet_mw.wire.survivors import Found, Standing, Survivor

HOME = Enu(0.0, -100.0, 65.0)
STILL = Enu(0.0, 0.0, 0.0)


class Flight:
    """A searcher, its clock, and what it has told and recorded."""

    def __init__(
        self,
        make_scenario: Callable[..., Scenario],
        node: int = 7,
        *,
        onboard_map: OnboardMap = NO_MAP,
        planned: bool = True,
        home: Enu = HOME,
        lost_link_s: float = 0.0,
        post_m: Sequence[float] = (),
        ceiling_m: float = 120.0,
    ) -> None:
        keys = {
            "nodes.count": 20, "nodes.altitude_m": 65, "mission.survivors": 3, "mission.search": "lines",
            "mobility.model": "onboard", "world.area_m": 1000, "radio.range_m": 250, "sensors.battery_hz": 1,
            "sensors.camera_hz": 2, "mission.lost_link_s": lost_link_s, "ground.at_m": post_m,
            "mission.ceiling_m": ceiling_m,
        }  # fmt: skip
        scenario = make_scenario(**keys)
        self.outbox = Outbox()
        self.searcher = Searcher(
            scenario, NodeId(node), position=home, outbox=self.outbox, onboard_map=onboard_map,
            limits=SearchLimits(scenario),
        )  # fmt: skip
        self.searcher.start(0)
        self.at, self.now_ns = home, 0
        pattern = formation(scenario, 20)
        assert pattern is not None
        self.plan = plan_of(pattern, tuple(range(1, 21)), planner=1, start_us=S // US, deploy_ds=100)
        if planned:
            self.searcher.on_message(self.plan, now_ns=0)

    def fly(
        self,
        seconds: float,
        *,
        charge: Callable[[float], float] | None = None,
        heard: bool = False,
        fixes: bool = True,
    ) -> None:
        """Fly as it wants to; `charge` is what its battery says, by the second. With `heard` it receives the hello of a
        UAV far away once a second; without `fixes` it hovers, and its GPS tells nothing.
        """
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            self.now_ns += 200 * MS
            velocity = (fixes and self.searcher.velocity) or STILL
            self.at = Enu(
                self.at.east + 0.2 * velocity.east, self.at.north + 0.2 * velocity.north, self.at.up + 0.2 * velocity.up
            )
            if fixes:
                self.searcher.fix(self.at, velocity, now_ns=self.now_ns)
            if charge is not None and self.now_ns % S == 0:
                reading = Battery(self.now_ns, 15.0, 20.0, charge(self.now_ns / S))
                self.searcher.on_sensor(reading, now_ns=self.now_ns)
            if heard and self.now_ns % S == 0:
                self.searcher.hello(3, Motion(Enu(0.0, 400.0, 90.0), STILL, self.now_ns), now_ns=self.now_ns)
            self.searcher.wake(self.now_ns)

    @property
    def told(self) -> list[Told]:
        return [message for packet in self.outbox.packets for message in told_in(bytes(HEADER_BYTES) + packet.frames)]

    @property
    def charges(self) -> list[int]:
        """What its statuses have told of its battery [%]; 0 once it has given up its place."""
        return [message.charge for message in self.told if isinstance(message, SearchStatus)]

    @property
    def away_m(self) -> float:
        """Its horizontal distance from home."""
        return math.hypot(self.at.east - HOME.east, self.at.north - HOME.north)

    @property
    def modes(self) -> list[str]:
        return [r.mode for r in self.outbox.records if isinstance(r, MissionModeChanged)]


def test_who_has_just_enough_left_says_so_flies_home_and_lands(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario)
    flight.fly(60, charge=lambda t_s: 0.9 - 0.001 * t_s)
    assert flight.modes == ["deploy", "search"]
    away_m = math.hypot(flight.at.east - HOME.east, flight.at.north - HOME.north)
    assert away_m > 100
    flight.fly(60, charge=lambda t_s: 0.30 - 0.001 * t_s)
    assert flight.modes == ["deploy", "search", "return", "land"]
    assert math.hypot(flight.at.east - HOME.east, flight.at.north - HOME.north) < 5
    course = flight.outbox.course
    assert course is not None
    assert course.land
    flight.outbox.course = None
    flight.fly(0.4)
    assert flight.outbox.course is not None, "a setpoint may be lost: the landing is commanded again at each fix"
    assert min(flight.charges[:3]) > 50
    assert flight.charges[-1] == 0


def test_who_flies_home_stays_below_the_ceiling(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario, ceiling_m=80)
    flight.fly(40, charge=lambda _: 0.9)
    flight.fly(10, charge=lambda _: 0.1)
    assert flight.modes[-1] == "return"
    assert flight.at.up < 80, "18 m above the lanes would be 83 m"


def test_who_hears_nobody_any_more_flies_home_and_lands(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario, lost_link_s=15)
    flight.fly(40, heard=True)
    assert flight.modes == ["deploy", "search"]
    assert flight.away_m > 100
    flight.fly(13)
    assert flight.modes == ["deploy", "search"], "it is silent for 13 s only"
    flight.fly(4)
    assert flight.modes == ["deploy", "search", "lost_link"]
    assert flight.charges[-1] == 0, "others may still hear that its place is free"
    flight.fly(60)
    assert flight.modes == ["deploy", "search", "lost_link", "land"]
    assert flight.away_m < 5
    assert flight.outbox.course is not None
    assert flight.outbox.course.land
    flight.fly(10, heard=True)
    assert flight.modes[-1] == "land"
    assert flight.away_m < 5, "whoever has landed stays there"


def test_who_hears_somebody_again_on_its_way_home_takes_up_its_place_again(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario, lost_link_s=15)
    flight.fly(40, heard=True)
    flight.fly(22)
    assert flight.modes[-1] == "lost_link"
    before_m = flight.away_m
    flight.fly(1, heard=True)
    assert flight.modes[-1] == "search"
    assert flight.charges[-1] > 0, "and it says so at once"
    flight.fly(20, heard=True)
    assert abs(flight.away_m - before_m) > 50, "of the two who are left each has a place"
    flight.fly(17)
    assert flight.modes[-2:] == ["search", "lost_link"], "and the second time as the first"


def test_who_does_not_know_its_place_gives_it_up_at_once_and_takes_one_again_when_it_does(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario)
    flight.fly(40)
    flight.fly(1.2, fixes=False)
    assert (flight.modes[-1], flight.charges[-1] > 0) == ("search", True), "a fix or two may be missing"
    flight.fly(1.4, fixes=False)
    assert (flight.modes[-1], flight.charges[-1]) == ("lost_position", 0), "it holds nobody together any more"
    flight.fly(1)
    assert (flight.modes[-1], flight.charges[-1] > 0) == ("search", True)
    at = flight.at
    flight.fly(10)
    assert flight.at.horizontal_to(at) > 30, "and flies on"


def test_who_has_not_known_its_place_for_longer_than_its_flight_controller_waits_is_landed_and_takes_none_again(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario)
    flight.fly(40)
    flight.fly(5.4, fixes=False)
    before_m = flight.away_m
    flight.fly(8)
    assert (flight.modes[-1], flight.charges[-1]) == ("lost_position", 0)
    assert flight.away_m < before_m - 30, "if it still obeys, it comes home"


def test_who_is_recalled_while_it_does_not_know_its_place_comes_home_once_it_does(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario, post_m=(0.0, -100.0))
    flight.fly(40)
    flight.fly(3, fixes=False)
    assert flight.modes[-1] == "lost_position"
    order = ToldOrder(43 * S // US, 21, 1, Order(OrderKind.RECALL, 7))
    flight.searcher.on_message(order, now_ns=flight.now_ns)
    flight.fly(10)
    assert (flight.modes[-1], flight.charges[-1]) == ("recall", 0)


@pytest.mark.parametrize("kind", [OrderKind.STAY, OrderKind.SEARCH])
def test_who_was_recalled_and_is_then_sent_to_a_place_flies_there(
    make_scenario: Callable[..., Scenario], kind: OrderKind
) -> None:
    flight = Flight(make_scenario, post_m=(0.0, -100.0))
    flight.fly(40)
    for serial, order in enumerate((Order(OrderKind.RECALL, 7), Order(kind, 7, 0.0, 300.0, 50.0)), start=1):
        flight.searcher.on_message(ToldOrder(flight.now_ns // US, 21, serial, order), now_ns=flight.now_ns)
        flight.fly(5)
    assert (flight.modes[-1], flight.charges[-1]) == ("errand", 0), "the newest order holds"
    flight.fly(60)
    assert flight.at.horizontal_to(Enu(0.0, 300.0, 0.0)) < 90


def test_who_was_sent_to_a_place_stays_there_when_the_search_is_over(make_scenario: Callable[..., Scenario]) -> None:
    modes = []
    for orders in ([], [Order(OrderKind.STAY, 7, 0.0, 100.0)]):
        flight = Flight(make_scenario, post_m=(0.0, -100.0))
        flight.searcher._limits.change("sweeps", 1)
        flight.fly(20)
        for order in orders:
            flight.searcher.on_message(ToldOrder(flight.now_ns // US, 21, 1, order), now_ns=flight.now_ns)
        flight.fly(100)
        modes.append(flight.modes[-1])
    assert modes == ["done", "errand"]


def test_who_flies_home_already_flies_on_once_it_knows_its_place_again(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario)
    flight.fly(40)
    flight.fly(2, charge=lambda _: 0.05)
    flight.fly(3, fixes=False)
    assert flight.modes[-1] == "return"
    flight.fly(60)
    assert flight.modes[-1] == "land"


def test_a_low_battery_takes_a_uav_home_for_good_even_if_it_hears_somebody_again(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario, lost_link_s=15)
    flight.fly(60, heard=True)
    flight.fly(17)
    flight.fly(2, charge=lambda _: 0.1)
    flight.fly(2, heard=True)
    assert flight.modes[-2:] == ["lost_link", "return"]


def test_who_has_never_heard_anybody_or_is_not_asked_to_mind_searches_on(
    make_scenario: Callable[..., Scenario],
) -> None:
    alone, unasked = Flight(make_scenario, lost_link_s=5, planned=False), Flight(make_scenario)
    unasked.fly(2, heard=True)
    for flight in (alone, unasked):
        flight.fly(40)
        assert flight.modes[-1] != "lost_link"


def test_who_flies_home_takes_its_bids_back_so_that_another_goes(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario, node=20)  # a follower
    other = Flight(make_scenario, node=19)
    for each in (flight, other):
        each.fly(20, charge=lambda _: 0.9)
        for reporter in (1, 2, 3):
            place = Enu(flight.at.east + 60 * reporter - 120, flight.at.north + 30.0 * (reporter % 2), 65.0)
            each.searcher.on_message(Survivor(each.now_ns // US, 1, reporter, place, -75.0), now_ns=each.now_ns)
    flight.fly(3, charge=lambda _: 0.9)
    assert flight.modes[-1] == "respond"
    flight.fly(1, charge=lambda _: 0.1)
    assert flight.modes[-1] == "return"
    bids = [
        m for m in told_in(bytes(HEADER_BYTES) + flight.searcher.hello_frames(flight.now_ns)) if isinstance(m, Bids)
    ]
    (bid,) = [bid for message in bids for bid in message.bids if bid.bidder == 20]
    assert bid.eta_ds == 0xFFFF, "it is withdrawn"


def test_a_responder_that_falls_silent_is_replaced(make_scenario: Callable[..., Scenario]) -> None:
    flight = Flight(make_scenario, node=20)
    flight.fly(20)
    now_ns = flight.now_ns
    for step, (east, north) in enumerate(((-60, 0), (60, 0), (0, 60), (0, -60), (90, 90), (-90, -90))):
        place = Enu(flight.at.east + east, flight.at.north + north, 65.0)
        rssi_dbm = 15 - 40.05 - 30 * math.log10(math.hypot(east, north, 65.0))
        flight.searcher.on_message(Survivor(now_ns // US, 1, 1 + step % 3, place, rssi_dbm), now_ns=now_ns)
    flight.searcher.on_message(Bids((Bid(1, 2, 1, 1), Bid(1, 3, 1, 1), Bid(1, 4, 1, 1, 9))), now_ns=now_ns)
    flight.fly(5)
    assert flight.modes[-1] == "search", "three others are nearer"
    for second in range(6, 10):  # two of them go on saying so
        flight.searcher.on_message(Bids(tuple(Bid(1, bidder, 1, 1) for bidder in (2, 3))), now_ns=now_ns + second * S)
        flight.fly(1)
    assert flight.modes[-1] == "respond"


@pytest.mark.parametrize("sensor", ["camera", "voice"])
def test_somebody_who_is_seen_or_heard_at_close_range_is_confirmed(
    make_scenario: Callable[..., Scenario], sensor: str
) -> None:
    flight = Flight(make_scenario, node=20)
    flight.fly(12)
    victim = flight.at
    for step in range(12):
        around = Enu(victim.east + 60 * math.cos(step), victim.north + 60 * math.sin(step), 65.0)
        slant = math.hypot(60, 65)
        report = Survivor(flight.now_ns // US, 2, 1 + step % 4, around, 15 - 40.05 - 30 * math.log10(slant))
        flight.searcher.on_message(report, now_ns=flight.now_ns)
    for _ in range(30):
        here = flight.at
        rssi_dbm = 15 - 40.05 - 30 * math.log10(here.minus(victim._replace(up=0)).norm())
        flight.searcher.on_sensor(WifiScan(flight.now_ns, ((2, rssi_dbm),)), now_ns=flight.now_ns)
        east, north = victim.east - here.east, victim.north - here.north
        bearing, elevation = math.atan2(east, north), -math.atan2(here.up, math.hypot(east, north))
        if sensor == "camera":
            flight.searcher.on_sensor(Camera(flight.now_ns, (Person(bearing, elevation, 20.0),)), now_ns=flight.now_ns)
        else:
            call = Call(bearing, elevation, 60.0, 20.0)
            flight.searcher.on_sensor(Voice(flight.now_ns, (call,)), now_ns=flight.now_ns)
        flight.fly(1)
    found = [r for r in flight.outbox.records if isinstance(r, Confirmed)]
    assert [r.survivor for r in found] == [2]
    assert math.hypot(found[0].east_m - victim.east, found[0].north_m - victim.north) < 3
    assert {r.sensor for r in flight.outbox.records if isinstance(r, Sighted)} == {sensor}


def oncoming(flight: Flight) -> tuple[Motion, Echo]:
    """A UAV 50 m ahead that flies towards this one, as it says itself and as the radar shows it."""
    velocity = flight.searcher.velocity or STILL
    speed = math.hypot(velocity.east, velocity.north)
    assert speed > 1
    ahead = Enu(velocity.east / speed, velocity.north / speed, 0.0)
    other = Enu(flight.at.east + 50 * ahead.east, flight.at.north + 50 * ahead.north, flight.at.up)
    back = Enu(-8 * ahead.east, -8 * ahead.north, 0.0)
    echo = Echo(50.0, math.atan2(ahead.east, ahead.north) % (2 * math.pi), 0.0, speed + 8, 15.0)
    return Motion(other, back, flight.now_ns), echo


def test_a_uav_that_hears_that_it_is_lost_keeps_its_place_far_above_those_who_close_ranks(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario)
    flight.fly(30)
    here, plan = flight.at, flight.plan
    lost = frozenset({plan.nodes.index(7)})
    for _ in range(20):
        at = flight.now_ns // ROLL_NS
        told = Roll(at, plan.planner, plan.revision, (0,) * len(plan.nodes), lost)
        flight.searcher.on_message(told, now_ns=flight.now_ns)
        flight.fly(1)
    assert flight.at.up > here.up + 20
    told = Roll(flight.now_ns // ROLL_NS, plan.planner, plan.revision, (0,) * len(plan.nodes), frozenset())
    flight.searcher.on_message(told, now_ns=flight.now_ns)
    flight.fly(20)
    assert flight.at.up < here.up + 3, "it is heard again"


def test_who_is_mute_stays_below_the_ceiling_and_apart_from_those_mute_beside_it(
    make_scenario: Callable[..., Scenario],
) -> None:
    """They flew up to 86 m above their lanes, at 151 m."""
    heights_m = []
    for node in range(1, 8):
        flight = Flight(make_scenario, node, home=HOME._replace(up=90.0))
        flight.fly(1)
        lost = frozenset({flight.plan.nodes.index(node)})
        for _ in range(30):
            at, plan = flight.now_ns // ROLL_NS, flight.plan
            told = Roll(at, plan.planner, plan.revision, (0,) * len(plan.nodes), lost)
            flight.searcher.on_message(told, now_ns=flight.now_ns)
            flight.fly(1)
        heights_m.append(flight.at.up)
    assert max(heights_m) < 117
    assert min(heights_m) > 65 + 18 + 4, "above those who fly home"
    assert min(higher - up for up, higher in pairwise(sorted(heights_m))) > 4


@pytest.mark.parametrize("by", ["hellos", "radar"])
def test_another_uav_is_avoided_by_its_hellos_and_by_radar(make_scenario: Callable[..., Scenario], by: str) -> None:
    """`by`: what tells of the other UAV."""
    met, alone = (Flight(make_scenario) for _ in range(2))
    for flight in (met, alone):
        flight.fly(4)
    motion, echo = oncoming(met)
    if by == "hellos":
        met.searcher.hello(3, motion, now_ns=met.now_ns)
    else:
        met.searcher.on_sensor(Radar(met.now_ns, (echo,)), now_ns=met.now_ns)
    for flight in (met, alone):
        flight.fly(0.4)
    assert (met.searcher.velocity or STILL).minus(alone.searcher.velocity or STILL).norm() > 0.5


def test_a_uav_that_fell_silent_in_the_way_is_flown_around_long_after(make_scenario: Callable[..., Scenario]) -> None:
    met, alone = (Flight(make_scenario) for _ in range(2))
    for flight in (met, alone):
        flight.fly(12)
    alone.fly(12)
    met.searcher.hello(3, Motion(alone.at, STILL, met.now_ns), now_ns=met.now_ns)
    nearest_m = 1e9
    for _ in range(20):
        met.fly(1)
        nearest_m = min(nearest_m, met.at.minus(alone.at).norm())
    assert 5.0 < nearest_m < 50.0


@pytest.mark.parametrize(
    ("planned", "seconds", "highest_m"), [(False, 12, 66.0), (True, 40, 72.0)], ids=["waiting", "in its place"]
)
def test_heights_are_over_the_ground_with_and_without_a_plan(
    make_scenario: Callable[..., Scenario], planned: bool, seconds: int, highest_m: float
) -> None:
    plateau = OnboardMap((), ((30.0, 30.0), (30.0, 30.0)), 2000.0)
    flight = Flight(make_scenario, onboard_map=plateau, planned=planned, home=HOME._replace(up=95.0))
    flight.fly(seconds)
    assert 64.0 < flight.at.up - 30.0 < highest_m, "lanes are at 65 m, relays 6 m higher"


def test_a_survivor_whose_confirmation_is_taken_back_is_searched_for_again(
    make_scenario: Callable[..., Scenario],
) -> None:
    flight = Flight(make_scenario, node=20)  # a follower
    flight.fly(20)
    found = Found(
        flight.now_ns // US, 1, round(flight.at.east), round(flight.at.north), 4.0, 0.0, 4.0, 3, Standing.CONFIRMED
    )
    for reporter in (1, 2, 3):
        place = Enu(flight.at.east + 60 * reporter - 120, flight.at.north + 30.0 * (reporter % 2), 65.0)
        flight.searcher.on_message(Survivor(flight.now_ns // US, 1, reporter, place, -75.0), now_ns=flight.now_ns)
    flight.searcher.on_message(found, now_ns=flight.now_ns)
    flight.fly(3)
    assert flight.modes[-1] == "search", "it is struck off"
    refuted = found._replace(t_us=flight.now_ns // US, node=4, standing=Standing.REFUTED)
    flight.searcher.on_message(refuted, now_ns=flight.now_ns)
    flight.fly(3)
    assert flight.modes[-1] == "respond"
    assert told_in(bytes(HEADER_BYTES) + flight.searcher.hello_frames(flight.now_ns))[-2] == refuted, "it passes it on"


def test_a_plan_that_allows_for_rubble_has_lanes_between_which_a_phone_under_it_is_received(
    make_scenario: Callable[..., Scenario],
) -> None:
    keys = {
        "nodes.count": 12, "nodes.altitude_m": 20, "mission.survivors": 3, "mission.search": "spiral",
        "mobility.model": "onboard", "world.area_m": 500, "radio.range_m": 250, "sensors.camera_hz": 2,
    }  # fmt: skip
    open_air, rubble = (make_scenario(**keys, **{"mission.rubble_db": loss_db}) for loss_db in (0, 20))
    heard_m = math.sqrt((10 ** ((15 - 20 - 40.05 + 90) / 30)) ** 2 - 20**2)
    patterns = formation(open_air, 12), formation(rubble, 12)
    lanes_m = [pattern.shape.lane_m for pattern in patterns if pattern is not None]
    assert lanes_m[0] > 120
    assert heard_m < lanes_m[1] <= 1.35 * heard_m
    assert phone_model(open_air)[:4] == (15.0, 3.0, 4.0, 1.0)
    assert phone_model(rubble).power_dbm == 5.0, "in the middle between a phone in the open and one under rubble"
    assert phone_model(rubble).offset_db == pytest.approx(10.0, abs=0.1), "both are within a standard deviation"

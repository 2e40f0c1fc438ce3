"""Ground stations over the air: the post on the ground sends commands to UAVs hops away, and hears their answers."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest
from kit import slow

from fanet_mw import mavlink
from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.mavlink import Geodetic, common
from fanet_mw.routing.rounds.delay_law import DelayLaw
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Generated
from fanet_mw.units import MS, Enu, NodeId, S
from sim.observation.observer import Observer
from sim.planner.answer import judge
from sim.run.virtual import Observed

GCS = (255, 190)
HOP_M = 180.0


def line(count: int, **changes: Any) -> Scenario:
    """UAVs on the ground in a line to the east of the post, each in reach of its neighbors alone."""
    places = [[HOP_M * number, 0.0, 0.0] for number in range(1, count + 1)]
    return config.build(
        {
            "duration_s": 400,
            "seed": 1,
            "nodes": {"count": count, "layout": "explicit", "positions_m": places, "on_ground": True, "altitude_m": 20},
            "ground": {"at_m": [0.0, 0.0]},
            "traffic": {"arrivals": "none"},
            "routing": {"protocol": "flooding"},
            "radio": {"channel": "range", "range_m": 220, "lead_ms": 0},
            "mobility": {"model": "onboard", "speed_m_s": 12},
            "world": {"area_m": 4000, "engine": "kinematic", "navigation": "perfect", "gps_sigma_m": 0},
            "sensors": {"gps_common_m": 0, "gps_bias_m": 0},
            **changes,
        }
    )


class AtPost(Observer):
    """Keeps what is tapped at the post."""

    def __init__(self, post: int, heard: list[tuple[int, Any]]) -> None:
        self._post, self._heard = post, heard

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        if node == self._post:
            self._heard += [(t_ns, message) for message in mavlink.decode(data)]


class Station:
    """A ground station at the post of a swarm in virtual time."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        assert scenario.post is not None
        self.post = scenario.post
        self.heard: list[tuple[int, Any]] = []
        """What came to the post over the air, with its instants; the taps of UAVs themselves do not count."""
        self.observed = Observed(scenario, observer=AtPost(self.post, self.heard))
        self.host = self.observed.host
        self.host.start()
        self.mav = common.MAVLink(None, srcSystem=GCS[0], srcComponent=GCS[1])
        self._beat_ns = 0

    @property
    def now_ns(self) -> int:
        return self.host.now_ns

    def say(self, message: Any) -> None:
        frame = bytes(message.pack(self.mav))
        self.host.put(self.observed.names.operator(self.post), MavlinkTap(0, frame))

    def run(self, seconds: float) -> None:
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            if self.now_ns >= self._beat_ns:
                self._beat_ns = self.now_ns + S
                self.say(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            self.host.run(min(until_ns, self.now_ns + S // 100))

    def wait(self, kind: str, *, of: int, seconds: float = 20.0, since: int = 0) -> Any:
        """The next message of a kind from a UAV."""
        for _ in range(round(seconds * 20)):
            for _, message in self.heard[since:]:
                if message.get_type() == kind and message.get_srcSystem() == of:
                    return message
            self.run(0.05)
        raise AssertionError(f"no {kind} of {of} within {seconds} s")

    def command(self, of: int, number: int, *params: float) -> tuple[int, float]:
        """Say a command until it is acknowledged; returns its result and how long that took [s]."""
        began_ns, before = self.now_ns, len(self.heard)
        seven = [*params, *[0.0] * (7 - len(params))]
        for again in range(5):
            self.say(common.MAVLink_command_long_message(of, 1, number, again, *seven))
            try:
                ack = self.wait("COMMAND_ACK", of=of, seconds=2.0, since=before)
            except AssertionError:
                continue
            assert ack.command == number
            came_ns = next(t_ns for t_ns, message in self.heard[before:] if message is ack)
            return ack.result, (came_ns - began_ns) / S
        raise AssertionError(f"command {number} of {of} was not acknowledged")

    def upload(self, of: int, items: list[Any]) -> int:
        """Upload a mission, item by item as it is asked for."""
        before = len(self.heard)
        self.say(common.MAVLink_mission_count_message(of, 1, len(items)))
        answered = -1
        for _ in range(400):
            self.run(0.05)
            for at, (_, message) in enumerate(self.heard[before:]):
                if message.get_srcSystem() != of or at <= answered:
                    continue
                if message.get_type() == "MISSION_ACK":
                    return int(message.type)
                if message.get_type() == "MISSION_REQUEST_INT":
                    answered = at
                    self.say(items[message.seq])
        raise AssertionError("the upload did not end")


def waypoint(of: int, seq: int, command: int, east: float, north: float, up: float) -> Any:
    place = mavlink.to_geodetic(Enu(east, north, 0.0), Geodetic(37.5665, 126.978, 0.0))
    x, y = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)) if command == 16 else (0, 0)
    return common.MAVLink_mission_item_int_message(of, 1, seq, 6, command, 0, 1, 0, 0, 0, math.nan, x, y, up)


def test_a_mission_uploaded_to_a_uav_two_hops_away_is_flown() -> None:
    station, far = Station(line(2)), 2
    station.run(4)
    places = [(340.0, 60.0), (300.0, 100.0)]
    items = [waypoint(far, 0, 22, 0, 0, 20.0), *(waypoint(far, n + 1, 16, *at, 20.0) for n, at in enumerate(places))]
    assert station.upload(far, items) == common.MAV_MISSION_ACCEPTED
    assert station.command(far, 400, 1)[0] == 0
    assert station.command(far, 300)[0] == 0
    for seq in range(3):
        for _ in range(400):
            if any(m.get_type() == "MISSION_ITEM_REACHED" and m.seq == seq for _, m in station.heard):
                break
            station.run(0.1)
        else:
            raise AssertionError(f"item {seq} was not reached")
    position = [m for _, m in station.heard if m.get_type() == "GLOBAL_POSITION_INT" and m.get_srcSystem() == far][-1]
    at = mavlink.kinematics(position, Geodetic(37.5665, 126.978, 0.0)).position
    assert at == pytest.approx((300, 100, 20), abs=15)


@pytest.mark.parametrize("protocol", [*slow("flooding"), "rounds"])
def test_telemetry_comes_at_the_stated_pace_from_every_uav_and_stops_with_the_operator(protocol: str) -> None:
    from agents.ground_control.telemetry_pace import pace_of

    scenario = line(3, routing={"protocol": protocol})
    station, pace = Station(scenario), pace_of(scenario)
    station.run(30)
    beats = Counter(
        m.get_srcSystem() for _, m in station.heard if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 1
    )
    for node in (1, 2, 3):
        assert beats[node] == pytest.approx(27e9 / pace.interval_ns, rel=0.2)
    before = len(station.heard)
    station._beat_ns = 1 << 62
    station.run(40)
    later = [t_ns for t_ns, m in station.heard[before:] if m.get_type() == "HEARTBEAT"]
    assert max(later) < 30 * S + 12 * S + 2 * pace.interval_ns


def test_a_plan_says_within_what_a_command_comes_and_to_whom_not() -> None:
    _, content, _ = judge(line(3, routing={"protocol": "rounds"}))
    scenario = line(3, routing={"protocol": "rounds"})
    known_s = DelayLaw(RoundTiming.of(scenario), scenario).silent_ns / S
    assert known_s < content["from_s"]
    assert f"within {content['bound_ms']:.0f} ms" in content["operator"]
    assert f"but to a UAV that has left the air, which is known after {known_s:.1f} s" in content["operator"]


def test_a_command_reaches_a_cut_uav_when_the_cut_is_over() -> None:
    scenario = line(2, faults=[{"kind": "cut", "node": 2, "at_s": 6, "for_s": 6}])
    station = Station(scenario)
    station.run(7)
    station.say(common.MAVLink_command_long_message(2, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    with pytest.raises(AssertionError, match="no COMMAND_ACK"):
        station.wait("COMMAND_ACK", of=2, seconds=3)
    station.run(4)
    assert station.command(2, 400, 1)[0] == 0


def test_a_forged_command_of_another_node_is_counted_and_not_obeyed() -> None:
    from agents.ground_control.application import GroundControl
    from fanet_mw.application import Received

    scenario = line(2)
    station = Station(scenario)
    station.run(2)
    uav = next(actor for actor in station.observed.actors if actor.name == "agent-1")
    control: GroundControl = uav._ground_control  # type: ignore[attr-defined]
    frame = bytes(common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(station.mav))
    control.on_message(Received(NodeId(2), NodeId(1), 1, station.now_ns, 1, b"", content=frame), station.now_ns)
    assert control.report()["operator_not_from_the_post"] == 1
    assert not control._pilot.armed


def flown(*, floods: bool) -> tuple[float, int, list["Pair"], Mapping[str, Any]]:
    """Nine UAVs with traffic for 12 s: the share of it that is delivered, its longest delay, the post's packets with
    bounds, and its counters.

    `floods`: a ground station says 2,000 commands a second.
    """
    places = [[100.0 + 100.0 * (n % 3), 100.0 * (n // 3), 0.0] for n in range(9)]
    station = Station(
        line(
            1,
            nodes={"count": 9, "layout": "explicit", "positions_m": places, "on_ground": True},
            routing={"protocol": "rounds"},
            radio={"channel": "range", "range_m": 220, "lead_ms": 0},
            traffic={"interval_s": 0.5, "sources": 4, "payload_bytes": 200, "start_s": 2},
        )
    )
    for step in range(1200):
        station.run(0.01)
        for number in range(20 if floods else 0):
            seven = (step % 256, number, 0, 0, 0, 0, 0)
            station.say(common.MAVLink_command_long_message(1 + number % 9, 1, 400, 0, *seven))
    sent = {
        (record.node, record.seq)
        for record in station.observed.records
        if isinstance(record, Generated) and record.app == "traffic" and record.t_ns < 9 * S
    }
    took = [
        record.delay_ns
        for record in station.observed.records
        if isinstance(record, Delivered) and (record.origin, record.seq) in sent and record.node != station.post
    ]
    (post,) = (actor for actor in station.observed.actors if actor.name == f"agent-{station.post}")
    return len(took) / len(sent) / 8, max(took), bounded(station), post.report()


@pytest.mark.slow
def test_a_ground_station_that_floods_cannot_starve_the_swarm(capsys: pytest.CaptureFixture[str]) -> None:
    quiet, flooded = flown(floods=False), flown(floods=True)
    with capsys.disabled():
        for name, (share, longest_ns, pairs, post) in (("quiet", quiet), ("flooded", flooded)):
            late = sum(pair.delay_ns > pair.bound_ns for pair in pairs)
            print(f"{name}: {share:.4f} of the swarm's own traffic delivered, the last after {longest_ns / MS:.0f} ms;")
            print(f"  {post['operator_sent']} packets of the operator on the air, {late} of {len(pairs)} bounds broken")
    assert flooded[3]["operator_sent"] < 13 * 41
    assert flooded[3]["operator_too_many"] > 20_000
    assert flooded[0] > quiet[0] - 0.005
    assert flooded[1] < 3 * S
    assert len(flooded[2]) > 400
    assert all(pair.delay_ns <= pair.bound_ns for pair in flooded[2])


FAULTS = {
    "-": lambda _: [],
    "loss": lambda _: [{"kind": "degrade", "loss_share": 0.1, "at_s": 1}],
    "cuts": lambda count: [
        {"kind": "cut", "node": n + 1, "at_s": 10 + n % 8 + 10 * k, "for_s": 2} for n in range(count) for k in range(4)
    ],
}  # fmt: skip
"""`loss`: every link loses a tenth of its frames; `cuts`: each UAV is off the air for 2 of every 10 s."""


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("faults", ["-", "loss", *slow("cuts")])
@pytest.mark.parametrize(
    ("protocol", "count"),
    [("rounds", 1), *slow(("flooding", 1), ("flooding", 9), ("flooding", 45), ("rounds", 9), ("rounds", 45))],
)
def test_how_long_commands_take(protocol: str, count: int, faults: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The figures of docs/how-to/ground-stations.md: a row of its table each."""
    side = math.ceil(math.sqrt(count))
    places = [[100.0 + 100.0 * (n % side), 100.0 * (n // side), 0.0] for n in range(count)]
    nodes = {"count": count, "layout": "explicit", "positions_m": places, "on_ground": True}
    radio = {"channel": "range", "range_m": 220, "lead_ms": 0, "cw_min": 7 if protocol == "rounds" else 31}
    station = Station(line(1, nodes=nodes, faults=FAULTS[faults](count), routing={"protocol": protocol}, radio=radio))
    station.run(6)
    began_ns, before = station.now_ns, len(station.heard)
    took = []
    for number in range(100):
        result, seconds = station.command(1 + number % count, 400, 1)
        assert result == 0
        took.append(seconds)
        station.run(0.3)
    beats = sum(m.get_type() == "HEARTBEAT" for _, m in station.heard[before:])
    rate = beats / count / ((station.now_ns - began_ns) / S)
    took.sort()
    pairs = bounded(station)
    kept = [pair for pair in pairs if pair.delay_ns <= pair.bound_ns]
    broken = [pair for pair in pairs if pair.delay_ns > pair.bound_ns]
    unlucky = [pair for pair in broken if not was_cut(station.scenario, pair)]
    """Others than the UAVs that were cut: what was for them was with relays that were."""
    bound = (
        f"{max(pair.bound_ns for pair in pairs) / MS:.0f} | {max(pair.delay_ns for pair in kept) / MS:.0f} "
        f"| {len(kept)} | {len(broken) - len(unlucky)} | {len(unlucky)}"
        if kept
        else "- | - | - | - | -"
    )
    with capsys.disabled():
        median, worst = 1000 * took[50], 1000 * took[98]
        print(f"| {protocol} | {count} | {faults} | {rate:.2f} | {median:.1f} | {worst:.0f} | {bound} |")
    assert took[50] < 0.5
    assert (protocol == "rounds") == bool(kept)
    assert not unlucky or (count == 45 and faults == "cuts" and len(unlucky) < 0.1 * len(pairs))
    if faults == "-":
        assert took[98] < 1.0


class Pair(NamedTuple):
    """A packet of the post that came to the UAV for which it was meant, and for which a bound was stated."""

    node: int
    said_ns: int
    delay_ns: int
    bound_ns: int


def bounded(station: Station) -> list[Pair]:
    """All pairs; a bound does not hold for nodes that it excludes."""
    stated: dict[int, BoundStated] = {}
    excluded: set[tuple[int, int]] = set()
    found = []
    for record in station.observed.records:
        match record:
            case BoundStated() if record.node == station.post:
                stated[record.seq] = record
            case BoundExcludes() if record.node == station.post:
                excluded.add((record.seq, record.other))
            case Delivered() if record.origin == station.post and (record.seq, record.node) not in excluded:
                if (bound := stated.get(record.seq)) is not None:
                    found.append(Pair(record.node, bound.t_ns, record.delay_ns, bound.bound_ns))
    return found


def was_cut(scenario: Scenario, pair: Pair) -> bool:
    """True if the UAV left the air before the bound was over, so lately that the swarm could not know it when the bound
    was stated.
    """
    known_ns = DelayLaw(RoundTiming.of(scenario), scenario).silent_ns
    return any(
        fault.kind == "cut"
        and fault.node == pair.node
        and pair.said_ns - known_ns <= round(fault.at_s * S) <= pair.said_ns + pair.bound_ns
        for fault in scenario.faults
    )

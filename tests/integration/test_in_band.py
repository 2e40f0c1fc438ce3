"""Ground stations over the air: the post on the ground sends commands to UAVs hops away, and hears their answers."""

import math
from collections import Counter
from typing import Any

import pytest

from fanet_mw import mavlink
from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.mavlink import Geodetic, common
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import BoundStated, Delivered
from fanet_mw.units import MS, Enu, NodeId, S
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


class AtPost:
    """Keeps what is tapped at the post."""

    def __init__(self, post: int, heard: list[tuple[int, Any]]) -> None:
        self._post, self._heard = post, heard

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        if node == self._post:
            self._heard += [(t_ns, message) for message in mavlink.decode(data)]

    def take_links(self, _: object) -> None: ...

    def take_poses(self, _: object) -> None: ...

    def take_records(self, _: object) -> None: ...

    def take_report(self, *_: object) -> None: ...


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


@pytest.mark.parametrize("protocol", ["flooding", "rounds"])
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


FAULTS = {
    "-": lambda _: [],
    "loss": lambda _: [{"kind": "degrade", "loss_share": 0.1, "at_s": 1}],
    "cuts": lambda count: [
        {"kind": "cut", "node": n + 1, "at_s": 10 + n % 8 + 10 * k, "for_s": 2} for n in range(count) for k in range(4)
    ],
}  # fmt: skip
"""`loss`: every link loses a tenth of its frames; `cuts`: each UAV is off the air for 2 of every 10 s."""
slow = pytest.mark.slow


@pytest.mark.parametrize("faults", [*FAULTS])
@pytest.mark.parametrize(
    ("protocol", "count"),
    [
        ("flooding", 1), pytest.param("flooding", 9, marks=slow), pytest.param("flooding", 45, marks=slow),
        ("rounds", 1), pytest.param("rounds", 9, marks=slow), pytest.param("rounds", 45, marks=slow),
    ],
)  # fmt: skip
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
    kept = bounded(station)
    bound = f"{max(ns for _, ns in kept) / MS:.0f} | {max(ns for ns, _ in kept) / MS:.0f}" if kept else "- | -"
    with capsys.disabled():
        median, worst = 1000 * took[50], 1000 * took[98]
        print(f"| {protocol} | {count} | {faults} | {rate:.2f} | {median:.1f} | {worst:.0f} | {bound} |")
    assert took[50] < 0.5
    if faults == "-":
        assert took[98] < 1.0
        assert all(delay_ns <= bound_ns for delay_ns, bound_ns in kept)
        assert (protocol == "rounds") == bool(kept)


def bounded(station: Station) -> list[tuple[int, int]]:
    """Delay and stated bound of each packet of the post that came to the UAV for which it was meant."""
    stated: dict[int, int] = {}
    found = []
    for record in station.observed.records:
        if isinstance(record, BoundStated) and record.node == station.post:
            stated[record.seq] = record.bound_ns
        elif isinstance(record, Delivered) and record.origin == station.post and record.seq in stated:
            found.append((record.delay_ns, stated[record.seq]))
    return found

"""What of ground stations the post puts on the air."""

from typing import Any

import pytest

from agents.applications.telemetry_streams import TelemetryStreams
from agents.ground.operator_relay import ANSWERS, MOST_PER_S, OperatorRelay
from fanet_mw.mavlink import common, decode
from fanet_mw.units import MS, STILL, NodeId, S


class Air:
    """Keeps what is sent, and by whom it was said."""

    def __init__(self) -> None:
        self.systems: list[int] = []
        self.said: list[str] = []

    def send(self, data: bytes, **_: object) -> None:
        self.systems.append(data[5])
        self.said += [message.get_type() for message in decode(data)]


@pytest.fixture
def post(make_scenario: Any) -> tuple[OperatorRelay, Air]:
    relay, air = OperatorRelay(make_scenario(**{"nodes.count": 45, "ground.at_m": (0.0, -150.0)})), Air()
    relay.port = air  # type: ignore[assignment]
    return relay, air


def by_ground_station(*messages: Any) -> bytes:
    return b"".join(bytes(message.pack(common.MAVLink(None, srcSystem=255, srcComponent=190))) for message in messages)


def arm(uav: int) -> Any:
    return common.MAVLink_command_long_message(uav, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def heartbeat(system: int) -> bytes:
    mav = common.MAVLink(None, srcSystem=system, srcComponent=190)
    return bytes(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mav))


def test_ground_stations_that_have_gone_keep_no_later_one_from_being_told(make_scenario: Any) -> None:
    relay, air = OperatorRelay(make_scenario(**{"nodes.count": 3, "ground.at_m": (0.0, -150.0)})), Air()
    relay.port = air  # type: ignore[assignment]
    for now_ns, systems in ((0, range(201, 212)), (S, range(201, 209)), (60 * S, (240,)), (61 * S, (240,))):
        for system in systems:
            relay.on_operator(heartbeat(system), now_ns)
    assert air.systems == [*range(201, 209), 240], "as many as eight in two seconds, and each once"


def test_what_no_uav_understands_takes_no_air_from_commands(post: tuple[OperatorRelay, Air]) -> None:
    """A joystick of QGroundControl says 25 times a second where it is, a base of RTK sends corrections for all."""
    relay, air = post
    for step in range(50):
        stick = common.MAVLink_manual_control_message(1, step, 0, 500, 0, 0)
        base = common.MAVLink_gps_rtcm_data_message(0, 180, [step] * 180)
        time = common.MAVLink_system_time_message(step, step)
        relay.on_operator(by_ground_station(stick, base, time, base), step * 20 * MS)
    relay.on_operator(by_ground_station(arm(3)), 999 * MS)
    assert air.said == ["COMMAND_LONG"]
    assert relay.report()["operator_not_over_air"] == 200


def test_nobody_asks_all_uavs_at_once_how_late_it_is_and_each_no_more_often_than_it_can_answer(
    post: tuple[OperatorRelay, Air],
) -> None:
    """MAVROS asks ten times a second, and each UAV would answer each time."""
    relay, air = post
    for step in range(30):
        asked = common.MAVLink_timesync_message(0, 1 + step), common.MAVLink_ping_message(step, step, 0, 0)
        one = common.MAVLink_ping_message(step, step, 7, 1)
        relay.on_operator(by_ground_station(*asked, one), step * 100 * MS)
    assert air.said == ["PING"] * 3


def test_a_ground_station_that_asks_much_leaves_room_for_commands(post: tuple[OperatorRelay, Air]) -> None:
    relay, air = post
    for uav in range(1, 46):
        relay.on_operator(by_ground_station(common.MAVLink_param_request_list_message(uav, 1)), 0)
    asked = len(air.said)
    assert asked < MOST_PER_S
    assert asked == MOST_PER_S - 10
    for uav in range(1, 6):
        relay.on_operator(by_ground_station(arm(uav)), 0)
    assert air.said[asked:] == ["COMMAND_LONG"] * 5
    relay.on_operator(by_ground_station(common.MAVLink_param_request_list_message(45, 1)), S)
    assert air.said[asked + 5 :] == ["PARAM_REQUEST_LIST"], "what was not sent is not under way"
    for uav in range(1, 46):
        relay.on_operator(by_ground_station(arm(uav)), S)
    assert len(air.said) == asked + 5 + MOST_PER_S, "commands have a limit, too"


def test_the_post_listens_for_all_that_a_uav_may_say_first() -> None:
    streams = TelemetryStreams(NodeId(1), position=STILL, telemetry_hz=0)
    streams.finds[1] = STILL
    named = [int(message_id) for message_id in common.mavlink_map if streams.one(message_id, 0, over_air=True)]
    assert len(named) > 12
    assert set(named) <= ANSWERS

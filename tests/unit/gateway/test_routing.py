"""What passes a gateway and what does not: whole, known, unforged frames for a UAV of the link."""

import math
import random
from itertools import pairwise

import pytest
from kit import slow

from fanet_mw.flavors import Flavor, Mode, number_of
from fanet_mw.gateway.framing import with_crc
from fanet_mw.gateway.routing import Link
from fanet_mw.gateway.signing import Signing
from fanet_mw.mavlink import Encoder, common, decode
from fanet_mw.rng import stream
from fanet_mw.units import Enu, NodeId

NODES = (NodeId(1), NodeId(2), NodeId(3))
UNIX_NS = 1_800_000_000 * 10**9
AHEAD = 300 * 100_000
"""Five minutes in the units of a signature."""


def link(*, flavor: Flavor = Flavor.PX4, signing: Signing | None = None) -> Link:
    return Link("test", NODES, flavor=flavor, signing=signing)


def said(message: object, *, system: int = 255, component: int = 190, seq: int = 0) -> bytes:
    mav = common.MAVLink(None, srcSystem=system, srcComponent=component)
    mav.seq = seq
    return bytes(message.pack(mav))  # type: ignore[attr-defined]


def arm(target: int) -> object:
    return common.MAVLink_command_long_message(target, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def into(of: Link, data: bytes, *, now_s: float = 1.0, whole: bool = True) -> dict[int, list[str]]:
    """Who gets which messages."""
    to, _ = of.into("peer", data, now_s, whole=whole)
    return {node: [message.get_type() for message in decode(frames)] for node, frames in to}


def test_a_command_goes_to_its_uav_and_a_heartbeat_to_all() -> None:
    door = link()
    assert into(door, said(arm(2))) == {2: ["COMMAND_LONG"]}
    assert into(door, said(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))) == {n: ["HEARTBEAT"] for n in NODES}
    assert into(door, said(arm(0))) == {n: ["COMMAND_LONG"] for n in NODES}
    assert into(door, said(arm(3)) + said(arm(2)) + said(arm(3))) == {3: ["COMMAND_LONG"] * 2, 2: ["COMMAND_LONG"]}


@pytest.mark.parametrize(
    ("data", "reason", "count"),
    [
        (said(arm(4)), "for_nobody_here", 1),
        (said(arm(2), system=3), "in_the_name_of_a_uav", 1),
        (said(arm(2))[:-1] + b"\x00", "bad_crc", 1),
        (b"GET / HTTP/1.1\r\n\r\n", "stray_bytes", 18),
        (said(arm(2))[:-3], "stray_bytes", len(said(arm(2))) - 3),
        (b"\xfd\x00\x02\x00\x00\xff\xbe\x00\x00\x00\x00\x00", "incompatible", 1),
        (b"\xfd\x01\x00\x00\x00\xff\xbe\xff\xff\x7f\x00\x00\x00", "unknown_message", 1),
    ],
)
def test_what_does_not_pass_is_counted_by_its_reason(data: bytes, reason: str, count: int) -> None:
    door = link()
    assert into(door, data) == {}
    assert door.counts[reason] == count


def test_on_the_link_of_one_uav_nobody_speaks_in_the_name_of_another() -> None:
    door = Link("test", NODES[:1], flavor=Flavor.PX4, signing=None, swarm=NODES)
    assert into(door, said(arm(1), system=2)) == {}
    assert door.counts["in_the_name_of_a_uav"] == 1
    assert into(door, said(arm(1), system=9)) == {1: ["COMMAND_LONG"]}


def test_a_message_with_a_field_that_is_newer_than_this_dialect_passes() -> None:
    count = said(common.MAVLink_mission_count_message(2, 1, 3, 0))
    payload = count[10:-2] + bytes(8) + b"\x07"
    door = link()
    newer = with_crc(bytes((count[0], len(payload))) + count[2:10] + payload, 221)  # CRC_EXTRA of MISSION_COUNT
    assert into(door, newer) == {2: ["MISSION_COUNT"]}
    assert not door.counts["bad_crc"]


def test_a_stream_may_be_cut_anywhere() -> None:
    data = b"noise" + said(arm(1)) + b"\xfd" + said(arm(2)) + said(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    for size in (1, 2, 7, 100):
        door = link()
        got: dict[int, list[str]] = {}
        for at in range(0, len(data), size):
            for node, kinds in into(door, data[at : at + size], whole=False).items():
                got.setdefault(node, []).extend(kinds)
        assert got == {1: ["COMMAND_LONG", "HEARTBEAT"], 2: ["COMMAND_LONG", "HEARTBEAT"], 3: ["HEARTBEAT"]}


def test_mavlink_1_is_understood() -> None:
    from pymavlink.dialects.v10 import common as old

    mav = old.MAVLink(None, srcSystem=255, srcComponent=190)
    data = bytes(old.MAVLink_command_long_message(2, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(mav))
    assert data[0] == 0xFE
    assert into(link(), data) == {2: ["COMMAND_LONG"]}


def test_a_flood_is_cut_to_what_a_link_may_send() -> None:
    door = link()
    ping = said(arm(1))
    passed = sum(len(kinds) for _ in range(100) for kinds in into(door, ping * 100).values())
    assert passed == 4000
    assert door.counts["too_many"] == 6000
    assert into(door, ping, now_s=1.1) == {1: ["COMMAND_LONG"]}


def telemetry(encoder: Encoder) -> bytes:
    place = Enu(0.0, 0.0, 10.0)
    return encoder.vehicle_heartbeat(Mode.HOLD, armed=True) + encoder.global_position(place, place, yaw=0.1, now_ns=5)


def test_only_flight_controllers_of_its_uavs_are_seen_on_a_link() -> None:
    door = Link("test", (NodeId(2),), flavor=Flavor.PX4, signing=None)
    two, companion = Encoder(NodeId(2), component=1), Encoder(NodeId(2))
    assert door.out(NodeId(1), telemetry(Encoder(NodeId(1), component=1))) == b""
    shown = door.out(NodeId(2), companion.heartbeat() + telemetry(two) + Encoder(NodeId(3), component=1).heartbeat())
    assert [(m.get_srcSystem(), m.get_type()) for m in decode(shown)] == [(2, "HEARTBEAT"), (2, "GLOBAL_POSITION_INT")]


# --- signing ------------------------------------------------------------------------------------------------------


def test_with_a_key_only_what_pymavlink_signs_by_it_passes_once() -> None:
    key = bytes(range(32))
    door = link(signing=Signing(key, unix_ns=UNIX_NS))
    assert into(door, said(arm(1))) == {}
    assert door.counts["unsigned"] == 1
    frames = [signed(arm(1), key, stamp) for stamp in (0, 1)]
    assert into(door, frames[0]) == {1: ["COMMAND_LONG"]}
    assert into(door, frames[0]) == {}
    assert door.counts["replayed"] == 1
    forged = frames[1][:-1] + bytes((frames[1][-1] ^ 1,))
    assert into(door, forged) == {}
    assert door.counts["bad_signature"] == 1
    assert into(door, frames[1]) == {1: ["COMMAND_LONG"]}, "the forged frame must not lock the true one out"
    assert into(door, signed(arm(1), b"x" * 32, 9)) == {}


def signed(message: object, key: bytes, later: int) -> bytes:
    mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
    mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.link_id = key, True, 3
    mav.signing.timestamp = (UNIX_NS // 10**9 - 1_420_070_400) * 100_000 + later
    return bytes(message.pack(mav))  # type: ignore[attr-defined]


def test_pymavlink_believes_our_signatures() -> None:
    key = bytes(range(32))
    door = link(signing=Signing(key, unix_ns=UNIX_NS))
    reader = common.MAVLink(None, srcSystem=255)
    reader.signing.secret_key = key
    reader.signing.timestamp = (UNIX_NS // 10**9 - 1_420_070_400) * 100_000
    encoder = Encoder(NodeId(1), component=1)
    for _ in range(5):
        messages = reader.parse_buffer(door.out(NodeId(1), telemetry(encoder)))
        assert [message.get_type() for message in messages] == ["HEARTBEAT", "GLOBAL_POSITION_INT"]
        assert all(message.get_signed() for message in messages)


def test_a_ground_station_whose_clock_is_ahead_believes_us_once_it_was_heard() -> None:
    key = bytes(range(32))
    door = link(signing=Signing(key, unix_ns=UNIX_NS))
    reader = common.MAVLink(None, srcSystem=255)
    reader.signing.secret_key = key
    reader.signing.timestamp = (UNIX_NS // 10**9 - 1_420_070_400) * 100_000 + AHEAD
    encoder = Encoder(NodeId(1), component=1)

    def believed() -> int:
        reader.robust_parsing = True
        return sum(m.get_type() != "BAD_DATA" for m in reader.parse_buffer(door.out(NodeId(1), telemetry(encoder))))

    assert not believed()
    assert into(door, signed(arm(1), key, AHEAD)) == {1: ["COMMAND_LONG"]}
    assert believed() == 2
    assert into(door, signed(arm(1), b"x" * 32, 9 * AHEAD)) == {}
    assert believed() == 2, "a forged stamp leads nobody"


# --- flavors ------------------------------------------------------------------------------------------------------


def test_ardupilots_ground_stations_see_its_modes_and_set_them() -> None:
    door = link(flavor=Flavor.ARDUPILOT)
    heartbeat, _ = decode(door.out(NodeId(1), telemetry(Encoder(NodeId(1), component=1))))
    assert (heartbeat.autopilot, heartbeat.custom_mode) == (common.MAV_AUTOPILOT_ARDUPILOTMEGA, 5)
    for number, mode in ((4, Mode.GUIDED), (3, Mode.MISSION), (6, Mode.RETURN), (9, Mode.LAND), (5, Mode.HOLD)):
        (to,), _ = door.into("peer", said(common.MAVLink_set_mode_message(1, 1, number)), 1.0, whole=True)
        assert decode(to.data)[0].custom_mode == number_of(mode)
        (to,), _ = door.into(
            "peer", said(common.MAVLink_command_long_message(1, 1, 176, 0, 1, number, 0, 0, 0, 0, 0)), 1.0, whole=True
        )
        command = decode(to.data)[0]
        assert int(command.param2) << 16 | int(command.param3) << 24 == number_of(mode)
    (to,), _ = door.into("peer", said(common.MAVLink_set_mode_message(1, 1, 0)), 1.0, whole=True)
    assert decode(to.data)[0].custom_mode not in {number_of(mode) for mode in Mode}  # STABILIZE


def test_ardupilots_take_off_counts_from_home() -> None:
    door = link(flavor=Flavor.ARDUPILOT)
    (to,), _ = door.into(
        "peer", said(common.MAVLink_command_long_message(1, 1, 22, 0, 0, 0, 0, 0, 0, 0, 12)), 1.0, whole=True
    )
    (command,) = decode(to.data)
    assert (command.get_type(), command.frame, command.z) == ("COMMAND_INT", common.MAV_FRAME_GLOBAL_RELATIVE_ALT, 12.0)


def test_ardupilots_missions_begin_with_home_which_the_vehicle_never_has() -> None:
    door, encoder = link(flavor=Flavor.ARDUPILOT), Encoder(NodeId(1), component=1)
    numbers = []

    def out(frame: bytes) -> object:
        (message,) = decode(door.out(NodeId(1), frame))
        numbers.append(message.get_seq())
        return message

    out(encoder.home_position(Enu(0.0, 0.0, 3.0)))
    (to,), _ = door.into("peer", said(common.MAVLink_mission_count_message(1, 1, 3)), 1.0, whole=True)
    assert decode(to.data)[0].count == 2
    assert out(encoder.pack(common.MAVLink_mission_request_int_message(255, 190, 0))).seq == 1  # type: ignore[attr-defined]
    item = common.MAVLink_mission_item_int_message(1, 1, 1, 6, 16, 0, 1, 0, 0, 0, 0, 5, 6, 7)
    (to,), _ = door.into("peer", said(item), 1.0, whole=True)
    assert decode(to.data)[0].seq == 0
    assert out(encoder.pack(common.MAVLink_mission_count_message(255, 190, 2))).count == 3  # type: ignore[attr-defined]
    to_vehicle, answer = door.into("peer", said(common.MAVLink_mission_request_int_message(1, 1, 0)), 1.0, whole=True)
    (home,) = decode(answer)
    assert not to_vehicle
    assert (home.get_srcSystem(), home.seq, home.z) == (1, 0, 3.0)
    numbers.append(home.get_seq())
    out(encoder.vehicle_heartbeat(Mode.HOLD, armed=True))
    assert {(later - number) % 256 for number, later in pairwise(numbers)} == {1}


def test_a_jump_of_ardupilots_mission_leads_to_the_same_item_on_both_sides_of_the_gateway() -> None:
    door, encoder = link(flavor=Flavor.ARDUPILOT), Encoder(NodeId(1), component=1)
    for makes in (common.MAVLink_mission_item_int_message, common.MAVLink_mission_item_message):
        for target, on_the_vehicle in ((2.0, 1.0), (1.0, 0.0), (0.0, 0.0), (math.nan, math.nan)):
            jump = makes(1, 1, 3, 2, common.MAV_CMD_DO_JUMP, 0, 1, target, 5, 0, 0, 0, 0, 0)
            (to,), _ = door.into("peer", said(jump), 1.0, whole=True)
            (item,) = decode(to.data)
            assert (item.seq, item.param1) == (2, pytest.approx(on_the_vehicle, nan_ok=True))
            (shown,) = decode(door.out(NodeId(1), encoder.pack(item)))
            assert (shown.seq, shown.param1) == (3, pytest.approx(max(target, 1.0), nan_ok=True))
        waypoint = makes(1, 1, 3, 6, common.MAV_CMD_NAV_WAYPOINT, 0, 1, 2.0, 0, 0, 0, 5, 6, 7)
        (to,), _ = door.into("peer", said(waypoint), 1.0, whole=True)
        assert decode(to.data)[0].param1 == 2.0, "the time that it waits"


def test_ardupilots_mission_begins_anew_at_home_as_at_its_first_item() -> None:
    door = link(flavor=Flavor.ARDUPILOT)
    for asked, on_the_vehicle in ((0, 0), (1, 0), (3, 2), (-1, -1)):  # -1: no item, only a reset
        command = common.MAVLink_command_long_message(1, 1, 224, 0, asked, 0, 0, 0, 0, 0, 0)
        (to,), _ = door.into("peer", said(command), 1.0, whole=True)
        assert decode(to.data)[0].param1 == on_the_vehicle


def test_a_number_that_has_no_successor_stays_what_it_is() -> None:
    door, encoder = link(flavor=Flavor.ARDUPILOT), Encoder(NodeId(1), component=1)
    for message in (
        common.MAVLink_mission_item_reached_message(0xFFFF), common.MAVLink_mission_count_message(255, 190, 0xFFFF),
        common.MAVLink_mission_current_message(0xFFFF, 3), common.MAVLink_mission_request_int_message(255, 190, 0xFFFF),
    ):  # fmt: skip
        (shown,) = decode(door.out(NodeId(1), encoder.pack(message)))
        assert 0xFFFF in (getattr(shown, "seq", 0), getattr(shown, "count", 0))


# --- fuzz ---------------------------------------------------------------------------------------------------------


def mangled(random_: random.Random) -> bytes:
    """A frame that was changed, cut, doubled, or is noise."""
    frame = bytearray(said(arm(random_.randrange(5)), system=random_.choice([1, 200, 255]), seq=random_.randrange(256)))
    for _ in range(random_.choice([0, 1, 1, 3])):
        frame[random_.randrange(len(frame))] = random_.randrange(256)
    choice = random_.random()
    if choice < 0.1:
        return random_.randbytes(random_.randrange(1, 60))
    return bytes(frame[: random_.randrange(1, len(frame))] if choice < 0.2 else frame * 2 if choice < 0.25 else frame)


@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(900)])])
@pytest.mark.parametrize("flavor", [Flavor.ARDUPILOT, *slow(Flavor.PX4)])
def test_hostile_frames_pass_only_when_they_are_whole(count: int, flavor: Flavor) -> None:
    random_, door = stream(1, "mangled"), link(flavor=flavor)
    frames = 0
    for step in range(count):
        to, _ = door.into(step % 5, mangled(random_), step / 100, whole=bool(step % 3))
        for _, data in to:
            for message in decode(data):
                frames += 1
                assert message.get_type() != "BAD_DATA"
    assert 0.1 * count < frames < 3 * count
    assert {"bad_crc", "stray_bytes", "for_nobody_here", "in_the_name_of_a_uav"} <= {*door.counts}
    assert door.counts["in"] > 0

"""The gateway's way over the air: what ground stations say goes from the post to UAVs, and their answers come back.

    ground station -> gateway -> the post (this application) -> the air -> a UAV's `GroundControl`
    its answers and telemetry -> the air -> the post -> its tap -> gateway -> ground stations

Commands have the priority of safety, plans and parameters that of reports, and telemetry that of bulk. Heartbeats of
ground stations are told to all, and no more often than UAVs need them; what no UAV understands stays on the ground.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

from agents.ground_control.application import OVER_AIR
from fanet_mw.application import Application, Received
from fanet_mw.errors import MalformedFrameError
from fanet_mw.gateway.framing import frame_of, layout
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, common
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire import PRIORITY_REPORT, PRIORITY_SAFETY, frames, system_id

PRESENCE_NS: Final = 2 * S
"""How often UAVs are told that an operator is there."""
_MOST_PRESENT: Final = 8
"""Ground stations whose heartbeats are told in this time."""
MOST_PER_S: Final = 40
"""Packets that operators may put on the air in a second; what is more must be said again."""
_MOST: Final = {PRIORITY_SAFETY: MOST_PER_S, PRIORITY_REPORT: MOST_PER_S - 10}
"""The same by priority: some are left for commands, however much a ground station asks."""
_UNDER_WAY_NS: Final = 1_200 * MS
_MOST_ASKED: Final = 500
_LONGEST: Final = 900
"""Inner bytes of a packet; more frames for one UAV go in another."""
_PASSED: Final = OVER_AIR - {common.MAVLINK_MSG_ID_SYSTEM_TIME}
"""What UAVs act on or answer, and what no joystick, camera or base of GPS corrections says."""
_TIMED: Final = frozenset({common.MAVLINK_MSG_ID_PING, common.MAVLINK_MSG_ID_TIMESYNC})
"""Questions of how late it is: some ask all vehicles ten times a second, and each would answer each time."""
URGENT: Final = frozenset({
    common.MAVLINK_MSG_ID_COMMAND_LONG, common.MAVLINK_MSG_ID_COMMAND_INT, common.MAVLINK_MSG_ID_SET_MODE,
    common.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, common.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
})  # fmt: skip
ANSWERS: Final = frozenset({
    common.MAVLINK_MSG_ID_COMMAND_ACK, common.MAVLINK_MSG_ID_HEARTBEAT, common.MAVLINK_MSG_ID_STATUSTEXT,
    common.MAVLINK_MSG_ID_PARAM_VALUE, common.MAVLINK_MSG_ID_PARAM_ERROR, common.MAVLINK_MSG_ID_MISSION_ACK,
    common.MAVLINK_MSG_ID_MISSION_COUNT, common.MAVLINK_MSG_ID_MISSION_ITEM_INT, common.MAVLINK_MSG_ID_MISSION_ITEM,
    common.MAVLINK_MSG_ID_MISSION_REQUEST_INT, common.MAVLINK_MSG_ID_MISSION_CURRENT,
    common.MAVLINK_MSG_ID_MISSION_ITEM_REACHED, common.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
    common.MAVLINK_MSG_ID_PING, common.MAVLINK_MSG_ID_TIMESYNC, common.MAVLINK_MSG_ID_LOG_ENTRY,
    common.MAVLINK_MSG_ID_MESSAGE_INTERVAL, common.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    common.MAVLINK_MSG_ID_HOME_POSITION, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    common.MAVLINK_MSG_ID_SYS_STATUS, common.MAVLINK_MSG_ID_GPS_RAW_INT, common.MAVLINK_MSG_ID_ATTITUDE,
    common.MAVLINK_MSG_ID_LOCAL_POSITION_NED, common.MAVLINK_MSG_ID_VFR_HUD, common.MAVLINK_MSG_ID_RADIO_STATUS,
    common.MAVLINK_MSG_ID_BATTERY_STATUS, common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    common.MAVLINK_MSG_ID_SYSTEM_TIME, common.MAVLINK_MSG_ID_ADSB_VEHICLE,
})  # fmt: skip
"""The messages with which a packet of a UAV to the post may begin."""


class OperatorRelay(Application):
    """What passes between ground stations and the air at the post."""

    name: Final = "operator"
    listens = ANSWERS

    def __init__(self, scenario: Scenario) -> None:
        self._nodes = {system_id(node): NodeId(node) for node in scenario.uav_ids}
        self._told_ns: dict[int, int] = {}
        """When the heartbeat of each ground station was told, by its system; for `PRESENCE_NS`."""
        self._asked: dict[bytes, int] = {}
        """When each question was put on the air last, the newest at the end."""
        self._second, self._in_second = -1, 0
        self._counts: Counter[str] = Counter()

    def on_operator(self, frames_: bytes, now_ns: int) -> None:
        """What ground stations say, from the gateway: once for each UAV that it is for."""
        said: dict[tuple[int, int], bytes] = {}
        for data in frames(frames_):
            shape = layout(int.from_bytes(data[7:10], "little"))
            if shape is None:
                self._counts["not_understood"] += 1
                continue
            frame = frame_of(data, shape)
            if frame.message_id == common.MAVLINK_MSG_ID_HEARTBEAT:
                self._presence(data, frame.system, now_ns)
                continue
            if frame.message_id not in _PASSED or (frame.message_id in _TIMED and not frame.target):
                self._counts["not_over_air"] += 1
                continue
            to = self._nodes.get(frame.target) if frame.target else BROADCAST
            if to is None:
                self._counts["for_nobody_here"] += 1
                continue
            if frame.message_id not in URGENT and self._is_under_way(data, now_ns):
                self._counts["under_way"] += 1
                continue
            priority = PRIORITY_SAFETY if frame.message_id in URGENT else PRIORITY_REPORT
            waiting = said.get((to, priority), b"")
            if waiting and len(waiting) + len(data) > _LONGEST:
                self._send(waiting, to, priority, now_ns, most=_MOST[priority])
                waiting = b""
            said[to, priority] = waiting + data
        for (target, priority), together in said.items():
            self._send(together, target, priority, now_ns, most=_MOST[priority])

    def _is_under_way(self, data: bytes, now_ns: int) -> bool:
        """True if the same was asked lately: ground stations ask again before an answer over several hops can come, and
        some take the second one for that to their next question.
        """
        asked = _question(data)
        last_ns = self._asked.get(asked)
        if last_ns is not None and now_ns - last_ns < _UNDER_WAY_NS:
            return True
        self._asked.pop(asked, None)
        self._asked[asked] = now_ns
        if len(self._asked) > _MOST_ASKED:
            self._asked.pop(next(iter(self._asked)))
        return False

    def _presence(self, data: bytes, system: int, now_ns: int) -> None:
        self._told_ns = {of: told_ns for of, told_ns in self._told_ns.items() if now_ns - told_ns < PRESENCE_NS}
        if system not in self._told_ns and len(self._told_ns) < _MOST_PRESENT:
            self._told_ns[system] = now_ns
            self._send(data, BROADCAST, PRIORITY_REPORT, now_ns, most=MOST_PER_S)

    def _send(self, together: bytes, to: int, priority: int, now_ns: int, *, most: int) -> None:
        if now_ns // S != self._second:
            self._second, self._in_second = now_ns // S, 0
        if self._in_second >= most:
            self._counts["too_many"] += 1
            for data in frames(together):
                self._asked.pop(_question(data), None)
            return
        self._in_second += 1
        self._counts["sent"] += 1
        self.port.send(together, destination=to, priority=priority)

    def on_message(self, message: Received, now_ns: int) -> None:
        node = self._nodes.get(system_id(message.origin))
        passed = []
        for frame in frames(message.data):
            if frame[5] != system_id(message.origin):
                raise MalformedFrameError(f"frame of system {frame[5]} by node {message.origin}")
            if frame[6] == AUTOPILOT_COMPONENT:  # companions tell each other positions in the same messages
                passed.append(frame)
        if node is not None and passed:
            self._counts["heard"] += len(passed)
            self.port.tap(b"".join(passed))

    def report(self) -> Mapping[str, Any]:
        return {f"operator_{name}": count for name, count in sorted(self._counts.items())}


def _question(data: bytes) -> bytes:
    """What a frame asks, and who does: all but its number and its CRC, and no time of a question of time."""
    message_id = int.from_bytes(data[7:10], "little")
    shape = layout(message_id) if message_id in _TIMED else None
    return data[5:-2] if shape is None else data[5:10] + bytes((frame_of(data, shape).target,))

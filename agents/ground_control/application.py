"""The application by which a ground station sees and commands one UAV: it answers as a flight controller does.

    MAVLink of a ground station -> commands, parameters, plans -> the pilot -> courses, by the arbitration on board
    answers, texts, telemetry   -> the tap, or over the air to the post on the ground: where the question came from

It does nothing until a ground station is heard.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, Final

from agents.applications.telemetry_streams import Flown, Link, TelemetryStreams
from agents.ground_control import settings as names
from agents.ground_control.commands import Commands, is_question
from agents.ground_control.pilot import Pilot
from agents.ground_control.plan_transfer import Peer, PlanTransfer
from agents.ground_control.plans import Ground, Item, Kind, fence_of, rally_of, step_of
from agents.ground_control.settings import LONGEST_NAME, Settings, settings_of
from agents.ground_control.telemetry_pace import pace_of
from fanet_mw.application import Application, Course, Fate, Received, Status
from fanet_mw.bus.messages import Battery, Gps, SensorReading
from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, GATEWAY_COMPONENT, Geodetic, Ned, common, decode, from_ned
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, PlacedAmong, PlacedInside, Record, Refuted, Warned
from fanet_mw.units import MS, Enu, NodeId, S, earliest, seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_REPORT, frames, system_id
from fanet_mw.wire.survivors import called

_MOST_PER_S: Final = 200
"""A UAV looks at no more messages of operators in a second; a ground station that floods must not take its time."""
_LOOK_NS: Final = 500 * MS
"""How often the silence of an operator is looked for."""
_LOW: Final = 0.2
"""Below this share of its charge a battery is low."""
_LINK_LASTS_NS: Final = 4 * S
_ALL_COMPONENTS: Final = 0
_TEXT_BYTES: Final = 50
_NOTICE: Final = common.MAV_SEVERITY_NOTICE
_LONGEST: Final = 900
"""Inner bytes of a packet over the air."""
_SLOWEST_NS: Final = 60 * S
"""Refusals alone make telemetry no rarer than this."""
_TRIES_NS: Final = 120 * S
"""After so long without a refusal telemetry is sent twice as often, down to the interval that leaves the air room."""
_WATCHED_NS: Final = 10 * S
"""Telemetry over the air ends when the gateway has not been heard for so long."""
OVER_AIR: Final = frozenset({
    common.MAVLINK_MSG_ID_HEARTBEAT, common.MAVLINK_MSG_ID_SYSTEM_TIME, common.MAVLINK_MSG_ID_COMMAND_LONG,
    common.MAVLINK_MSG_ID_COMMAND_INT, common.MAVLINK_MSG_ID_SET_MODE, common.MAVLINK_MSG_ID_MISSION_SET_CURRENT,
    common.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, common.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
    common.MAVLINK_MSG_ID_REQUEST_DATA_STREAM, common.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
    common.MAVLINK_MSG_ID_PARAM_REQUEST_READ, common.MAVLINK_MSG_ID_PARAM_SET,
    common.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, common.MAVLINK_MSG_ID_PING, common.MAVLINK_MSG_ID_TIMESYNC,
    common.MAVLINK_MSG_ID_LOG_REQUEST_LIST, common.MAVLINK_MSG_ID_MISSION_COUNT,
    common.MAVLINK_MSG_ID_MISSION_ITEM_INT, common.MAVLINK_MSG_ID_MISSION_ITEM,
    common.MAVLINK_MSG_ID_MISSION_REQUEST_LIST, common.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    common.MAVLINK_MSG_ID_MISSION_REQUEST, common.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
    common.MAVLINK_MSG_ID_MISSION_ACK, common.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
    common.MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST,
})  # fmt: skip
"""The messages with which a packet of the post for a UAV may begin."""
_TYPE_MISMATCH: Final = 7  # MAV_PARAM_ERROR_TYPE_MISMATCH of common.xml, which pymavlink 2.4.50 does not have yet
_FTP_ACK, _FTP_NAK = 128, 129
_FTP_SESSIONS: Final = (1, 2)
"""TerminateSession and ResetSessions, which a vehicle without files carries out at once."""
_FTP_NO_FILE, _FTP_UNKNOWN = 10, 7
_FTP_OPENS: Final = (3, 4, 5, 14, 15)
"""ListDirectory, the ways to open or read, and the checksum: of files, of which there are none."""
_POSITION_IGNORED: Final = 0b111
_VELOCITY_IGNORED: Final = 0b111000


_WEIGHT: Final = 0.1
_STILL_M_S: Final = 0.4
"""What climbs or sinks faster than that does not stand; the noise of GPS velocities is a tenth of it."""
_FIXES: Final = 10
"""A UAV that is in the air from the start is compared with its start for so many fixes."""
_SIGMAS: Final = 6.0
_LEAST_M: Final = 5.0
"""Of a UAV that is farther from its start than this, and than so many standard deviations of GPS, no error is learned:
its computer has started again, or it stands elsewhere.
"""


class HeightReference:
    """GPS's error in height, learned where the UAV starts: the height is known there, and the error lasts."""

    def __init__(self, start: Enu, *, sigma_m: float, sigma_up_m: float) -> None:
        self._start = start
        self._most_m, self._most_up_m = max(_LEAST_M, _SIGMAS * sigma_m), max(_LEAST_M, _SIGMAS * sigma_up_m)
        self._off_m = 0.0
        self._count = 0
        self._has_flown = False
        self.begins_elsewhere = False
        """True at a first fix on the ground and far from the start: the UAV was put elsewhere."""
        self.begins_in_flight = False
        """True at a first fix in the air and far from the start: the computer has started again in flight."""

    def off_m(self, fix: Gps, *, stands: bool) -> float:
        """The error, after another fix; `stands`: the UAV is not known to have taken off."""
        apart = fix.position.minus(self._start)
        moves = abs(fix.velocity.up) > _STILL_M_S
        high, away = abs(apart.up) > self._most_up_m, apart.horizontal() > self._most_m
        flies = high or (away and apart.up > _LEAST_M)
        first = not self._count and not self._has_flown
        self.begins_in_flight, self.begins_elsewhere = first and flies, first and away and not flies
        self._has_flown |= moves or high or away or (not stands and self._count >= _FIXES)
        if not self._has_flown:
            self._count += 1
            self._off_m += max(_WEIGHT, 1 / self._count) * (apart.up - self._off_m)
        return self._off_m


class GroundControl(Application):
    """The side of one UAV that a ground station sees."""

    name: Final = "operator"
    follows = (Fate.REFUSED,)

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        streams: TelemetryStreams,
        *,
        position: Enu,
        on_mission_key: Callable[[str, float], None] = lambda _key, _value: None,
    ) -> None:
        """`on_mission_key`: takes a key of `[mission]` and its new value, when an operator changes one."""
        self._on_mission_key = on_mission_key
        self._node, self._streams = node, streams
        self._post = scenario.post
        self.listens = OVER_AIR if scenario.post is not None else ()
        self._least_pace_ns = self._pace_ns = pace_of(scenario).interval_ns
        self._slowed_ns = 0
        """The instant at which telemetry was last refused, or made faster since."""
        self._deadline_ns = scenario.routing.lifetime_ns(PRIORITY_BULK)
        self._over_air = False
        """True if the last question of an operator came over the air."""
        self._report_ns: int | None = None
        self._turn = 0
        self._count = scenario.nodes.count
        origin = Geodetic(*scenario.world.origin_deg, 0.0)
        on_ground = scenario.nodes.on_ground
        home = position if on_ground else position._replace(up=0.0)
        half_m = scenario.world.area_m / 2
        self._settings = settings = Settings(settings_of(scenario, node))
        mission, model = scenario.mission, scenario.mobility.model
        self._pilot = pilot = Pilot(
            home=home,
            on_ground=on_ground,
            has_task=mission.search != "none" or mission.formation != "none" or model not in ("static", "onboard"),
            area_m=Enu(max(half_m, abs(position.east)), max(half_m, abs(position.north)), 0.0),
            settings=settings,
            say=self._say,
        )
        pilot.position = position
        pilot.mission.on_reached = self._on_reached
        self._ground = Ground(origin, home.up)
        sensors = scenario.sensors
        sigma_m = math.hypot(sensors.gps_common_m, sensors.gps_bias_m, scenario.world.gps_sigma_m)
        self._height = HeightReference(position, sigma_m=sigma_m, sigma_up_m=sensors.gps_vertical * sigma_m)
        self._transfer = PlanTransfer(self._reply, check=self._check, accept=self._accept)
        self._commands = Commands(
            pilot, streams, lambda: self._ground, reply=self._reply, send=self._send, one=self._one,
        )  # fmt: skip
        self._out: list[bytes] = []
        self._heard_ns: int | None = None
        """The instant at which an operator was heard last; None: never yet, or lost."""
        self._watched_ns: int | None = None
        """The same for a gateway, which says that somebody may look and not that anybody commands; None: never."""
        self._look_ns: int | None = None
        self._second, self._in_second = -1, 0
        self._counts: Counter[str] = Counter()
        self._refusals: set[str] = set()
        """Why setpoints were not flown, as it was said."""
        self._low = False
        self._link = Link()
        self._link_ns = 0
        streams.flown = self._flown()

    # --- in -------------------------------------------------------------------------------------------------------

    def on_operator(self, frames_: bytes, now_ns: int) -> None:
        self._over_air = self._commands.paced = False
        self._take(frames_, now_ns)

    def on_message(self, message: Received, now_ns: int) -> None:
        """MAVLink frames of a ground station, over the air from the post."""
        if message.origin != self._post:
            self._counts["not_from_the_post"] += 1
            return
        self._over_air = self._commands.paced = True
        if self._report_ns is None:
            self._report_ns = now_ns + self._node * self._pace_ns // max(1, self._count)
        self._take(message.data, now_ns)

    def on_status(self, status: Status, now_ns: int) -> None:
        """The network cannot deliver telemetry so often now."""
        self._slowed_ns = now_ns
        if status.interval_ns is not None:
            self._pace_ns = max(self._pace_ns, status.interval_ns)
        else:
            self._pace_ns = max(self._pace_ns, min(_SLOWEST_NS, 2 * self._pace_ns))

    def _take(self, frames_: bytes, now_ns: int) -> None:
        if now_ns // S != self._second:
            self._second, self._in_second = now_ns // S, 0
        for frame in frames(frames_):
            self._in_second += 1
            if self._in_second > _MOST_PER_S:
                self._counts["flooded"] += 1
                continue
            try:
                (message,) = decode(frame)
            except MalformedFrameError:
                self._counts["malformed"] += 1
                continue
            self._on_message(message, now_ns)
        self._settle(now_ns)

    def _on_message(self, message: Any, now_ns: int) -> None:  # noqa: ANN401  (pymavlink has no types)
        peer = Peer(message.get_srcSystem(), message.get_srcComponent())
        if getattr(message, "target_system", 0) not in (0, system_id(self._node)):
            self._counts["not_for_this_node"] += 1
            return
        if self._watched_ns is None:
            self._streams.operator(now_ns)
        self._watched_ns = now_ns
        if peer.component != GATEWAY_COMPONENT:
            self._heard_ns = now_ns
        if self._look_ns is None:
            self._look_ns = now_ns + _LOOK_NS
        if getattr(message, "target_component", _ALL_COMPONENTS) not in (_ALL_COMPONENTS, AUTOPILOT_COMPONENT):
            self._counts["for_other_components"] += 1
            return
        if self._transfer.on_message(message, peer, now_ns):
            self._counts["understood"] += 1
            return
        handle = self._HANDLERS.get(message.get_type())
        self._counts["not_understood" if handle is None else "understood"] += 1
        if handle is not None:
            handle(self, message, peer, now_ns)

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        off_m = self._height.off_m(fix, stands=self._pilot.on_ground)
        if self._height.begins_in_flight:
            self._pilot.took_off()
        elif self._height.begins_elsewhere and self._pilot.on_ground:
            east, north, _ = fix.position
            self._pilot.home = self._pilot.home._replace(east=east, north=north)
        self._streams.height_off_m = off_m
        self._pilot.on_fix(fix.position._replace(up=fix.position.up - off_m), fix.velocity, now_ns)
        if self._watched_ns is not None or self._pilot.on_ground is not self._streams.flown.on_ground:
            self._settle(now_ns)  # as long as nobody looks, there is nothing to hand over

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, Battery):
            low = reading.charge < _LOW
            if low and not self._low:
                self._say(2, f"Low battery: {reading.charge:.0%}")
            self._low = low
            self._settle(now_ns)

    def on_record(self, record: Record, now_ns: int) -> None:
        """Something has happened on board that an operator must know."""
        text = None
        match record:
            case Confirmed(survivor=survivor, east_m=east_m, north_m=north_m):
                self._streams.finds[survivor] = Enu(east_m, north_m, 0.0)
                text = f"{_named(survivor)} confirmed"
            case PlacedInside(survivor=survivor, east_m=east_m, north_m=north_m):
                self._streams.finds[survivor] = Enu(east_m, north_m, 0.0)
                text = f"{_named(survivor)} is inside a building"
            case PlacedAmong(survivor=survivor, east_m=east_m, north_m=north_m):
                self._streams.finds[survivor] = Enu(east_m, north_m, 0.0)
                text = f"{_named(survivor)} is among people there"
            case Refuted(survivor=survivor):
                self._streams.finds.pop(survivor, None)
                text = f"{_named(survivor)} refuted"
            case Warned(other=other):
                text = f"Collision warning: UAV {other}"
            case _:
                return
        self._say(_NOTICE, text)
        self._settle(now_ns)

    def on_link(self, rssi_dbm: float, lost: int, now_ns: int) -> None:
        """A neighbor was heard; the strongest of the last seconds is told."""
        best = self._link.rssi_dbm
        if best is None or rssi_dbm >= best or now_ns - self._link_ns > S:
            self._link, self._link_ns = Link(rssi_dbm, lost), now_ns

    def permits(self, course: Course, now_ns: int) -> bool:
        return not self._pilot.commands

    def wake(self, now_ns: int) -> None:
        if self._look_ns is not None and now_ns >= self._look_ns:
            self._look_ns = now_ns + _LOOK_NS
            self._look(now_ns)
        self._transfer.wake(now_ns)
        if self._report_ns is not None and now_ns >= self._report_ns:
            self._report(now_ns)
        self._settle(now_ns)

    def _report(self, now_ns: int) -> None:
        """Send telemetry over the air: heartbeat and position always, and the other streams in turn."""
        watched = self._watched_ns is not None and now_ns - self._watched_ns < _WATCHED_NS
        if now_ns - self._slowed_ns >= _TRIES_NS:
            self._slowed_ns, self._pace_ns = now_ns, max(self._least_pace_ns, self._pace_ns // 2)
        self._report_ns = now_ns + self._pace_ns if watched else None
        post = self._post
        if post is None or self._report_ns is None:
            return
        self._refresh()
        rest = _IN_TURN[self._turn % len(_IN_TURN)]
        self._turn += 1
        told = [self._streams.one(message_id, now_ns, over_air=True) or b"" for message_id in (*_ALWAYS, *rest)]
        self._counts["reports"] += 1
        self.port.send(b"".join(told), destination=post, priority=PRIORITY_BULK, deadline_ns=self._deadline_ns)

    def _look(self, now_ns: int) -> None:
        if self._link.rssi_dbm is not None and now_ns - self._link_ns > _LINK_LASTS_NS:
            self._link = Link(None, self._link.lost)
            self._say(4, "Radio: no neighbor is heard")
        if self._heard_ns is not None and now_ns - self._heard_ns > seconds_to_ns(self._settings[names.SILENCE]):
            self._heard_ns = None
            self._counts["silences"] += 1
            self._pilot.silent()

    def next_wake_ns(self) -> int | None:
        return earliest(self._look_ns, self._transfer.next_due_ns(), self._report_ns)

    def report(self) -> Mapping[str, Any]:
        return {f"operator_{name}": count for name, count in sorted(self._counts.items())}

    # --- what ground stations ask ---------------------------------------------------------------------------------

    def _on_command(self, message: Any, peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        if not is_question(message.command):
            self._counts["commanded"] += 1
        self._counts["repeated"] += self._commands.on_command(message, peer, now_ns)

    def _on_set_mode(self, message: Any, peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        self._counts["commanded"] += 1
        result = self._commands.set_mode(message.custom_mode, now_ns)
        self._reply(common.MAVLink_command_ack_message(common.MAVLINK_MSG_ID_SET_MODE, result, 0, 0, *peer))

    def _on_set_current(self, message: Any, _peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        if 0 <= message.seq < len(self._pilot.mission.steps):
            self._pilot.mission.go_to(message.seq)
        self._refresh()
        self._send(self._one(common.MAVLINK_MSG_ID_MISSION_CURRENT, now_ns) or b"")

    def _on_local_setpoint(self, message: Any, _peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        given = from_ned(Ned(message.x, message.y, message.z))
        if message.coordinate_frame == common.MAV_FRAME_LOCAL_NED:
            self._on_setpoint(message, given, now_ns)
        elif message.coordinate_frame == common.MAV_FRAME_LOCAL_OFFSET_NED:
            self._on_setpoint(message, self._pilot.position.plus(given), now_ns)
        else:  # those of the body: vehicles of the world have no heading of their own
            self._refuse_setpoint(f"Setpoint in frame {message.coordinate_frame}: not flown")

    def _on_global_setpoint(self, message: Any, _peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        place = self._ground.place(message.coordinate_frame, message.lat_int, message.lon_int, message.alt)
        self._on_setpoint(message, place, now_ns)

    def _on_setpoint(self, message: Any, place: Enu | None, now_ns: int) -> None:  # noqa: ANN401
        self._counts["commanded"] += 1
        mask = message.type_mask
        velocity: Enu | None = None
        if mask & _POSITION_IGNORED:
            place = None
            if not mask & _VELOCITY_IGNORED and mask & _POSITION_IGNORED == _POSITION_IGNORED:
                velocity = from_ned(Ned(message.vx, message.vy, message.vz))
        known = place if velocity is None else velocity
        if known is None or not all(math.isfinite(part) for part in known):
            self._refuse_setpoint("Setpoint of no whole place or velocity: not flown")
        elif not self._pilot.setpoint(place, velocity, now_ns):
            self._counts["refused_setpoints"] += 1

    def _refuse_setpoint(self, why: str) -> None:
        """Setpoints have no answer in MAVLink, and come many times a second: say why one is not flown once."""
        self._counts["senseless_setpoints"] += 1
        if why not in self._refusals:
            self._refusals.add(why)
            self._say(4, why)

    def _on_data_stream(self, message: Any, _peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        if self._over_air:
            return  # telemetry has a pace of its own there
        rate = message.req_message_rate
        for message_id in _GROUPS.get(message.req_stream_id, ()):
            if not message.start_stop or not rate:
                self._streams.set_interval(message_id, -1, now_ns)
            else:
                self._streams.set_interval(message_id, S // max(1, min(50, rate)), now_ns)

    def _on_param_list(self, _message: Any, _peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        for at in range(len(self._settings.known)):
            self._say_param(at)

    def _on_param_read(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        at: int | None = message.param_index
        if message.param_index == -1:
            at = self._settings.index(message.param_id)
        if at is None or not 0 <= at < len(self._settings.known):
            self._say_param_error(message, peer, message.param_index, common.MAV_PARAM_ERROR_DOES_NOT_EXIST)
        else:
            self._say_param(at)

    def _on_param_set(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        at = self._settings.index(message.param_id)
        if at is None:
            self._say_param_error(message, peer, -1, common.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            return
        if message.param_type != common.MAV_PARAM_TYPE_REAL32:
            self._say_param_error(message, peer, at, _TYPE_MISMATCH)
        elif not self._settings.change(message.param_id, message.param_value):
            self._say_param_error(message, peer, at, common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
        elif key := self._settings.known[at].mission_key:
            self._on_mission_key(key, message.param_value)
        self._say_param(at)

    def _say_param(self, at: int) -> None:
        known = self._settings.known
        self._reply(
            common.MAVLink_param_value_message(
                known[at].name.encode(), self._settings[known[at].name], common.MAV_PARAM_TYPE_REAL32, len(known), at
            )
        )

    def _say_param_error(self, message: Any, peer: Peer, at: int, error: int) -> None:  # noqa: ANN401
        name = message.param_id.encode()[:LONGEST_NAME]
        self._reply(common.MAVLink_param_error_message(*peer, name, at, error))

    def _on_file(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        """MAVLink FTP: there are no files, and each request is told so."""
        asked = message.payload
        seq, opcode = (asked[0] | asked[1] << 8) + 1 & 0xFFFF, asked[3]
        answer = [0] * len(asked)
        answer[0], answer[1], answer[2], answer[5] = seq & 0xFF, seq >> 8, asked[2], opcode
        if opcode in _FTP_SESSIONS:
            answer[3] = _FTP_ACK
        else:
            answer[3], answer[4] = _FTP_NAK, 1
            answer[12] = _FTP_NO_FILE if opcode in _FTP_OPENS else _FTP_UNKNOWN
        self._reply(common.MAVLink_file_transfer_protocol_message(0, *peer, answer))

    def _on_ping(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        if not message.target_system:
            self._reply(common.MAVLink_ping_message(message.time_usec, message.seq, *peer))

    def _on_timesync(self, message: Any, _peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        if not message.tc1:
            self._reply(common.MAVLink_timesync_message(now_ns, message.ts1))

    def _on_logs(self, _message: Any, _peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        self._reply(common.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def _ignore(self, _message: Any, _peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        """A message that only says that an operator is there."""

    _HANDLERS: Final = {
        "HEARTBEAT": _ignore,
        "SYSTEM_TIME": _ignore,
        "COMMAND_LONG": _on_command,
        "COMMAND_INT": _on_command,
        "SET_MODE": _on_set_mode,
        "MISSION_SET_CURRENT": _on_set_current,
        "SET_POSITION_TARGET_LOCAL_NED": _on_local_setpoint,
        "SET_POSITION_TARGET_GLOBAL_INT": _on_global_setpoint,
        "REQUEST_DATA_STREAM": _on_data_stream,
        "PARAM_REQUEST_LIST": _on_param_list,
        "PARAM_REQUEST_READ": _on_param_read,
        "PARAM_SET": _on_param_set,
        "FILE_TRANSFER_PROTOCOL": _on_file,
        "PING": _on_ping,
        "TIMESYNC": _on_timesync,
        "LOG_REQUEST_LIST": _on_logs,
    }

    # --- plans ----------------------------------------------------------------------------------------------------

    def _check(self, kind: Kind, item: Item) -> None:
        if kind is Kind.MISSION:
            step_of(item, self._ground)

    def _accept(self, kind: Kind, items: list[Item]) -> None:
        pilot = self._pilot
        if kind is Kind.MISSION:
            steps = [step_of(item, self._ground) for item in items]
            for step in steps:
                pilot.require_flyable(step)
            flies = pilot.commands and not pilot.mission.idle
            pilot.mission.load(steps)
            if flies:
                pilot.hold()
        elif kind is Kind.FENCE:
            pilot.take_fence(fence_of(items, self._ground))
        else:
            pilot.rally = rally_of(items, self._ground)

    def _on_reached(self, at: int) -> None:
        self._reply(common.MAVLink_mission_item_reached_message(at))

    # --- out ------------------------------------------------------------------------------------------------------

    def _say(self, severity: int, text: str) -> None:
        """Tell operators something, once anybody listens."""
        if self._watched_ns is not None:
            self._reply(common.MAVLink_statustext_message(severity, text.encode()[:_TEXT_BYTES]))

    def _reply(self, message: Any) -> None:  # noqa: ANN401  (pymavlink has no types)
        encoder = self._streams.air_encoder if self._over_air else self._streams.encoder
        self._out.append(encoder.pack(message))

    def _send(self, frame: bytes) -> None:
        self._out.append(frame)

    def _one(self, message_id: int, now_ns: int) -> bytes | None:
        self._refresh()
        return self._streams.one(message_id, now_ns, over_air=self._over_air)

    def _settle(self, now_ns: int) -> None:
        course = self._pilot.take_course()
        if course is not None:
            self.port.fly(course)
        self._refresh()
        if not self._out:
            return
        out, self._out = self._out, []
        if not self._over_air or self._post is None:
            self.port.tap(b"".join(out))
            return
        packet = b""
        for frame in [*out, b""]:
            if packet and (not frame or len(packet) + len(frame) > _LONGEST):
                self.port.send(packet, destination=self._post, priority=PRIORITY_REPORT)
                packet = b""
            packet += frame

    def _refresh(self) -> None:
        self._streams.flown = self._flown()
        self._streams.link = self._link

    def _flown(self) -> Flown:
        pilot = self._pilot
        mission = pilot.mission
        return Flown(
            pilot.mode, pilot.armed, pilot.on_ground, critical=self._low, mission_at=mission.at,
            mission_items=len(mission.steps), mission_flies=not mission.idle, home=pilot.home,
            fenced=bool(pilot.fence), beyond=pilot.beyond,
        )  # fmt: skip


def _named(survivor: int) -> str:
    name = called(survivor)
    return name[0].upper() + name[1:]


_ALWAYS: Final = (common.MAVLINK_MSG_ID_HEARTBEAT, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
_IN_TURN: Final = (
    (common.MAVLINK_MSG_ID_SYS_STATUS, common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, common.MAVLINK_MSG_ID_GPS_RAW_INT,
     common.MAVLINK_MSG_ID_HOME_POSITION, common.MAVLINK_MSG_ID_MISSION_CURRENT, common.MAVLINK_MSG_ID_ADSB_VEHICLE),
    (common.MAVLINK_MSG_ID_ATTITUDE, common.MAVLINK_MSG_ID_LOCAL_POSITION_NED, common.MAVLINK_MSG_ID_VFR_HUD,
     common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, common.MAVLINK_MSG_ID_BATTERY_STATUS,
     common.MAVLINK_MSG_ID_RADIO_STATUS),
)  # fmt: skip
"""The messages of telemetry over the air: those of every packet, and those of every other."""
_POSITIONS: Final = (common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, common.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
_ATTITUDES: Final = (common.MAVLINK_MSG_ID_ATTITUDE,)
_STATES: Final = (
    common.MAVLINK_MSG_ID_SYS_STATUS, common.MAVLINK_MSG_ID_GPS_RAW_INT, common.MAVLINK_MSG_ID_MISSION_CURRENT,
)  # fmt: skip
_HUDS: Final = (common.MAVLINK_MSG_ID_VFR_HUD,)
_GROUPS: Final = {
    common.MAV_DATA_STREAM_ALL: (*_POSITIONS, *_ATTITUDES, *_STATES, *_HUDS),
    common.MAV_DATA_STREAM_EXTENDED_STATUS: _STATES,
    common.MAV_DATA_STREAM_POSITION: _POSITIONS,
    common.MAV_DATA_STREAM_EXTRA1: _ATTITUDES,
    common.MAV_DATA_STREAM_EXTRA2: _HUDS,
}
"""The messages of the groups of REQUEST_DATA_STREAM."""

"""What a person who looks can do to a running swarm; each action is one message on the bus, as of `fanet air`.

UAVs are sent by orders of the post on the ground, or where there is none by commands of MAVLink, as a ground station
gives them; a ground station is silent when the view ends, and UAVs do then what their parameters say.
"""

import math
import time
from collections.abc import Callable
from typing import Any, Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import PACE_BOUNDS, ClockRequest, MavlinkTap
from fanet_mw.bus.radio_control import Control, Cut, Degrade, Jam, Mishap, MishapKind, Restore, link_label, node_label
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, Geodetic, common, to_geodetic
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import STILL, Enu, NodeId
from fanet_mw.wire import system_id
from sim.observation.bus_feed import BusFeed

PAUSED: Final = PACE_BOUNDS[0]
_GROUND_STATION: Final = 254
_PRESENT_S: Final = 1.0


class Actions:
    """The actions on one swarm. They return at once; the trace shows what came of them."""

    def __init__(self, feed: BusFeed, *, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        self._feed, self._monotonic_s = feed, monotonic_s
        self.has_post = bool(feed.scenario.ground.at_m)
        """True if there is a post on the ground, which gives orders to UAVs over the air."""
        self._origin = Geodetic(*feed.scenario.world.origin_deg, 0.0)
        self._voice: Any = common.MAVLink(
            None, srcSystem=_GROUND_STATION, srcComponent=common.MAV_COMP_ID_MISSIONPLANNER
        )
        self._commanded: set[int] = set()
        self._present_s = 0.0

    def cut(self, node: int) -> str:
        return self._control(Cut(node_label(node), NodeId(node)), f"UAV {node}: radio off")

    def crash(self, node: int) -> str:
        return self._control(Mishap(node_label(node), NodeId(node), MishapKind.CRASH, STILL), f"UAV {node} crashes")

    def degrade(self, a: int, b: int, *, loss_share: float) -> str:
        """Let the link between two UAVs lose a share of its frames, both ways."""
        if a == b:
            return "a link has two different ends"
        what = "cut" if loss_share >= 1 else f"loses {loss_share:.0%}"
        return self._control(
            Degrade(link_label(a, b), NodeId(a), NodeId(b), both=True, loss_db=0.0, loss_share=loss_share),
            f"link {a} to {b} {what}",
        )

    def jam(self, label: str, east: float, north: float, radius: float) -> str:
        return self._control(
            Jam(label, Enu(east, north, 0.0), radius, math.inf), f"jammed {radius:.0f} m about {east:.0f}, {north:.0f}"
        )

    def restore(self) -> str:
        return self._control(Restore(""), "all faults end")

    def pace(self, time_scale: float) -> str:
        scale = min(max(time_scale, PACE_BOUNDS[0]), PACE_BOUNDS[1])
        self._feed.bus.put(self._feed.names.clock_control, codecs.encode([ClockRequest(scale)]), reliable=True)
        return "the clock stands" if scale == PAUSED else f"clock at {scale:g}"

    def send(self, node: int, east: float, north: float) -> str:
        """Send a UAV over a place, at the height at which it flies; on board it is one course among others."""
        said = f"UAV {node} sent to {east:.0f} m E, {north:.0f} m N"
        if self.has_post:
            return self._order(Order(OrderKind.STAY, node, east, north), said)
        at = to_geodetic(Enu(east, north, 0.0), self._origin)
        return self._command(node, common.MAV_CMD_DO_REPOSITION, said, -1.0, 1.0, place=at)

    def recall(self, node: int) -> str:
        said = f"UAV {node} sent home"
        if self.has_post:
            return self._order(Order(OrderKind.RECALL, node), said)
        return self._command(node, common.MAV_CMD_NAV_RETURN_TO_LAUNCH, said)

    def release(self, node: int) -> str:
        """Let a UAV do again what the swarm does."""
        said = f"UAV {node} released"
        if self.has_post:
            return self._order(Order(OrderKind.RELEASE, node), said)
        self._commanded.discard(node)
        return self._command(node, common.MAV_CMD_MISSION_START, said, keeps=False)

    def stay_present(self) -> None:
        """Let UAVs that were commanded hear once a second that their ground station is there."""
        if self._commanded and self._monotonic_s() >= self._present_s + _PRESENT_S:
            self._present_s = self._monotonic_s()
            heartbeat = common.MAVLink_heartbeat_message(
                common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, common.MAV_STATE_ACTIVE, 3
            )
            for node in sorted(self._commanded):
                self._say(node, heartbeat)

    def _control(self, control: Control, said: str) -> str:
        self._feed.bus.put(self._feed.names.radio_control, codecs.encode([control]), reliable=True)
        return said

    def _command(
        self, node: int, number: int, said: str, *params: float, place: Geodetic | None = None, keeps: bool = True
    ) -> str:
        """Command a UAV; `keeps`: it is under command until it is released."""
        nowhere = 0x7FFF_FFFF
        lat, lon = (nowhere, nowhere) if place is None else (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7))
        four = (*params, math.nan, math.nan, math.nan, math.nan)[:4]
        whom = (system_id(NodeId(node)), AUTOPILOT_COMPONENT)
        self._say(
            node,
            common.MAVLink_command_int_message(*whom, common.MAV_FRAME_GLOBAL, number, 0, 0, *four, lat, lon, math.nan),
        )
        if keeps:
            self._commanded.add(node)
        return said

    def _say(self, node: int, message: Any) -> None:  # noqa: ANN401  (pymavlink has no types)
        frame = bytes(message.pack(self._voice))
        self._voice.seq = (self._voice.seq + 1) % 256
        self._feed.bus.put(self._feed.names.operator(node), codecs.encode([MavlinkTap(0, frame)]), reliable=True)

    def _order(self, order: Order, said: str) -> str:
        self._feed.bus.put(self._feed.names.orders, codecs.encode([order]), reliable=True)
        return said

"""What a person who looks can do to a running swarm; each action is one message on the bus, as of `fanet air`."""

import math
from typing import Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import PACE_BOUNDS, ClockRequest
from fanet_mw.bus.radio_control import Control, Cut, Degrade, Jam, Mishap, MishapKind, Restore, link_label, node_label
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import STILL, Enu, NodeId
from sim.observation.bus_feed import BusFeed

PAUSED: Final = PACE_BOUNDS[0]


class Actions:
    """The actions on one swarm. They return at once; the trace shows what came of them."""

    def __init__(self, feed: BusFeed) -> None:
        self._feed = feed
        self.has_post = bool(feed.scenario.ground.at_m)
        """True if there is a post on the ground, which alone gives orders to UAVs."""

    def cut(self, node: int) -> str:
        """Switch a UAV's radio off."""
        return self._control(Cut(node_label(node), NodeId(node)), f"UAV {node}: radio off")

    def crash(self, node: int) -> str:
        """Let a UAV's motors stop."""
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
        """Let nothing be received in a circle."""
        return self._control(
            Jam(label, Enu(east, north, 0.0), radius, math.inf), f"jammed {radius:.0f} m about {east:.0f}, {north:.0f}"
        )

    def restore(self) -> str:
        """End all faults on the air."""
        return self._control(Restore(""), "all faults end")

    def pace(self, time_scale: float) -> str:
        """Let the swarm's time pass at another pace."""
        scale = min(max(time_scale, PACE_BOUNDS[0]), PACE_BOUNDS[1])
        self._feed.bus.put(self._feed.names.clock_control, codecs.encode([ClockRequest(scale)]), reliable=True)
        return "the clock stands" if scale == PAUSED else f"clock at {scale:g}"

    def send(self, node: int, east: float, north: float) -> str:
        """Let the post order a UAV to stay over a place; on board it is one course among others."""
        return self._order(Order(OrderKind.STAY, node, east, north), f"UAV {node} ordered to {east:.0f}, {north:.0f}")

    def recall(self, node: int) -> str:
        """Let the post order a UAV home."""
        return self._order(Order(OrderKind.RECALL, node), f"UAV {node} ordered home")

    def release(self, node: int) -> str:
        """Let a UAV take part in the search again."""
        return self._order(Order(OrderKind.RELEASE, node), f"UAV {node} released")

    def _control(self, control: Control, said: str) -> str:
        self._feed.bus.put(self._feed.names.radio_control, codecs.encode([control]), reliable=True)
        return said

    def _order(self, order: Order, said: str) -> str:
        if not self.has_post:
            return "no post on the ground (ground.at_m) that could order it"
        self._feed.bus.put(self._feed.names.orders, codecs.encode([order]), reliable=True)
        return said

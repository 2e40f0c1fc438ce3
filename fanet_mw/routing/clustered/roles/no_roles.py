"""The part for roles in a swarm without a leader: no node has a role, and every node floods its own packets."""

from collections.abc import Mapping

from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbor
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.gradient import UNREACHABLE, RouteToHead
from fanet_mw.units import NodeId
from fanet_mw.wire.hello.beacon import Beacon, Role


class NoRoles:
    """A node without any role. Its beacon states how many hops it is from a node that holds a slot."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def start(self, now_ns: int) -> None:
        """Nothing is done: there is no leader to join."""

    def on_sign_of_life(self, node: int, *, born_ns: int, now_ns: int) -> None:
        """Nothing is done: no node watches other nodes."""

    def on_control(self, packet: Packet, src: NodeId, *, now_ns: int) -> bool:
        """Nothing is done: no node of such a swarm sends control packets; if one is received, it is relayed
        like data.
        """
        return False

    def on_hello(self, neighbor: Neighbor, *, born_ns: int, now_ns: int) -> None:
        """Nothing is done: what a neighbor states about leaders does not count."""

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:
        """Nothing is done: there is no leader in whose name anything could be announced."""

    def on_flooding(self, due_ns: int) -> None:
        """Nothing is done: no other node needs a sign of life."""

    def on_parent_lost(self, parent: NodeId, *, now_ns: int) -> None:
        """Nothing is done: parents are no heads here."""

    def before_hello(self, now_ns: int) -> None:
        """Nothing is done once per hello."""

    def beacon(self, route: RouteToHead | None, *, now_ns: int) -> Beacon:
        return Beacon(
            node=self._port.node,
            head=route.head if route else 0,
            head_seq=route.head_seq if route else 0,
            cluster=0,
            epoch=0,
            slot=0,
            role=Role.ISOLATED,
            hops_to_head=route.hops if route else UNREACHABLE,
        )

    def hello_share(self, now_ns: int) -> float:
        return 1.0

    def next_wake_ns(self) -> int | None:
        return None

    def wake(self, now_ns: int) -> None:
        """Nothing is ever due."""

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        return {}

    def report(self) -> Mapping[str, object]:
        return {}

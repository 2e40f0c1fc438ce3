"""Relaying rules by two-hop knowledge from hellos: `heads`, `cds` and `mpr`.

    heads  the cluster heads relay, and the gateways, which are the nodes that connect them
    cds    the connected dominating set of Wu and Li relays; each node computes for itself whether it belongs to it
    mpr    the nodes relay that the last sender chose as its multipoint relays; the first copy decides (RFC 3626)

A node that started less than four hello intervals ago knows too little, and relays everything. These rules leave no
relay to spare, so a frame that a relay loses is lost to all nodes behind it: in contention they deliver less than
`all`.
"""

from collections.abc import Mapping, Sequence
from typing import Final, Protocol

from fanet_mw.bus.messages import Reception
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.clustered.contract import Relaying
from fanet_mw.routing.clustered.links.neighborhood import Neighborhood
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.units import NodeId, seconds_to_ns
from fanet_mw.wire import Kind
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.hello.neighbors import NeighborList

_LEARN: Final = 4
"""The number of hello intervals after which two hops are known: one for the neighbors, one for theirs, and two may be
lost."""

_NOTHING: Final[Mapping[str, object]] = {}


class RelayChoice(Protocol):
    """Decides whether a node relays, once it knows its two hops."""

    near: Neighborhood

    def before_hello(self, now_ns: int) -> None:
        """The node is about to send a hello, into which this choice may put a statement."""

    def on_beacon(self, beacon: Beacon) -> None:
        """A neighbor's beacon was received, which states its role."""

    def relays(self, sender: NodeId, *, now_ns: int) -> bool:
        """True if this node relays what `sender` has transmitted."""


class MultipointRelays:
    """Each node chooses which of its neighbors relay what it transmits."""

    def __init__(self, near: Neighborhood) -> None:
        self.near = near

    def before_hello(self, now_ns: int) -> None:
        self.near.choose_relays(now_ns=now_ns)

    def on_beacon(self, beacon: Beacon) -> None:
        """Nothing depends on a neighbor's role."""

    def relays(self, sender: NodeId, *, now_ns: int) -> bool:
        return self.near.chosen_by(sender)


class DominatingSet:
    """A node relays if it belongs to the connected dominating set."""

    def __init__(self, near: Neighborhood) -> None:
        self.near = near

    def before_hello(self, now_ns: int) -> None:
        """The set needs no statement in hellos."""

    def on_beacon(self, beacon: Beacon) -> None:
        """Nothing depends on a neighbor's role."""

    def relays(self, sender: NodeId, *, now_ns: int) -> bool:
        return self.near.dominates(now_ns=now_ns)


class HeadsFirst:
    """Cluster heads relay, and those nodes of the dominating set that connect them."""

    def __init__(self, node: NodeId, *, lifetime_ns: int, membership: Membership) -> None:
        self._membership = membership
        self._is_head: dict[int, bool] = {}
        self.near = Neighborhood(node, lifetime_ns=lifetime_ns, rank=self._rank)

    def _rank(self, node: NodeId) -> float:
        return float(self._is_head.get(node, False))

    def before_hello(self, now_ns: int) -> None:
        """Nothing needs to be added to the hello: its beacon states whether the node is a head."""

    def on_beacon(self, beacon: Beacon) -> None:
        is_head = beacon.role == Role.HEAD
        if self._is_head.get(beacon.node) is not is_head:
            self._is_head[beacon.node] = is_head
            self.near.forget_rank()

    def relays(self, sender: NodeId, *, now_ns: int) -> bool:
        return self._membership.is_head or self.near.dominates(now_ns=now_ns)


class NeighborKnowledgeRelaying:
    """Relays data if hellos have made this node a relay. Control packets are relayed by the rule `otherwise`."""

    def __init__(self, port: Port, choice: RelayChoice, otherwise: Relaying) -> None:
        self._node = port.node
        self._learn_ns = _LEARN * seconds_to_ns(port.scenario.routing.hello_interval_s)
        self._choice = choice
        self._otherwise = otherwise
        self._known_ns = 0

    def start(self, now_ns: int) -> None:
        self._known_ns = now_ns + self._learn_ns

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        is_data = packet.header.kind == Kind.DATA
        if is_data and now_ns >= self._known_ns and not self._choice.relays(reception.src, now_ns=now_ns):
            return ()
        return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)

    def neighbor_list(self, now_ns: int) -> NeighborList:
        self._choice.before_hello(now_ns)
        return NeighborList(self._node, self._choice.near.heard(now_ns=now_ns))

    def on_neighbor_list(self, said: NeighborList, beacon: Beacon, *, now_ns: int) -> None:
        self._choice.near.on_neighbor_list(said, now_ns=now_ns)
        self._choice.on_beacon(beacon)

    def report(self) -> Mapping[str, object]:
        return _NOTHING

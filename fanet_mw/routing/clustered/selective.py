"""Floods that only some nodes relay, chosen by what hellos say of the two hops around: `heads`, `cds`, `mpr`.

`heads`  cluster heads, and the nodes that are needed to connect them: a dominating set in which heads come first
`cds`    the connected dominating set of Wu and Li, each node deciding for itself     (connected_dominating_set.py)
`mpr`    whom the last sender chose as multipoint relay; the first copy decides       (RFC 3626, 3.4.1 and 8.3.1)

All else is as in `clustered`. A node that came up less than four hello intervals ago knows too little and relays. With
no relay to spare a loss is a loss for all behind it: where relays contend, fewer of them deliver less than `all` does.
"""

from typing import Final

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.arrival import decoded
from fanet_mw.node.contract import Port
from fanet_mw.node.queue import Packet
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.relaying.neighborhood import Neighborhood
from fanet_mw.units import NodeId, seconds_to_ns
from fanet_mw.wire import Kind
from fanet_mw.wire.claims import MESSAGE_BYTES, Claims, Standing
from fanet_mw.wire.inner import Beacon, Role

_LIFETIMES: Final = 3.5
_LEARN: Final = 4
"""Hello intervals after which the two hops are known: one for the neighbors, one for theirs, and two may be lost."""


class Selective(Clustered):
    """Clustered, time-divided flooding with chosen relays, at one node."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._rule = port.scenario.clusters.relay
        self._hello_ns = seconds_to_ns(port.scenario.routing.hello_interval_s)
        self._heads: dict[NodeId, bool] = {}
        self._near = Neighborhood(port.node, lifetime_ns=int(_LIFETIMES * self._hello_ns), rank=self._rank)
        self._known_ns = 0

    def _rank(self, node: NodeId, _: Standing) -> float:
        return float(self._rule == "heads" and self._heads.get(node, False))

    def start(self, now_ns: int) -> None:
        super().start(now_ns)
        self._known_ns = now_ns + _LEARN * self._hello_ns

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        if self._rule == "mpr":
            self._near.choose_relays(now_ns=now_ns)
        claims = Claims(self._port.node, Standing(), self._near.heard(now_ns=now_ns))
        inner = super().hello_inner(room - MESSAGE_BYTES, now_ns=now_ns)
        return inner + claims.encode_frames(room - len(inner))

    def hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        super().hello(packet, reception, now_ns=now_ns)
        claims = decoded(packet, Claims.decode_frames)
        if claims is not None and any(heard.node > self._port.scenario.nodes.count for heard in claims.heard):
            raise MalformedFrameError("claims of nodes that are not there")
        if claims is None or claims.node != reception.src:
            return
        self._near.hear(claims, now_ns=now_ns)
        is_head = decoded(packet, Beacon.decode_frame).role == Role.HEAD
        if self._heads.get(claims.node) is not is_head:
            self._heads[claims.node] = is_head
            self._near.forget_rank()

    def _flood_on(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if packet.header.kind != Kind.DATA or self._relays(reception.src, now_ns=now_ns):
            super()._flood_on(packet, reception, now_ns=now_ns)

    def _relays(self, sender: NodeId, *, now_ns: int) -> bool:
        if now_ns < self._known_ns:
            return True
        if self._rule == "mpr":
            return self._near.chosen_by(sender)
        if self._rule == "heads" and self._membership.is_head:
            return True
        return self._near.dominates(own_rank=0.0, now_ns=now_ns)

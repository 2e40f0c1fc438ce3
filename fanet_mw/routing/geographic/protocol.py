"""Carry and forward by position, in the manner of VADD (Zhao and Cao, IEEE INFOCOM 2006), without its roads.

A packet is handed over, acknowledged, to the neighbor nearest to the destination, or kept while flying on. A
destination that receives data floods its position, at most every 5 s, or once a second when queried; beacons carry the
locations in use between partitions. Not modeled: VADD's delay estimates per road segment and its variants; the motion
of neighbors between beacons; recovery round voids other than by carrying.
"""

from collections.abc import Mapping
from typing import ClassVar, Final

from fanet_mw.bus.messages import Reception, TxOutcome
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, is_used_up
from fanet_mw.routing.address_resolution import Outgoing
from fanet_mw.routing.geographic.messages import (
    BEACON,
    LOCATION,
    MOST_FIXES,
    QUERY,
    Fix,
    Location,
    PositionBeacon,
    Query,
)
from fanet_mw.routing.hop_by_hop import HopByHop
from fanet_mw.routing.rival_control_messages import Family
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S, earliest

HELLO_INTERVAL_NS: Final = 1 * S
NEIGHBOR_LIFETIME_NS: Final = 5 * HELLO_INTERVAL_NS // 2
"""One beacon may be lost, but not two in a row."""
MIN_PROGRESS_M: Final = 10.0
"""The least progress towards the destination for which a packet is handed over: several times the error of a fix."""
_FUTURE_US: Final = 1_000_000
"""A location from further in the future than this is not believed, because it would never be replaced."""


class LocationTable:
    """What one node knows of the locations of others."""

    def __init__(self) -> None:
        self._neighbors: dict[NodeId, tuple[Enu, int]] = {}
        """The position of each neighbor, and until when it holds."""
        self._fixes: dict[NodeId, Fix] = {}
        self._used: dict[NodeId, None] = {}
        """Destinations in the order of their last use."""

    def on_beacon(self, neighbor: NodeId, position: Enu, *, now_ns: int) -> None:
        self._neighbors[neighbor] = position, now_ns + NEIGHBOR_LIFETIME_NS

    def forget(self, neighbor: NodeId) -> None:
        self._neighbors.pop(neighbor, None)

    def learn(self, fix: Fix, *, now_us: int) -> None:
        """Take in a location; the latest of each node is kept."""
        node = NodeId(fix.node)
        known = self._fixes.get(node)
        if fix.t_us <= now_us + _FUTURE_US and (known is None or fix.t_us > known.t_us):
            self._fixes[node] = fix

    def fix(self, node: NodeId) -> Fix | None:
        return self._fixes.get(node)

    def use(self, destination: NodeId) -> None:
        """Note that a destination is in use, so that its location is worth passing on."""
        self._used.pop(destination, None)
        self._used[destination] = None
        while len(self._used) > MOST_FIXES:
            del self._used[next(iter(self._used))]

    def in_use(self) -> tuple[Fix, ...]:
        return tuple(self._fixes[node] for node in self._used if node in self._fixes)

    def next_hop(self, destination: NodeId, *, at: Enu, excluded: NodeId, now_ns: int) -> NodeId | None:
        """The destination, or the neighbor nearest to it if nearer than `at`; never the giver, `excluded`: two nodes
        that know different locations would pass the packet back and forth.
        """
        if destination in self._neighbors and self._neighbors[destination][1] > now_ns:
            return destination
        fix = self._fixes.get(destination)
        if fix is None:
            return None
        best, best_m = None, fix.position.minus(at).norm() - MIN_PROGRESS_M
        for node in sorted(self._neighbors):
            position, ends_ns = self._neighbors[node]
            left_m = fix.position.minus(position).norm()
            if ends_ns > now_ns and node != excluded and left_m < best_m:
                best, best_m = node, left_m
        return best

    def count(self, *, now_ns: int) -> int:
        return sum(1 for _, ends_ns in self._neighbors.values() if ends_ns > now_ns)


LOCATION_INTERVAL_NS: Final = 5 * S
LOCATION_AGE_NS: Final = 10 * S
"""A location older than this is queried again."""
QUERY_INTERVAL_NS: Final = 5 * S
"""The least time between two queries of one node for one destination."""
LOOK_INTERVAL_NS: Final = 500 * MS


class Geographic(HopByHop):
    """Greedy forwarding by position; a packet is carried while no neighbor is nearer to its destination."""

    family: ClassVar[Family] = Family.GEOGRAPHIC

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._locations = LocationTable()
        self._hops = port.scenario.routing.hop_limit
        self._beacon_ns: int | None = None
        self._retry_ns: int | None = None
        self._located_ns = -LOCATION_INTERVAL_NS
        self._queried_ns: dict[NodeId, int] = {}

    def start(self, now_ns: int) -> None:
        self._beacon_ns = now_ns + int(self._random() * HELLO_INTERVAL_NS)

    # --- data -------------------------------------------------------------------------------------------------------

    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        destination = NodeId(packet.header.destination)
        self._locations.use(destination)
        self._query(destination, now_ns=now_ns)
        excluded = NodeId(packet.header.prev_hop)
        next_hop = self._locations.next_hop(destination, at=self._port.position, excluded=excluded, now_ns=now_ns)
        if next_hop is None:
            self._carry(packet, now_ns=now_ns)
        else:
            self._send(packet, next_hop, start_ns=start_ns, now_ns=now_ns)

    def _carry(self, packet: Packet, *, now_ns: int) -> None:
        self._room.push(packet, now_ns=now_ns)
        if self._retry_ns is None:
            self._retry_ns = now_ns + LOOK_INTERVAL_NS

    def _retry_carried(self, now_ns: int) -> None:
        """Try to forward what is carried. A packet older than its lifetime is dropped, however short its stay here."""
        self._retry_ns = None
        self._room.expire(now_ns=now_ns)
        oldest_us = now_ns // US - round(self._port.scenario.routing.lifetime_s * 1_000_000)
        for destination in self._room.destinations():
            for packet in self._room.take(destination):
                if packet.header.origin_us < oldest_us:
                    self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
                else:
                    self._route_own(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def _on_failure(self, packet: Packet, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        """Keep custody of a packet: the neighbor is gone, or the MAC queue is full."""
        if outcome is TxOutcome.RETRY_LIMIT:
            self._locations.forget(next_hop)
        self._carry(packet, now_ns=now_ns)

    def _on_unresolved(self, out: Outgoing, *, now_ns: int) -> None:
        """Keep custody of a packet: the neighbor has not answered a request for its address."""
        if out.is_data:
            self._locations.forget(out.next_hop)
            self._carry(out.packet, now_ns=now_ns)
        else:
            self._drop_unresolved(out, now_ns=now_ns)

    def _on_acknowledged(self, packet: Packet, next_hop: NodeId) -> None:
        self._port.forget(packet)

    def _on_arrival(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        self._flood_location(now_ns=now_ns, every_ns=LOCATION_INTERVAL_NS)

    # --- location service -------------------------------------------------------------------------------------------

    def _query(self, destination: NodeId, *, now_ns: int) -> None:
        """Query a location that is unknown or old, at most once per QUERY_INTERVAL_NS."""
        fix = self._locations.fix(destination)
        if fix is not None and fix.t_us * US + LOCATION_AGE_NS > now_ns:
            return
        if self._queried_ns.get(destination, -QUERY_INTERVAL_NS) + QUERY_INTERVAL_NS <= now_ns:
            self._queried_ns[destination] = now_ns
            self._flood_control(QUERY, Query(destination).encode(), now_ns=now_ns)

    def _flood_location(self, *, now_ns: int, every_ns: int) -> None:
        if self._located_ns + every_ns <= now_ns:
            self._located_ns = now_ns
            self._flood_control(LOCATION, Location(self._port.position).encode(), now_ns=now_ns)

    def _flood_control(self, number: int, body: bytes, *, now_ns: int) -> None:
        start_ns = self._jittered(now_ns, self._jitter_ns)
        self._send_control(number, body, start_ns=start_ns, now_ns=now_ns, ttl=self._hops)

    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if number == BEACON:
            beacon = PositionBeacon.decode(body)
            self._locations.on_beacon(reception.src, beacon.position, now_ns=now_ns)
            for fix in (Fix(reception.src, beacon.position, now_ns // US), *beacon.fixes):
                self._locations.learn(fix, now_us=now_ns // US)
            return
        if number == LOCATION:
            fix = Fix(packet.origin, Location.decode(body).position, packet.header.origin_us)
            self._locations.learn(fix, now_us=now_ns // US)
        elif number == QUERY:
            if Query.decode(body).wanted == self._port.node:
                self._flood_location(now_ns=now_ns, every_ns=S)
                return
        else:
            raise MalformedFrameError(f"geographic message {number}")
        if packet.origin != self._port.node and not is_used_up(packet.header):
            self.control_sent += 1
            frame = self._port.forwarded(packet, flags=0)
            self._port.transmit(frame, BROADCAST, start_ns=self._jittered(now_ns, self._jitter_ns))

    # --- time -------------------------------------------------------------------------------------------------------

    def _due_ns(self) -> int | None:
        return earliest(self._beacon_ns, self._retry_ns)

    def _on_wake(self, now_ns: int) -> None:
        if self._beacon_ns is not None and now_ns >= self._beacon_ns:
            beacon = PositionBeacon(self._port.position, self._locations.in_use())
            self._send_control(BEACON, beacon.encode(), start_ns=self._jittered(now_ns, self._jitter_ns), now_ns=now_ns)
            self._beacon_ns = max(now_ns, self._beacon_ns + HELLO_INTERVAL_NS)
        if self._retry_ns is not None and now_ns >= self._retry_ns:
            self._retry_carried(now_ns)

    # --- reporting --------------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        return {"control_sent": self.control_sent, "waiting": self.waiting(), "carried": len(self._room)}

"""The repositories of an OLSR node: links, neighbors, 2-hop neighbors, MPR selectors, topology (RFC 3626, 4).

Every entry has its own end; nothing here has a timer. `version` changes whenever a message may have changed an input of
the routes; `next_change_ns` is the instant at which they next change by the passing of time.
"""

from dataclasses import dataclass, field

from fanet_mw.routing.olsr.messages import Hello, LinkType, NeighborType, TopologyControl, decode_time
from fanet_mw.routing.olsr.parameters import NEIGHB_HOLD_TIME_NS, WILL_DEFAULT
from fanet_mw.serial_number import newer
from fanet_mw.units import NodeId

_NEVER_NS = 1 << 62
_ANSN_BITS = 16


@dataclass(slots=True)
class LinkTuple:
    """The entry of one neighbor in the link set (4.2.1), with its willingness (4.3.1)."""

    sym_ns: int
    """L_SYM_time: until then the link is symmetric."""
    asym_ns: int
    """L_ASYM_time: until then the neighbor is heard."""
    ends_ns: int
    willingness: int = WILL_DEFAULT


@dataclass(slots=True)
class TopologyEntry:
    """The entries of one last hop in the topology set (4.4), which have one ANSN."""

    ansn: int
    ends_ns: dict[NodeId, int] = field(default_factory=dict)


class Repositories:
    """The repositories of one node."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._links: dict[NodeId, LinkTuple] = {}
        self._two_hop: dict[NodeId, dict[NodeId, int]] = {}
        """For each neighbor its symmetric neighbors, each with its N_time."""
        self._selectors: dict[NodeId, int] = {}
        self._topology: dict[NodeId, TopologyEntry] = {}
        self.version = 0

    # --- queries ----------------------------------------------------------------------------------------------------

    def is_symmetric(self, node: NodeId, *, now_ns: int) -> bool:
        link = self._links.get(node)
        return link is not None and link.sym_ns >= now_ns

    def symmetric(self, *, now_ns: int) -> list[NodeId]:
        """The neighbors over symmetric links, ascending."""
        return [node for node in sorted(self._links) if self._links[node].sym_ns >= now_ns]

    def link_of(self, node: NodeId, *, now_ns: int) -> LinkType | None:
        """The link type that a hello would state (6.2); None when there is no link."""
        link = self._links.get(node)
        if link is None or link.ends_ns < now_ns:
            return None
        if link.sym_ns >= now_ns:
            return LinkType.SYM
        return LinkType.ASYM if link.asym_ns >= now_ns else LinkType.LOST

    def linked(self, *, now_ns: int) -> list[NodeId]:
        """All nodes with a link, ascending."""
        return [node for node in sorted(self._links) if self._links[node].ends_ns >= now_ns]

    def willingness(self, node: NodeId) -> int:
        return self._links[node].willingness

    def two_hop(self, neighbor: NodeId, *, now_ns: int) -> list[NodeId]:
        """The symmetric neighbors of a neighbor, ascending."""
        known = self._two_hop.get(neighbor, {})
        return [node for node in sorted(known) if known[node] >= now_ns]

    def is_selector(self, node: NodeId, *, now_ns: int) -> bool:
        """True if this neighbor has chosen this node as MPR, and still is a symmetric neighbor."""
        return self._selectors.get(node, -1) >= now_ns and self.is_symmetric(node, now_ns=now_ns)

    def selectors(self, *, now_ns: int) -> list[NodeId]:
        return [node for node in sorted(self._selectors) if self.is_selector(node, now_ns=now_ns)]

    def topology(self, *, now_ns: int) -> list[tuple[NodeId, NodeId]]:
        """The pairs (last hop, destination) of the topology set, ascending."""
        return [
            (last, destination)
            for last in sorted(self._topology)
            for destination in sorted(self._topology[last].ends_ns)
            if self._topology[last].ends_ns[destination] >= now_ns
        ]

    def next_change_ns(self, now_ns: int) -> int:
        """The last instant at which everything that is valid now still is."""
        ends = [link.sym_ns for link in self._links.values() if link.sym_ns >= now_ns]
        for known in (*self._two_hop.values(), *(entry.ends_ns for entry in self._topology.values())):
            ends += [end_ns for end_ns in known.values() if end_ns >= now_ns]
        return min(ends, default=_NEVER_NS)

    # --- updates ----------------------------------------------------------------------------------------------------

    def on_hello(self, sender: NodeId, hello: Hello, *, now_ns: int) -> None:
        """Handle a hello by 7.1.1, 8.1.1, 8.2.1 and 8.4.1, in this order."""
        self.version += 1
        valid_ns = now_ns + decode_time(hello.vtime)
        self._sense(sender, hello, valid_ns=valid_ns, now_ns=now_ns)
        if self.is_symmetric(sender, now_ns=now_ns):
            self._learn_two_hop(sender, hello, valid_ns=valid_ns)
            if any(h.node == self._node and h.neighbor_type is NeighborType.MPR for h in hello.neighbors):
                self._selectors[sender] = valid_ns

    def _sense(self, sender: NodeId, hello: Hello, *, valid_ns: int, now_ns: int) -> None:
        link = self._links.get(sender)
        if link is None or link.ends_ns < now_ns:
            link = self._links[sender] = LinkTuple(sym_ns=now_ns - 1, asym_ns=valid_ns, ends_ns=valid_ns)
        link.asym_ns = valid_ns
        for entry in hello.neighbors:
            if entry.node == self._node:
                if entry.link_type is LinkType.LOST:
                    link.sym_ns = now_ns - 1
                elif entry.link_type in (LinkType.SYM, LinkType.ASYM):
                    link.sym_ns = valid_ns
                    link.ends_ns = valid_ns + NEIGHB_HOLD_TIME_NS
        link.ends_ns = max(link.ends_ns, link.asym_ns)
        link.willingness = hello.willingness

    def _learn_two_hop(self, sender: NodeId, hello: Hello, *, valid_ns: int) -> None:
        known = self._two_hop.setdefault(sender, {})
        for entry in hello.neighbors:
            node = NodeId(entry.node)
            if entry.neighbor_type is NeighborType.NOT:
                known.pop(node, None)
            elif node != self._node:
                known[node] = valid_ns

    def on_tc(self, originator: NodeId, tc: TopologyControl, *, now_ns: int) -> bool:
        """Handle a TC from the second condition of 9.5 on; returns True if it was not outdated."""
        entry = self._topology.get(originator)
        if entry is not None and all(end_ns < now_ns for end_ns in entry.ends_ns.values()):
            entry = None  # all its tuples have expired, and its ANSN is forgotten with them
        if entry is not None and newer(entry.ansn, tc.ansn, bits=_ANSN_BITS):
            return False
        self.version += 1
        if entry is None or entry.ansn != tc.ansn:
            entry = self._topology[originator] = TopologyEntry(tc.ansn)
        valid_ns = now_ns + decode_time(tc.vtime)
        for node in tc.advertised:
            entry.ends_ns[NodeId(node)] = valid_ns
        return True

    # --- expiry -----------------------------------------------------------------------------------------------------

    def tidy(self, now_ns: int) -> None:
        """Remove what has expired; with a neighbor that is no longer symmetric its tuples are removed (8.5)."""
        for node in [node for node, link in self._links.items() if link.ends_ns < now_ns]:
            del self._links[node]
        for node in [n for n in self._two_hop if not self.is_symmetric(n, now_ns=now_ns)]:
            del self._two_hop[node]
        for node in [n for n in self._selectors if not self.is_selector(n, now_ns=now_ns)]:
            del self._selectors[node]
        for last in [n for n, entry in self._topology.items() if all(e < now_ns for e in entry.ends_ns.values())]:
            del self._topology[last]

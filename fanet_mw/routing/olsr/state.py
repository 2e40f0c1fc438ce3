"""What an OLSR node has been told: links, neighbors, 2-hop neighbors, MPR selectors, topology (RFC 3626, 4).

Every entry has its end; nothing here has a timer. `version` changes whenever what the routes are made of may have
changed by a message, `next_change_ns` says when it does by time alone.
"""

from dataclasses import dataclass, field

from fanet_mw.routing.olsr.messages import Hello, Link, Neighborhood, TopologyControl, decode_time
from fanet_mw.routing.olsr.parameters import NEIGHB_HOLD_TIME_NS, WILL_DEFAULT
from fanet_mw.serial import newer
from fanet_mw.units import NodeId

_NEVER_NS = 1 << 62
_ANSN_BITS = 16


@dataclass(slots=True)
class LinkTuple:
    """The link set's entry of one neighbor (4.2.1), with its willingness (4.3.1)."""

    sym_ns: int
    """L_SYM_time: until then the link is symmetric."""
    asym_ns: int
    """L_ASYM_time: until then the neighbor is heard."""
    ends_ns: int
    willingness: int = WILL_DEFAULT


@dataclass(slots=True)
class Advertised:
    """The topology set's entries of one last hop (4.4): one ANSN for all."""

    ansn: int
    ends_ns: dict[NodeId, int] = field(default_factory=dict)


class State:
    """The repositories of one node."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._links: dict[NodeId, LinkTuple] = {}
        self._two_hop: dict[NodeId, dict[NodeId, int]] = {}
        """Neighbor -> its symmetric neighbors -> N_time."""
        self._selectors: dict[NodeId, int] = {}
        self._topology: dict[NodeId, Advertised] = {}
        self.version = 0

    # --- looking ----------------------------------------------------------------------------------------------------

    def is_symmetric(self, node: NodeId, *, now_ns: int) -> bool:
        link = self._links.get(node)
        return link is not None and link.sym_ns >= now_ns

    def symmetric(self, *, now_ns: int) -> list[NodeId]:
        """Neighbors over symmetric links, ascending."""
        return [node for node in sorted(self._links) if self._links[node].sym_ns >= now_ns]

    def link_of(self, node: NodeId, *, now_ns: int) -> Link | None:
        """The link type a hello would give (6.2); None when there is no link."""
        link = self._links.get(node)
        if link is None or link.ends_ns < now_ns:
            return None
        if link.sym_ns >= now_ns:
            return Link.SYM
        return Link.ASYM if link.asym_ns >= now_ns else Link.LOST

    def linked(self, *, now_ns: int) -> list[NodeId]:
        """Whoever has a link, ascending."""
        return [node for node in sorted(self._links) if self._links[node].ends_ns >= now_ns]

    def willingness(self, node: NodeId) -> int:
        return self._links[node].willingness

    def two_hop(self, neighbor: NodeId, *, now_ns: int) -> list[NodeId]:
        """The symmetric neighbors of a neighbor, ascending."""
        known = self._two_hop.get(neighbor, {})
        return [node for node in sorted(known) if known[node] >= now_ns]

    def is_selector(self, node: NodeId, *, now_ns: int) -> bool:
        """Whether this neighbor has chosen us as MPR, and still is one."""
        return self._selectors.get(node, -1) >= now_ns and self.is_symmetric(node, now_ns=now_ns)

    def selectors(self, *, now_ns: int) -> list[NodeId]:
        return [node for node in sorted(self._selectors) if self.is_selector(node, now_ns=now_ns)]

    def topology(self, *, now_ns: int) -> list[tuple[NodeId, NodeId]]:
        """(last hop, destination) of the topology set, ascending."""
        return [
            (last, destination)
            for last in sorted(self._topology)
            for destination in sorted(self._topology[last].ends_ns)
            if self._topology[last].ends_ns[destination] >= now_ns
        ]

    def next_change_ns(self, now_ns: int) -> int:
        """The last instant at which everything that holds now still does."""
        ends = [link.sym_ns for link in self._links.values() if link.sym_ns >= now_ns]
        for known in (*self._two_hop.values(), *(entry.ends_ns for entry in self._topology.values())):
            ends += [end_ns for end_ns in known.values() if end_ns >= now_ns]
        return min(ends, default=_NEVER_NS)

    # --- learning ---------------------------------------------------------------------------------------------------

    def hear_hello(self, sender: NodeId, hello: Hello, *, now_ns: int) -> None:
        """7.1.1, 8.1.1, 8.2.1 and 8.4.1, in this order."""
        self.version += 1
        valid_ns = now_ns + decode_time(hello.vtime)
        self._sense(sender, hello, valid_ns=valid_ns, now_ns=now_ns)
        if self.is_symmetric(sender, now_ns=now_ns):
            self._learn_two_hop(sender, hello, valid_ns=valid_ns)
            if any(h.node == self._node and h.neighborhood is Neighborhood.MPR for h in hello.heard):
                self._selectors[sender] = valid_ns

    def _sense(self, sender: NodeId, hello: Hello, *, valid_ns: int, now_ns: int) -> None:
        link = self._links.get(sender)
        if link is None or link.ends_ns < now_ns:
            link = self._links[sender] = LinkTuple(sym_ns=now_ns - 1, asym_ns=valid_ns, ends_ns=valid_ns)
        link.asym_ns = valid_ns
        for heard in hello.heard:
            if heard.node == self._node:
                if heard.link is Link.LOST:
                    link.sym_ns = now_ns - 1
                elif heard.link in (Link.SYM, Link.ASYM):
                    link.sym_ns = valid_ns
                    link.ends_ns = valid_ns + NEIGHB_HOLD_TIME_NS
        link.ends_ns = max(link.ends_ns, link.asym_ns)
        link.willingness = hello.willingness

    def _learn_two_hop(self, sender: NodeId, hello: Hello, *, valid_ns: int) -> None:
        known = self._two_hop.setdefault(sender, {})
        for heard in hello.heard:
            node = NodeId(heard.node)
            if heard.neighborhood is Neighborhood.NOT:
                known.pop(node, None)
            elif node != self._node:
                known[node] = valid_ns

    def hear_tc(self, originator: NodeId, tc: TopologyControl, *, now_ns: int) -> bool:
        """9.5, from its second condition on; says whether it was news."""
        entry = self._topology.get(originator)
        if entry is not None and all(end_ns < now_ns for end_ns in entry.ends_ns.values()):
            entry = None  # every tuple of it has expired: its ANSN is forgotten with them
        if entry is not None and newer(entry.ansn, tc.ansn, bits=_ANSN_BITS):
            return False
        self.version += 1
        if entry is None or entry.ansn != tc.ansn:
            entry = self._topology[originator] = Advertised(tc.ansn)
        valid_ns = now_ns + decode_time(tc.vtime)
        for node in tc.advertised:
            entry.ends_ns[NodeId(node)] = valid_ns
        return True

    # --- forgetting -------------------------------------------------------------------------------------------------

    def tidy(self, now_ns: int) -> None:
        """Take out what has expired. A neighbor that is not symmetric any more takes its tuples along (8.5)."""
        for node in [node for node, link in self._links.items() if link.ends_ns < now_ns]:
            del self._links[node]
        for node in [n for n in self._two_hop if not self.is_symmetric(n, now_ns=now_ns)]:
            del self._two_hop[node]
        for node in [n for n in self._selectors if not self.is_selector(n, now_ns=now_ns)]:
            del self._selectors[node]
        for last in [n for n, entry in self._topology.items() if all(e < now_ns for e in entry.ends_ns.values())]:
            del self._topology[last]

"""The delay bound of a member's packets on their way to the head, hop by hop in contention; none if there is too much
traffic.

The backoff of a station is frozen by every transmission within two hops of it, and by the acknowledgements to it. Their
periods limit how many fall into a time w; the bound of a hop is the least w that holds them all, each at its cost by
`bounds.mac`, and enters that of the next hop as jitter. Beyond the flooding period there is none.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.bounds import Bounded, Dcf, DelayBound, Refused
from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, seconds_to_ns
from sim.planner.demand import TrafficClass
from sim.planner.flood_cost import frame_ns

_HELLO_BYTES: Final = 700
"""The length of the longest hello, one with digests of 45 origins (docs/explanation/protocol.md, Repair)."""
_ROUNDS: Final = 200


class Ways(NamedTuple):
    """`hops` of each node to its head; `through[n]`, the packets per class that node n sends on."""

    hops: Mapping[NodeId, int]
    through: Mapping[NodeId, tuple[int, ...]]
    homeless: tuple[NodeId, ...]
    """The nodes that cannot reach any head."""


def ways(adjacency: Adjacency, head_of: Mapping[NodeId, NodeId], classes: Sequence[TrafficClass]) -> Ways:
    """Shortest routes to each node's head; a node that has none, or cannot reach it, takes the nearest head."""
    parents = {head: _tree(adjacency, (head,)) for head in sorted(set(head_of.values()))}
    nearest = _tree(adjacency, tuple(parents))
    hops: dict[NodeId, int] = {}
    through = {node: [0] * len(classes) for node in adjacency}
    homeless = []
    for node in sorted(adjacency):
        own = parents.get(head_of.get(node, node), {})
        tree = own if node in own else nearest
        if node not in tree:
            homeless.append(node)
            continue
        at, hops[node] = node, 0
        sent = [1 if node in c.sources else 0 for c in classes]
        while tree[at] != at:
            through[at] = [a + b for a, b in zip(through[at], sent, strict=True)]
            at = tree[at]
            hops[node] += 1
    return Ways(hops, {node: tuple(row) for node, row in through.items()}, tuple(homeless))


def _tree(adjacency: Adjacency, roots: Sequence[NodeId]) -> dict[NodeId, NodeId]:
    """The next hop of each node towards the nearest root, breadth first by id; a root is its own next hop."""
    parent = {root: root for root in sorted(roots)}
    frontier = list(parent)
    while frontier:
        following = []
        for node in frontier:
            for neighbor in adjacency[node]:
                if neighbor not in parent:
                    parent[neighbor] = node
                    following.append(neighbor)
        frontier = following
    return parent


def access_outcome(
    scenario: Scenario, adjacency: Adjacency, found: Ways, classes: Sequence[TrafficClass], *, spacing_ns: int | None
) -> DelayBound:
    """The longest time from any member to its head over all hops; `spacing_ns`: the least time between floods."""
    if not classes or not any(found.hops.values()):
        return Bounded(0)
    most_hops = max(found.hops.values())
    worst_ns = 0
    for near, own in _neighborhoods(adjacency, found):
        hop = _hop_ns(scenario, classes, near=near, own=own, hops=most_hops, spacing_ns=spacing_ns)
        if hop is None:
            return Refused(
                f"{sum(own)} packets of its own and {sum(near[:-1])} of others within two hops per interval, "
                f"{scenario.radio.max_attempts} attempts each, exceed a flooding period in the worst case of CSMA/CA"
            )
        worst_ns = max(worst_ns, hop)
    return Bounded(most_hops * (worst_ns + scenario.radio.handover_ns + scenario.radio.lead_ns))


def _neighborhoods(adjacency: Adjacency, found: Ways) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """What each sender contends with, without repetitions: packets per class of all nodes within two hops, then the
    number of these nodes; and its own packets per class.
    """
    rivals = two_hop(adjacency)
    kinds: dict[tuple[tuple[int, ...], tuple[int, ...]], None] = {}
    for node, own in found.through.items():
        if any(own):
            near = tuple(map(sum, zip(*(found.through[r] for r in rivals[node]), strict=True)))
            kinds[(*near, len(rivals[node])), own] = None
    return sorted(kinds)


def _hop_ns(
    scenario: Scenario,
    classes: Sequence[TrafficClass],
    *,
    near: tuple[int, ...],
    own: tuple[int, ...],
    hops: int,
    spacing_ns: int | None,
) -> int | None:
    """The least w that holds all transmissions before the end of a packet of this node; None if there is none."""
    radio, dcf = scenario.radio, Dcf.of(scenario.radio)
    *packets, stations = near
    hello_every_ns = max(1, seconds_to_ns(scenario.routing.hello_interval_s) or scenario.duration_ns)
    airtimes = [frame_ns(radio, c.payload_bytes) for c in classes]
    answer_ns = max(dcf.sifs_ns + dcf.ack_ns, dcf.ack_timeout_ns)
    backoffs_ns = sum(dcf.window(i) for i in range(dcf.attempts)) * dcf.slot_ns
    after_ns = dcf.eifs_ns + dcf.slot_ns
    w_ns = 0
    for _ in range(_ROUNDS):
        wider_ns = stations * (w_ns // hello_every_ns + 1) * (frame_ns(radio, _HELLO_BYTES) + after_ns)
        if spacing_ns is not None:
            wider_ns += (stations + 1) * (w_ns // spacing_ns + 1) * (max(airtimes) + after_ns)
        for index, c in enumerate(classes):
            late_ns = (hops - 1) * (w_ns + radio.handover_ns)
            each = (w_ns + late_ns) // c.interval_ns + 1
            exchange_ns = airtimes[index] + dcf.sifs_ns + dcf.ack_ns + after_ns
            wider_ns += each * packets[index] * dcf.attempts * exchange_ns
            attempt_ns = dcf.eifs_ns + airtimes[index] + answer_ns
            wider_ns += each * own[index] * (dcf.attempts * attempt_ns + backoffs_ns)
        if wider_ns == w_ns:
            return w_ns
        if wider_ns > scenario.clusters.period_ns:
            return None
        w_ns = wider_ns
    return None

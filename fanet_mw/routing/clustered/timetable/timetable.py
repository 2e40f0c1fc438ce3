"""Collision-free floods: which node sends which root's packet in which turn. A pure function of positions.

    superframe:  | contention window | turn 0 | turn 1 | ... | turn N-1 |
    flood of h:    h in its root turn, then relays that reach everyone, each in a turn of its own, once

Each frame is meant for some of its sender's neighbors: those that lack the packet. Two nodes share a turn only if they
do not hear each other and none of the nodes that one is meant for is within interference range of the other (the
protocol model of Gupta and Kumar, 2000). A node that is meant by neither may be deaf in that turn; it does not send in
the next one, because a station waits for EIFS after a frame that it could not decode (IEEE 802.11-2020, 10.3.7).

The turns are filled one after the other (`list_scheduling.py`), so that floods follow each other through the swarm
like waves. That a packet crosses the whole swarm in one superframe comes from the order of turns, as in Djukic and
Valaee (ToN 17(3), 2009). Every node computes the same table from the same positions; nothing else is agreed upon. Not
modeled: links that positions do not tell (obstacles); use a shorter `link_m` for a margin.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

from fanet_mw.routing.clustered.timetable.delivery_odds import Odds, odds
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort, Flood, FloodNetwork, Packing
from fanet_mw.routing.clustered.timetable.redundant_scheduling import Network, RedundantPacking, Wave, enough_for
from fanet_mw.routing.clustered.timetable.turn_filling import Geometry, NodeRows
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.links import Link

PLAIN = Effort()


class Turn(NamedTuple):
    """One transmission: `node` sends the packet that `root` let out as its `instance`-th of this superframe."""

    offset: int
    """Turns from the beginning of the root's superframe; may reach into the next one."""
    node: NodeId
    root: NodeId
    instance: int


class Timetable(NamedTuple):
    """All turns of a superframe."""

    turns: tuple[Turn, ...]
    spans: Mapping[NodeId, int]
    """For each root, the turns from its own until all nodes have its packet, the first and the last included."""
    uncovered: Mapping[NodeId, tuple[NodeId, ...]]
    """For each root, the nodes that it cannot reach at all because the swarm is in parts."""
    used: int
    """Turns that are in use, of `geometry.turns`."""
    calls: Mapping[NodeId, tuple[int, ...]] = MappingProxyType({})
    """For each node, the turns in which it sends to its neighbors alone: a hello, or a packet that a neighbor lacks."""

    def roots(self) -> list[Turn]:
        """The turns in which packets are let out; a repetition lets out nothing new."""
        first: dict[tuple[NodeId, int], Turn] = {}
        for turn in sorted(self.turns):
            first.setdefault((turn.root, turn.instance), turn)
        return list(first.values())

    def offsets_of(self, root: NodeId) -> list[int]:
        """The turns in which one root lets packets out, ascending."""
        return sorted(turn.offset for turn in self.turns if turn.node == turn.root == root)


@lru_cache(maxsize=16)
def timetable(
    positions: tuple[tuple[NodeId, Enu], ...],
    roots: tuple[NodeId, ...],
    geometry: Geometry,
    heads: tuple[tuple[NodeId, NodeId], ...] = (),
    effort: Effort = PLAIN,
    blocks: int = 1,
) -> Timetable | None:
    """The table, None when the turns do not suffice. `roots`: one entry per packet and block, in any order.

    `positions` [m] in ascending order of nodes. `heads`: (node, its head) of nodes that are none; the flood of such a
    node goes to its head first, in turns on a shortest way, and on from there. The superframe is divided into so many
    equal `blocks`, which saves time: one is computed, and floods that outlast it go on in the next.
    """
    whole, geometry = geometry.turns, geometry._replace(turns=geometry.turns // blocks)
    if not geometry.turns:
        return None
    swarm = FloodNetwork(positions, geometry)
    head_of = dict(heads)
    ordered = _in_order(roots, dict(positions))
    floods = [Flood(swarm, swarm.nodes.row[root], swarm.way(root, head_of.get(root, root))) for root, _ in ordered]
    if not Packing(swarm, geometry, effort).place(floods):
        return None
    block = [
        Turn(offset, swarm.nodes.ids[row], root, instance)
        for flood, (root, instance) in zip(floods, ordered, strict=True)
        for offset, row in flood.sent
    ]
    turns = _repeated(block, Counter(roots), geometry.turns, blocks, whole)
    uncovered = _uncovered(swarm.nodes, ordered, floods)
    return Timetable(turns, _spans(turns), uncovered, len({turn.offset % whole for turn in turns}))


@lru_cache(maxsize=16)
def redundant_timetable(
    positions: tuple[tuple[NodeId, Enu], ...],
    measured: tuple[Link, ...],
    roots: tuple[NodeId, ...],
    geometry: Geometry,
    *,
    calls: int,
    epsilon: float,
    margin_db: float,
    pace: float = 1.0,
) -> tuple[Timetable, Odds] | None:
    """The table for lossy links, and what to expect of it; None when the turns do not suffice.

    Every node gets so many copies of each packet that it misses all of them with a probability of at most `epsilon`,
    if their senders have it; and each node has so many `calls`, turns of its own in which all its neighbors hear it.
    With a greater `margin_db` the nodes that send in the same turn are farther apart.
    """
    if not geometry.turns:
        return None
    at = dict(positions)
    network = Network(positions, geometry, measured, margin_db=margin_db)
    enough = enough_for(epsilon)
    ordered = _in_order(roots, at)
    called = _in_order([node for node, _ in positions for _ in range(calls)], at)
    waves = [Wave(network, network.nodes.row[root], enough=enough) for root, _ in ordered]
    lone = [Wave(network, network.nodes.row[node], enough=enough, call=True) for node, _ in called]
    if not RedundantPacking(network, geometry, pace=pace).place(_interleaved(waves, lone)):
        return None
    turns = tuple(
        sorted(
            Turn(offset, network.nodes.ids[row], root, instance)
            for wave, (root, instance) in zip(waves, ordered, strict=True)
            for offset, row in wave.sent
        )
    )
    own: dict[NodeId, list[int]] = {node: [] for node, _ in positions}
    for wave, (node, _) in zip(lone, called, strict=True):
        own[node].append(wave.sent[0][0])
    uncovered = _uncovered(network.nodes, ordered, waves)
    used = {turn.offset % geometry.turns for turn in turns} | {offset for at in own.values() for offset in at}
    table = Timetable(
        turns, _spans(turns), uncovered, len(used), {node: tuple(sorted(offsets)) for node, offsets in own.items()}
    )
    floods = [(root, wave.sent) for wave, (root, _) in zip(waves, ordered, strict=True)]
    return table, odds(network, floods, turns=geometry.turns, hop_turns=geometry.hop_turns)


def _uncovered(
    nodes: NodeRows, ordered: Sequence[tuple[NodeId, int]], floods: Sequence[Flood | Wave]
) -> dict[NodeId, tuple[NodeId, ...]]:
    """For each root, the nodes that none of its floods can reach."""
    return {root: nodes.of(nodes.everyone & ~flood.goal) for flood, (root, _) in zip(floods, ordered, strict=True)}


def _interleaved(floods: Sequence[Wave], calls: Sequence[Wave]) -> list[Wave]:
    """Both in their order, evenly mixed."""
    places = [
        ((index + 0.5) / len(row), kind, index, wave)
        for kind, row in enumerate((floods, calls))
        for index, wave in enumerate(row)
    ]
    return [wave for *_, wave in sorted(places, key=lambda place: place[:3])]


def _in_order(roots: Sequence[NodeId], positions: Mapping[NodeId, Enu]) -> list[tuple[NodeId, int]]:
    """(root, instance) in the order in which they let packets out: those of one root evenly spread.

    Waves that start far from each other can be in the air together: roots by turns from the near and the far side.
    """
    ordered = sorted(set(roots), key=lambda node: (positions[node].east, positions[node].north, node))
    half = (len(ordered) + 1) // 2
    near, far = ordered[:half], ordered[half:]
    mixed = [node for pair in zip(near, [*far, None], strict=False) for node in pair if node is not None]
    count = dict.fromkeys(mixed, 0)
    for root in roots:
        count[root] += 1
    entries = [
        ((instance + rank / len(mixed)) / count[node], rank, node, instance)
        for rank, node in enumerate(mixed)
        for instance in range(count[node])
    ]
    return [(node, instance) for _, _, node, instance in sorted(entries)]


def _repeated(
    block: Sequence[Turn], count: Mapping[NodeId, int], length: int, blocks: int, whole: int
) -> tuple[Turn, ...]:
    """The superframe of `whole` turns; what outlasts the last block goes on at the beginning of the next superframe."""
    rest = whole - length * blocks
    turns = [
        turn._replace(offset=turn.offset + index * length, instance=turn.instance + index * count[turn.root])
        for index in range(blocks)
        for turn in block
    ]
    return tuple(sorted(turn._replace(offset=turn.offset + turn.offset // (length * blocks) * rest) for turn in turns))


def _spans(turns: Sequence[Turn]) -> dict[NodeId, int]:
    """The longest span of each root's floods; `turns` are in order."""
    begun: dict[tuple[NodeId, int], int] = {}
    spans: dict[NodeId, int] = {}
    for turn in turns:
        first = begun.setdefault((turn.root, turn.instance), turn.offset)
        spans[turn.root] = max(spans.get(turn.root, 0), turn.offset - first + 1)
    return spans

"""A timetable of collision-free floods: which node transmits which root's packet in which turn. A pure function.

    superframe:  | contention window | turn 0 | turn 1 | ... | turn N-1 |
    flood of h:    h transmits in its root turn, then each relay once in a turn of its own, until all nodes are reached

Each frame is meant for those neighbors of its sender that lack the packet. Which nodes may share a turn:
docs/explanation/timetable.md (the protocol model of Gupta and Kumar, 2000). A node that may receive garbage does not
transmit in the next turn, because a station waits for EIFS then (IEEE 802.11-2020, 10.3.7). Not modeled: links that are
blocked by obstacles; a shorter `link_m` leaves a margin.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import NamedTuple

from fanet_mw.routing.clustered.tdma.hello_room import crowd
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds, odds
from fanet_mw.routing.clustered.timetable.interference import (
    Geometry,
    InterferenceByDistance,
    InterferenceByPower,
    NodeRows,
    rows,
)
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort, Flood, Packing
from fanet_mw.routing.clustered.timetable.redundant_scheduling import RedundantPacking, Wave, enough_for
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.links import Link

PLAIN = Effort()


class Turn(NamedTuple):
    """One transmission: `node` sends the packet number `instance` of `root` in this superframe."""

    offset: int
    """Turns from the beginning of the superframe in which the flood begins; it may lie in the next one."""
    node: NodeId
    root: NodeId
    instance: int


class SpareTurns(Mapping[NodeId, tuple[int, ...]]):
    """The turns that floods leave each node, found when somebody first asks, as most timetables are only tried."""

    def __init__(self, find: Callable[[], dict[NodeId, tuple[int, ...]]]) -> None:
        self._find = find

    @cached_property
    def _found(self) -> dict[NodeId, tuple[int, ...]]:
        return self._find()

    def __getitem__(self, node: NodeId) -> tuple[int, ...]:
        return self._found[node]

    def __iter__(self) -> Iterator[NodeId]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


class Timetable(NamedTuple):
    """All turns of a superframe."""

    turns: tuple[Turn, ...]
    spans: Mapping[NodeId, int]
    """For each root, the number of turns from its own turn until all nodes have its packet, both included."""
    uncovered: Mapping[NodeId, tuple[NodeId, ...]]
    """For each root, the nodes that it cannot reach because the swarm is separated."""
    used: int
    """The number of turns in use, of `geometry.turns`."""
    calls: Mapping[NodeId, tuple[int, ...]] = MappingProxyType({})
    """For each node, its calls: turns for its neighbors only, for a hello or a packet that one lacks."""
    hops: Mapping[NodeId, int] = MappingProxyType({})
    """For each root, the number of hops to the farthest node, if each relay passes on the first copy that it hears."""
    sure: bool = True
    """False if it uses links that errors of positions may have made."""
    spare: Mapping[NodeId, tuple[int, ...]] = MappingProxyType({})
    """For each node, the turns that floods leave it: it can transmit to its neighbors alone, and disturbs nobody."""
    near: Mapping[NodeId, frozenset[NodeId]] = MappingProxyType({})
    """For each node, its neighbors, which all hear it in these turns."""
    crowd: int = 0
    """The most nodes within two hops of one node, itself included."""

    def roots(self) -> list[Turn]:
        """The turns in which roots transmit new packets; repetitions are not among them."""
        first: dict[tuple[NodeId, int], Turn] = {}
        for turn in sorted(self.turns):
            first.setdefault((turn.root, turn.instance), turn)
        return list(first.values())

    def offsets_of(self, root: NodeId) -> list[int]:
        """The offsets of the turns in which one root transmits new packets, ascending."""
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
    """The timetable; None if there are not enough turns. `roots` has one entry per packet and block, `positions` [m]
    are in ascending order of ids; `heads`: (node, its head), to which the flood of that node goes first, on a shortest
    way. Of several `blocks`, equal parts of the superframe, one is computed; floods that outlast it continue in the
    next.
    """
    whole, geometry = geometry.turns, geometry._replace(turns=geometry.turns // blocks)
    if not geometry.turns:
        return None
    swarm = InterferenceByDistance(positions, geometry)
    head_of = dict(heads)
    ordered = _in_order(roots, dict(positions))
    floods = [Flood(swarm, swarm.nodes.row[root], swarm.way(root, head_of.get(root, root))) for root, _ in ordered]
    packing = Packing(swarm, geometry, effort)
    if not packing.place(floods):
        return None
    block = [
        Turn(offset, swarm.nodes.ids[row], root, instance)
        for flood, (root, instance) in zip(floods, ordered, strict=True)
        for offset, row in flood.sent
    ]
    turns = _repeated(block, Counter(roots), geometry.turns, blocks, whole)
    uncovered = _uncovered(swarm.nodes, ordered, floods)
    hops = _hops(swarm.nodes, swarm.hears, ordered, floods)
    used = len({turn.offset % whole for turn in turns})
    ids = swarm.nodes.ids
    starts = range(0, blocks * geometry.turns, geometry.turns)

    def spare() -> dict[NodeId, tuple[int, ...]]:
        found = enumerate(packing.spare(swarm.hears))
        return {ids[row]: tuple(start + offset for start in starts for offset in offsets) for row, offsets in found}

    near = {ids[row]: frozenset(swarm.nodes.of(heard)) for row, heard in enumerate(swarm.hears)}
    crowded = crowd({node: tuple(others) for node, others in near.items()})
    left = SpareTurns(spare)
    return Timetable(
        turns, _spans(turns), uncovered, used, hops=hops, sure=swarm.sure, spare=left, near=near, crowd=crowded
    )


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
    """The timetable for lossy links, and its odds; None if there are not enough turns. Copies of each packet suffice
    that all are lost with `epsilon` at most; each node has `calls` turns in which all neighbors receive it; a greater
    `margin_db` keeps senders of a turn farther apart.
    """
    if not geometry.turns:
        return None
    at = dict(positions)
    network = InterferenceByPower(positions, geometry, measured, margin_db=margin_db)
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
    calls_of = {node: tuple(sorted(offsets)) for node, offsets in own.items()}
    hops = _hops(network.nodes, network.hears, ordered, waves)
    table = Timetable(turns, _spans(turns), uncovered, len(used), calls_of, hops)
    floods = [(root, wave.sent) for wave, (root, _) in zip(waves, ordered, strict=True)]
    return table, odds(network, floods, turns=geometry.turns, hop_turns=geometry.hop_turns)


def _uncovered(
    nodes: NodeRows, ordered: Sequence[tuple[NodeId, int]], floods: Sequence[Flood | Wave]
) -> dict[NodeId, tuple[NodeId, ...]]:
    return {root: nodes.of(nodes.everyone & ~flood.goal) for flood, (root, _) in zip(floods, ordered, strict=True)}


def _hops(
    nodes: NodeRows, hears: Sequence[int], ordered: Sequence[tuple[NodeId, int]], floods: Sequence[Flood | Wave]
) -> dict[NodeId, int]:
    """The most hops of each root's floods; a relay counts on from the first copy that it hears."""
    found: dict[NodeId, int] = {}
    for flood, (root, _) in zip(floods, ordered, strict=True):
        start = nodes.row[root]
        hops, known = {start: 0}, 1 << start
        for _, row in flood.sent:
            for receiver in rows(hears[row] & ~known):
                hops[receiver] = hops[row] + 1
            known |= hears[row]
        found[root] = max(found.get(root, 0), *hops.values())
    return found


def _interleaved(floods: Sequence[Wave], calls: Sequence[Wave]) -> list[Wave]:
    """The floods and the calls, each in their order, evenly mixed."""
    places = [
        ((index + 0.5) / len(row), kind, index, wave)
        for kind, row in enumerate((floods, calls))
        for index, wave in enumerate(row)
    ]
    return [wave for *_, wave in sorted(places, key=lambda place: place[:3])]


def _in_order(roots: Sequence[NodeId], positions: Mapping[NodeId, Enu]) -> list[tuple[NodeId, int]]:
    """(root, instance) in the order of beginning: each root's packets evenly spread, near and far roots in turns."""
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
    """The superframe of `whole` turns, of repeated blocks; what outlasts the last continues in the next superframe."""
    period, rest = length * blocks, whole - length * blocks
    turns = []
    for index in range(blocks):
        for turn in block:
            offset = turn.offset + index * length
            instance = turn.instance + index * count[turn.root]
            turns.append(Turn(offset + offset // period * rest, turn.node, turn.root, instance))
    return tuple(sorted(turns))


def _spans(turns: Sequence[Turn]) -> dict[NodeId, int]:
    """The longest flood of each root, in turns; `turns` are in order."""
    begun: dict[tuple[NodeId, int], int] = {}
    spans: dict[NodeId, int] = {}
    for turn in turns:
        first = begun.setdefault((turn.root, turn.instance), turn.offset)
        spans[turn.root] = max(spans.get(turn.root, 0), turn.offset - first + 1)
    return spans

"""The probability that a packet with a delay bound does not reach a node because frames are lost (timetables only).

    P(reached) >= max over ways of the product of the probabilities of their frames, with those of a turn as interferers

The true probability is greater: copies on other ways count, too, and unused turns do not interfere. The bound holds for
losses that are independent from frame to frame, so neither for shadowing nor for a member's way to its head. Frames of
the contention window that extend into the turns are not included.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from fanet_mw.graph.topology import Adjacency
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.units import NodeId

Chance = Callable[[NodeId, NodeId, tuple[NodeId, ...]], float]
"""The probability that a receiver (second) gets a sender's (first) frame while other nodes (third) transmit."""

MOST: Final = 0.01
"""The greatest mean share of copies that a feasible plan may lose; over measured links as many may miss a packet."""
DELIVERS: Final = 0.999
"""A link with at least this probability for each frame counts as one that delivers."""


class Loss(NamedTuple):
    """Upper bounds of the probability that a packet does not reach a node."""

    worst: float
    root: NodeId
    node: NodeId
    """The root and the node with the greatest probability of loss."""
    mean: float
    """The mean over all roots and nodes, a bound of the share of copies that never arrive."""


def loss(table: Timetable, adjacency: Adjacency, *, per_superframe: int, hop_turns: int, chance: Chance) -> Loss:
    """The loss of the floods of a timetable over the links of `adjacency`; all others carry nothing."""
    together: dict[int, list[NodeId]] = {}
    for turn in table.turns:
        together.setdefault(turn.offset % per_superframe, []).append(turn.node)
    floods: dict[tuple[NodeId, int], list[Turn]] = {}
    for turn in sorted(table.turns):
        floods.setdefault((turn.root, turn.instance), []).append(turn)
    missed = []
    for (root, _), turns in sorted(floods.items()):
        arrivals: dict[NodeId, list[tuple[int, float]]] = {root: [(turns[0].offset - hop_turns, 1.0)]}
        for turn in turns:
            others = tuple(node for node in together[turn.offset % per_superframe] if node != turn.node)
            _send(turn, others, arrivals, adjacency, hop_turns=hop_turns, chance=chance)
        missed += [(1 - _best(arrivals.get(node, ())), root, node) for node in adjacency if node != root]
    worst, root, node = max(missed, key=lambda item: (item[0], -item[1], -item[2]))
    return Loss(worst, root, node, sum(item[0] for item in missed) / len(missed))


def problems(found: Loss, *, link_m: float, delivers_m: float | None) -> Iterator[str]:
    """A sentence if floods lose too much. `delivers_m`: up to which distance the channel delivers, if known."""
    if found.mean > MOST:
        yield (
            f"a packet misses a node with probability {found.mean:.2g} at most on average, which may be {MOST:g}: the "
            f"timetable counts on links of up to {link_m:g} m"
            + ("" if delivers_m is None else f", and this channel delivers up to {delivers_m:.0f} m")
            + ' (clusters.link_m; clusters.links = "measured" repeats frames)'
        )


def _send(
    turn: Turn,
    others: tuple[NodeId, ...],
    arrivals: dict[NodeId, list[tuple[int, float]]],
    adjacency: Adjacency,
    *,
    hop_turns: int,
    chance: Chance,
) -> None:
    """Let a relay send what it has, and note with which probability each neighbor receives it."""
    sent = _best([item for item in arrivals.get(turn.node, ()) if item[0] + hop_turns <= turn.offset])
    for node in adjacency[turn.node] if sent else ():
        arrivals.setdefault(node, []).append((turn.offset, sent * chance(turn.node, node, others)))


def _best(arrivals: Sequence[tuple[int, float]]) -> float:
    return max((probability for _, probability in arrivals), default=0.0)

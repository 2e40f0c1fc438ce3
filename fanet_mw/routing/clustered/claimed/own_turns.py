"""Which turns of the superframe belong to a node: those of its claim, and those unclaimed turns that it wins by a hash.

    period:  | contention window | turn 0 | 1 | 2 | ... | L | L+1 | ...    slot s: turns s, s + L, s + 2L, ...

For a turn that no node within two hops claims, nodes draw lots, and the highest lot wins. A lot is a hash of node, turn
and the number of the lot, so each node can compute the lots of all others; a node that has more to send draws more lots
(Bao and Garcia-Luna-Aceves, "A new approach to channel access scheduling for ad hoc networks", MobiCom 2001).

Two nodes cannot both win a turn if each knows the other and its number of lots. A node that has just stated another
number can therefore not use it at once, because nodes two hops away still count with an older one: it draws with the
least of the numbers that it has stated in its latest hellos.
"""

from collections.abc import Iterable
from typing import NamedTuple

from fanet_mw.rng import priority_hash
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import NodeId


class Share(NamedTuple):
    """The turns of a claim: number `slot` of each period, and every `length`-th turn after it."""

    slot: int
    length: int

    def has(self, turn: int) -> bool:
        return turn % self.length == self.slot


class Draws(NamedTuple):
    """Everything that decides whether a node wins an unclaimed turn."""

    node: NodeId
    lots: int
    """The number of lots that this node draws for each turn; 0 if it does not draw."""
    taken: tuple[Share, ...]
    """The claims of all other nodes within two hops."""
    rivals: tuple[tuple[NodeId, int], ...]
    """The other nodes within two hops that draw, with their numbers of lots."""

    def wins(self, turn: int, count: int) -> bool:
        """True if this node wins a turn, which is number `turn` of its period and number `count` of all periods."""
        if not self.lots or any(share.has(turn) for share in self.taken):
            return False
        best = max(priority_hash(self.node, count, number) for number in range(self.lots))
        return all(priority_hash(node, count, number) < best for node, lots in self.rivals for number in range(lots))


def draws(
    node: NodeId, lots: int, claims: Iterable[tuple[NodeId, Share | None]], rivals: Iterable[tuple[NodeId, int]]
) -> Draws:
    """Everything that decides about unclaimed turns, from the `claims` and the `rivals` of all other nodes.

    If hellos state different numbers of lots for one rival, the greatest counts: a number that is too great wastes
    turns, one that is too small would cause a collision.
    """
    most: dict[NodeId, int] = {}
    for rival, count in rivals:
        most[rival] = max(count, most.get(rival, 0))
    taken = {share for _, share in claims if share is not None}
    return Draws(node, lots, tuple(sorted(taken)), tuple((n, most[n]) for n in sorted(most) if most[n]))


class OwnTurns:
    """The turns of one node, by its present claim and draws."""

    def __init__(self, turns: Turns) -> None:
        self.turns = turns
        self.share: Share | None = None
        self.draws: Draws | None = None
        self._reserved_ns = -1
        """The start of the turn that is reserved for a hello; -1 if there is none."""

    def next_start_ns(self, *, not_before_ns: int) -> int | None:
        """The start of this node's first turn at or after an instant; None without a claim."""
        if self.share is None or self.share.slot >= self.turns.per_superframe:
            return None
        turns = self.turns
        superframe_ns = turns.superframe_start_ns(not_before_ns)
        behind_ns = not_before_ns - superframe_ns - turns.contention_ns
        turn = max(0, -(-behind_ns // turns.turn_ns))
        while True:
            if turn >= turns.per_superframe:
                superframe_ns, turn = superframe_ns + turns.period_ns, 0
            start_ns = turns.start_ns(turn, superframe_start_ns=superframe_ns)
            if start_ns != self._reserved_ns and self._is_ours(turn, superframe_ns):
                return start_ns
            turn += 1

    def _is_ours(self, turn: int, superframe_ns: int) -> bool:
        assert self.share is not None, "whoever asks holds a claim"
        if self.share.has(turn):
            return True
        if self.draws is None or not self.draws.lots:
            return False
        period = (superframe_ns - self.turns.origin_ns) // self.turns.period_ns
        return self.draws.wins(turn, period * self.turns.per_superframe + turn)

    def reserve(self, *, not_before_ns: int) -> int | None:
        """Reserve the node's next turn, which `next_start_ns` then skips; only one turn is reserved at a time."""
        self._reserved_ns = -1
        start_ns = self.next_start_ns(not_before_ns=not_before_ns)
        if start_ns is not None:
            self._reserved_ns = start_ns
        return start_ns

    def claimed(self) -> tuple[int, ...]:
        """The turns of each period that the claim gives to this node."""
        return () if self.share is None else tuple(range(self.share.slot, self.turns.per_superframe, self.share.length))

"""Which turns of the superframe are a node's own: those of its claim, and of the rest those that it wins by lot.

    period:  | contention window | turn 0 | 1 | 2 | ... | L | L+1 | ...    slot s: turns s, s + L, s + 2L, ...

A turn that no node within two hops claims goes to the node with the highest lot among those within two hops that draw
for it. Lots are hashes of node, turn and number, so every node can compute those of all others; a node that has more to
send draws more lots. After Bao and Garcia-Luna-Aceves, "A new approach to channel access scheduling for ad hoc
networks" (MobiCom 2001). Of two nodes that know each other and each other's number of lots only one can win. A node
therefore draws with the least number that it has stated in its last hellos; until nodes two hops away know of a change,
it draws less often than they believe.
"""

from collections.abc import Iterable
from typing import NamedTuple

from fanet_mw.rng import priority_hash
from fanet_mw.routing.clustered.tdma.turns import Turns
from fanet_mw.units import NodeId


class Share(NamedTuple):
    """A claim as turns: `slot`, and every `length`-th turn after it in the same period."""

    slot: int
    length: int

    def has(self, turn: int) -> bool:
        return turn % self.length == self.slot


class Draws(NamedTuple):
    """All that decides whether a node wins a turn that no node claims."""

    node: NodeId
    lots: int
    """The number of lots that this node draws per turn; 0 when it draws none."""
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
    """`claims` and `rivals` are those of all other nodes. A rival has the greatest number of lots stated for it.

    A number that is believed too great costs turns; one that is believed too small costs a collision.
    """
    most: dict[NodeId, int] = {}
    for rival, count in rivals:
        most[rival] = max(count, most.get(rival, 0))
    taken = {share for _, share in claims if share is not None}
    return Draws(node, lots, tuple(sorted(taken)), tuple((n, most[n]) for n in sorted(most) if most[n]))


class OwnTurns:
    """One node's own turns, as far as they are known now."""

    def __init__(self, turns: Turns) -> None:
        self.turns = turns
        self.share: Share | None = None
        self.draws: Draws | None = None
        self._reserved_ns = -1
        """The start of a turn that is already taken for a hello; -1 when there is none."""

    def next_start_ns(self, *, not_before_ns: int) -> int | None:
        """The start of this node's first own turn at or after an instant; None without a claim."""
        if self.share is None or self.share.slot >= self.turns.per_frame:
            return None
        turns = self.turns
        frame_ns = turns.frame_start_ns(not_before_ns)
        behind_ns = not_before_ns - frame_ns - turns.contention_ns
        turn = max(0, -(-behind_ns // turns.turn_ns))
        while True:
            if turn >= turns.per_frame:
                frame_ns, turn = frame_ns + turns.period_ns, 0
            start_ns = turns.start_ns(turn, frame_start_ns=frame_ns)
            if start_ns != self._reserved_ns and self._is_ours(turn, frame_ns):
                return start_ns
            turn += 1

    def _is_ours(self, turn: int, frame_ns: int) -> bool:
        assert self.share is not None, "whoever asks holds a claim"
        if self.share.has(turn):
            return True
        if self.draws is None or not self.draws.lots:
            return False
        period = (frame_ns - self.turns.origin_ns) // self.turns.period_ns
        return self.draws.wins(turn, period * self.turns.per_frame + turn)

    def reserve(self, *, not_before_ns: int) -> int | None:
        """Take the next own turn out of what `next_start_ns` returns; only one turn is taken at a time."""
        self._reserved_ns = -1
        start_ns = self.next_start_ns(not_before_ns=not_before_ns)
        if start_ns is not None:
            self._reserved_ns = start_ns
        return start_ns

    def claimed(self) -> tuple[int, ...]:
        """The turns of each period that the claim gives to this node."""
        return () if self.share is None else tuple(range(self.share.slot, self.turns.per_frame, self.share.length))

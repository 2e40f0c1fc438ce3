"""Which turns of the superframe are a node's own: those of its claim, and of the rest those that it wins by lot.

    period:  | contention window | turn 0 | 1 | 2 | ... | L | L+1 | ...    slot s: turns s, s + L, s + 2L, ...

A turn that nobody within two hops claims goes to the node with the highest lot among all within two hops that draw for
it. Lots are hashes of node, turn and number, so every node knows everyone's; who has more to send draws more often.
After Bao and Garcia-Luna-Aceves, "A new approach to channel access scheduling for ad hoc networks" (MobiCom 2001).
Of two nodes that know each other and each other's lots only one can win. A node therefore draws with the least number
that it has said in its last hellos; until two hops know of a change, it draws less often than the others believe.
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
    """All that decides about turns nobody claims."""

    node: NodeId
    lots: int
    """Of ours; 0: we do not draw."""
    taken: tuple[Share, ...]
    """The claims of all within two hops, but ours."""
    rivals: tuple[tuple[NodeId, int], ...]
    """Everyone else within two hops, and how many lots they have."""

    def wins(self, turn: int, count: int) -> bool:
        """`turn` within its period, `count` from the swarm's beginning."""
        if not self.lots or any(share.has(turn) for share in self.taken):
            return False
        best = max(priority_hash(self.node, count, number) for number in range(self.lots))
        return all(priority_hash(node, count, number) < best for node, lots in self.rivals for number in range(lots))


def draws(
    node: NodeId, lots: int, claims: Iterable[tuple[NodeId, Share | None]], rivals: Iterable[tuple[NodeId, int]]
) -> Draws:
    """`claims` and `rivals` of all but the node itself. Each rival has the most lots that anyone says it has.

    To believe that it has too many costs turns, too few a collision.
    """
    most: dict[NodeId, int] = {}
    for rival, count in rivals:
        most[rival] = max(count, most.get(rival, 0))
    taken = {share for _, share in claims if share is not None}
    return Draws(node, lots, tuple(sorted(taken)), tuple((n, most[n]) for n in sorted(most) if most[n]))


class OwnTurns:
    """One node's turns, as far as it knows now."""

    def __init__(self, turns: Turns) -> None:
        self.turns = turns
        self.share: Share | None = None
        self.draws: Draws | None = None
        self._reserved_ns = -1
        """A turn that is used already, for a hello."""

    def next_start_ns(self, *, not_before_ns: int) -> int | None:
        """The first turn of ours that starts at or after an instant; None without a claim."""
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
        """Take the next turn of ours out of what `next_start_ns` gives; one at a time."""
        self._reserved_ns = -1
        start_ns = self.next_start_ns(not_before_ns=not_before_ns)
        if start_ns is not None:
            self._reserved_ns = start_ns
        return start_ns

    def claimed(self) -> tuple[int, ...]:
        """The turns of each period that our claim gives us."""
        return () if self.share is None else tuple(range(self.share.slot, self.turns.per_frame, self.share.length))

"""Whom a node obeys: one leader, as long as its announcements keep coming; and when the node itself must stand.

Authorities are ordered: the lower term (the swarm second in which the leader took office) prevails, then the lower id.
So when two parts of a swarm meet, the leader longest in office stays, whichever part is larger; a node that was cut
off for a while and elected itself never deposes the leader of all others; and one that starts again is junior.

    announced -> ... silent for `silence_ns` -> the lowest live id stands at once, others up to 3 s later -> call
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.roles.signs_of_life import Signs
from fanet_mw.units import NodeId, S

_PERIODS: Final = 4
_LEAST_NS: Final = 4 * S
_FIRST_NS: Final = 8 * S
"""At its start a node waits this long for a leader: joins take 3 s, their assignment another 2 s."""
_TURN_NS: Final = 1 * S
"""How long the next one waits for a node with a lower id to stand."""
_TURNS: Final = 3
_FOREVER_NS: Final = 1 << 62


def silence_ns(period_ns: int) -> int:
    """A leader is given up when its newest announcement is this old: four superframes, at least 4 s."""
    return max(_PERIODS * period_ns, _LEAST_NS)


class Authority(NamedTuple):
    """A leader in office; the lesser prevails, as tuples are compared."""

    term: int
    leader: int


class Lease:
    """One node's obedience."""

    def __init__(self, node: NodeId, *, period_ns: int, signs: Signs) -> None:
        self._node = node
        self._silence_ns = silence_ns(period_ns)
        self._signs = signs
        self.authority: Authority | None = None
        self._until_ns = 0
        self._stand_ns = 0

    def start(self, now_ns: int) -> None:
        """Nobody has been heard yet."""
        self._until_ns = self._stand_ns = now_ns + _FIRST_NS + self._silence_ns

    @property
    def leads(self) -> bool:
        """Whether the node obeys itself: it is the leader."""
        return self.authority is not None and self.authority.leader == self._node

    def valid(self, now_ns: int) -> bool:
        """Whether the leader has been heard of lately."""
        return self.authority is not None and now_ns <= self._until_ns

    def fresh(self, now_ns: int) -> bool:
        """Whether it was heard of so lately that nobody need worry: who cannot say so asks its neighbors, in time."""
        return self.authority is not None and now_ns <= self._until_ns - self._silence_ns // 2

    def accept(self, authority: Authority, *, born_ns: int, now_ns: int) -> bool:
        """Whether to obey an announcement that was made at `born_ns`; if so, its authority holds from now on."""
        until_ns = born_ns + self._silence_ns
        if until_ns < now_ns:
            return False  # old news of one who may be dead
        if self.authority is not None and authority > self.authority and self.valid(now_ns):
            return False
        self._until_ns = max(until_ns, self._until_ns if authority == self.authority else 0)
        self._stand_ns = self._until_ns
        self.authority = authority
        return True

    def take_office(self, now_ns: int) -> Authority:
        """We lead from now on."""
        self.authority = Authority(now_ns // S, self._node)
        self._until_ns = _FOREVER_NS
        return self.authority

    def next_wake_ns(self) -> int:
        return self._stand_ns

    def must_stand(self, now_ns: int) -> bool:
        """Whether nobody else will: the leader is silent, and no node with a lower id has stood in its turn."""
        if now_ns < self._stand_ns:
            return False
        lower = self._signs.alive_below(self._node, since_ns=now_ns - self._silence_ns)
        self._stand_ns = self._until_ns + min(lower, _TURNS) * _TURN_NS
        return now_ns >= self._stand_ns

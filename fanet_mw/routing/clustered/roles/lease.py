"""Which leader a node follows as long as its announcements keep coming, and when the node itself takes office.

Authorities are ordered: the lower term (the swarm second in which the leader took office) prevails, then the lower id.
So when two parts of a swarm meet, the leader longest in office stays, whichever part is larger; a node that was cut
off for a while and elected itself never deposes the leader of all others; and a restarted node is junior.

    announced -> ... silent for `silence_ns` -> the lowest live id takes office at once, others up to 3 s later -> call
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.roles.liveness import Liveness
from fanet_mw.units import NodeId, S

_PERIODS: Final = 4
_LEAST_NS: Final = 4 * S
_FIRST_NS: Final = 8 * S
"""A node waits for a leader so long at its start: joins take 3 s, and their assignment another 2 s."""
_TURN_NS: Final = 1 * S
"""A node waits so long for each node with a lower id to take office first."""
_TURNS: Final = 3
_FOREVER_NS: Final = 1 << 62


def silence_ns(period_ns: int) -> int:
    """The age of the newest announcement at which a leader is given up: four superframes, at least 4 s."""
    return max(_PERIODS * period_ns, _LEAST_NS)


class Authority(NamedTuple):
    """A leader in office; of two authorities the lesser prevails, compared as tuples."""

    term: int
    leader: int


class Lease:
    """One node's allegiance to a leader."""

    def __init__(self, node: NodeId, *, period_ns: int, liveness: Liveness) -> None:
        self._node = node
        self._silence_ns = silence_ns(period_ns)
        self._liveness = liveness
        self.authority: Authority | None = None
        self._until_ns = 0
        self.stand_ns = 0
        """The instant at which the node is to check whether it must take office."""

    def start(self, now_ns: int) -> None:
        """Begin to wait for a leader, because none has been heard yet."""
        self._until_ns = self.stand_ns = now_ns + _FIRST_NS + self._silence_ns

    @property
    def leads(self) -> bool:
        """True if this node is the leader itself."""
        return self.authority is not None and self.authority.leader == self._node

    def valid(self, now_ns: int) -> bool:
        """True while the leader's newest announcement is not older than the silence limit."""
        return self.authority is not None and now_ns <= self._until_ns

    def fresh(self, now_ns: int) -> bool:
        """True while the newest announcement is younger than half the silence limit. A node for which this is False
        asks its neighbors, so that one lost announcement does not let the limit pass.
        """
        return self.authority is not None and now_ns <= self._until_ns - self._silence_ns // 2

    def accept(self, authority: Authority, *, born_ns: int, now_ns: int) -> bool:
        """Consider an announcement made at `born_ns`; True if it is accepted, and its authority holds from now on."""
        until_ns = born_ns + self._silence_ns
        if until_ns < now_ns:
            return False  # the announcement is so old that its leader may be dead
        if self.authority is not None and authority > self.authority and self.valid(now_ns):
            return False
        self._until_ns = max(until_ns, self._until_ns if authority == self.authority else 0)
        self.stand_ns = self._until_ns
        self.authority = authority
        return True

    def take_office(self, now_ns: int) -> Authority:
        """Become the leader from now on."""
        self.authority = Authority(now_ns // S, self._node)
        self._until_ns = _FOREVER_NS
        return self.authority

    def review(self, now_ns: int) -> bool:
        """Put the own turn to stand off for the nodes with lower ids that are alive; True if it has come: the leader is
        silent, and none of them has taken office in time.
        """
        if now_ns < self.stand_ns:
            return False
        lower = self._liveness.alive_below(self._node, since_ns=now_ns - self._silence_ns)
        self.stand_ns = self._until_ns + min(lower, _TURNS) * _TURN_NS
        return now_ns >= self.stand_ns

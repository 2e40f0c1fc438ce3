"""Leader election: a node follows a leader as long as its announcements keep coming (its lease), and else elects one.

    a leader announces itself -> it is silent for `silence_ns` -> of the nodes that are alive the one with the lowest id
    takes office at once, others up to 3 s later if it does not -> the new leader calls all nodes to join

The leader with the lower term prevails, the second of swarm time in which it took office; of equal terms the lower id.
So a node that elected itself while it was cut off never deposes the leader of all others, and a restarted leader is the
junior one.
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.units import NodeId, S

_PERIODS: Final = 4
"""The number of flooding periods without an announcement after which a leader is given up."""
_LEAST_NS: Final = 4 * S
"""The least time without an announcement after which a leader is given up."""
_FIRST_NS: Final = 8 * S
"""The time for which a node waits for a leader after its start: joins take 3 s, and the assignment another 2 s."""
_TURN_NS: Final = 1 * S
"""The time for which a node lets each live node with a lower id take office first."""
_TURNS: Final = 3
"""The greatest number of nodes that are let take office first."""
_FOREVER_NS: Final = 1 << 62
"""The end of a leader's own lease, which never comes."""


def silence_ns(period_ns: int) -> int:
    return max(_PERIODS * period_ns, _LEAST_NS)


class Authority(NamedTuple):
    """A leader in office. Authorities are compared as tuples, and the lesser prevails."""

    term: int
    leader: int


class Lease:
    """The leader that one node follows."""

    def __init__(self, node: NodeId, *, period_ns: int, liveness: Liveness) -> None:
        self._node = node
        self._silence_ns = silence_ns(period_ns)
        self._liveness = liveness
        self.authority: Authority | None = None
        self._until_ns = 0
        """The end of the lease, unless another announcement arrives."""
        self.stand_ns = 0

    def start(self, now_ns: int) -> None:
        self._until_ns = self.stand_ns = now_ns + _FIRST_NS + self._silence_ns

    @property
    def leads(self) -> bool:
        return self.authority is not None and self.authority.leader == self._node

    def valid(self, now_ns: int) -> bool:
        return self.authority is not None and now_ns <= self._until_ns

    def fresh(self, now_ns: int) -> bool:
        """True within half the silence limit; otherwise the node asks its neighbors for a newer announcement."""
        return self.authority is not None and now_ns <= self._until_ns - self._silence_ns // 2

    def accept(self, authority: Authority, *, born_ns: int, now_ns: int) -> bool:
        """Consider an announcement made at `born_ns`; returns True if the node follows that leader from now on."""
        until_ns = born_ns + self._silence_ns
        if until_ns < now_ns:
            return False  # the announcement is so old that its leader may have failed
        if self.authority is not None and authority > self.authority and self.valid(now_ns):
            return False
        self._until_ns = max(until_ns, self._until_ns if authority == self.authority else 0)
        self.stand_ns = self._until_ns
        self.authority = authority
        return True

    def take_office(self, now_ns: int) -> Authority:
        self.authority = Authority(now_ns // S, self._node)
        self._until_ns = _FOREVER_NS
        return self.authority

    def review(self, now_ns: int) -> bool:
        """True if this node must take office: the leader is silent, and no live node with a lower id came first."""
        if now_ns < self.stand_ns:
            return False
        lower = self._liveness.alive_below(self._node, since_ns=now_ns - self._silence_ns)
        self.stand_ns = self._until_ns + min(lower, _TURNS) * _TURN_NS
        return now_ns >= self.stand_ns

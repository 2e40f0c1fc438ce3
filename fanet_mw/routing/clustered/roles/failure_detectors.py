"""Signs of life, and what their absence says of a cluster head, of a neighbor, and of this node itself.

Four hello intervals without one are silence; each further member of the succession waits half an interval longer for
the one before it to stand in. Members without news of the head do not judge it. What a deaf node sends is no sign of
life and no objection, or one that goes on sending would be planned with for ever (docs/explanation/roles.md).
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.units import NodeId, S


class Liveness:
    """The latest sign of life of each node."""

    def __init__(self) -> None:
        self._born_ns: dict[int, int] = {}

    def on_sign_of_life(self, node: int, *, born_ns: int) -> None:
        if born_ns > self._born_ns.get(node, -1):
            self._born_ns[node] = born_ns

    def last_ns(self, node: int) -> int | None:
        """The instant at which a node generated its newest packet received here; None if none was received."""
        return self._born_ns.get(node)

    def alive_below(self, node: int, *, since_ns: int) -> int:
        """The number of nodes with a lower id that have generated a packet since `since_ns`."""
        return sum(1 for other, born_ns in self._born_ns.items() if other < node and born_ns >= since_ns)

    def forget(self, node: NodeId) -> None:
        self._born_ns.pop(node, None)


SILENT_HELLOS: Final = 4.0
"""The number of hello intervals after which a head is silent; with a timetable, any neighbor."""
_GIVEN_UP_HELLOS: Final = 2.0
"""The same for a head that the MAC has failed to reach."""
_TURN_HELLOS: Final = 0.5
"""The number of hello intervals that each member of the succession leaves to the one before it."""


class HeadFailureDetector:
    """Tells one member from when on its head is silent."""

    def __init__(self, gradient: Gradient, liveness: Liveness, *, hello_ns: int) -> None:
        self._gradient = gradient
        self._liveness = liveness
        self._hello_ns = hello_ns
        self._unreachable_ns = -1

    def on_unreachable(self, now_ns: int) -> None:
        self._unreachable_ns = now_ns

    def silent_from_ns(self, head: NodeId, *, since_ns: int, before: int) -> int | None:
        """When the head is silent to a member with `before` members ahead of it; None without news since `since_ns`."""
        news_ns = self._gradient.news_ns(head)
        if news_ns is None or news_ns < since_ns:
            return None
        sign_ns = max(news_ns, self._liveness.last_ns(head) or 0)
        hellos = _GIVEN_UP_HELLOS if self._unreachable_ns > sign_ns else SILENT_HELLOS
        return sign_ns + int((hellos + before * _TURN_HELLOS) * self._hello_ns)


_AGAIN_NS: Final = 10 * S
"""A neighbor that is still in the schedule after this time is reported again, because the report may have been lost."""
_LEAST_NS: Final = 5 * S
"""The shortest time between two reports of a node, because each is a flood."""
_FORGOTTEN_NS: Final = 60 * S


class NeighborFailureDetector:
    """Watches the neighbors of one node."""

    def __init__(self, liveness: Liveness, *, hello_ns: int) -> None:
        self._liveness = liveness
        self._silent_ns = int(SILENT_HELLOS * hello_ns)
        self._heard_ns: dict[NodeId, int] = {}
        self._reported_ns: dict[NodeId, int] = {}
        self._deaf: set[NodeId] = set()
        """The neighbors whose latest hello stated that they hear nobody."""
        self._next_ns = 0
        """The instant from which the node may report again."""

    def on_hello(self, node: NodeId, *, now_ns: int) -> None:
        self._heard_ns[node] = now_ns
        self._reported_ns.pop(node, None)
        self._deaf.discard(node)

    def on_deaf(self, node: NodeId, *, now_ns: int) -> None:
        """A hello of a node was heard that hears nobody."""
        self._heard_ns.setdefault(node, now_ns)
        self._deaf.add(node)

    def on_report(self, node: NodeId, *, now_ns: int) -> None:
        """Some node, perhaps this one, has reported a node to the leader as silent."""
        if node in self._heard_ns:
            self._reported_ns[node] = now_ns

    def _hears_nobody(self, now_ns: int) -> bool:
        """True if all of several neighbors are silent."""
        return len(self._heard_ns) > 1 and all(
            now_ns - max(heard_ns, self._liveness.last_ns(node) or 0) >= self._silent_ns
            for node, heard_ns in self._heard_ns.items()
        )

    def find_suspect(self, lists: Callable[[NodeId], bool], *, now_ns: int) -> NodeId | None:
        """The neighbor to report now, of several the one not reported for longest, or None. `lists` tells whether the
        schedule names a node; neighbors that no longer count are forgotten.
        """
        if self._hears_nobody(now_ns):
            return None
        for node in sorted(self._heard_ns, key=lambda node: (self._reported_ns.get(node, 0), node)):
            quiet_ns, deaf = now_ns - self._heard_ns[node], node in self._deaf
            if quiet_ns < self._silent_ns and not deaf:
                continue
            sign_ns, reported_ns = self._liveness.last_ns(node) or 0, self._reported_ns.get(node)
            objected = reported_ns is not None and sign_ns > reported_ns
            if objected or quiet_ns > _FORGOTTEN_NS or not lists(node):
                del self._heard_ns[node]
                self._reported_ns.pop(node, None)
                self._deaf.discard(node)
            elif (deaf or now_ns - sign_ns >= self._silent_ns) and (
                reported_ns is None or now_ns - reported_ns >= _AGAIN_NS
            ):
                if now_ns < self._next_ns:
                    return None
                self._next_ns = now_ns + _LEAST_NS
                return node
        return None


class Deafness:
    """Whether one node hears anybody."""

    def __init__(self, port: Port, *, hello_ns: int) -> None:
        self._port = port
        self._silent_ns = int(SILENT_HELLOS * hello_ns)
        self._heard_ns = 0

    def on_frame(self, now_ns: int) -> None:
        self._heard_ns = now_ns
        self._port.deaf = False

    def review(self, now_ns: int) -> None:
        """A hello is due."""
        self._port.deaf = now_ns - self._heard_ns >= self._silent_ns

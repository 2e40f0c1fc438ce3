"""The join of a node: a flood that tells where the node is, and asks the leader for a place.

no place yet                     at a random instant, and again until a schedule names the node
farther from where it was told   with the next hello, a little spread (`position_updates.py`)
a link has changed               the same, where links are measured: joins carry them
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.motion import Motion
from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates
from fanet_mw.routing.clustered.timetable.link_quality import LinkQuality
from fanet_mw.units import MS, S
from fanet_mw.wire.inner import Join
from fanet_mw.wire.links import Links

_FIRST_NS: Final = 500 * MS
_WINDOW_NS: Final = 3 * S
"""Joins are floods: spread, so that a swarm that starts together does not drown in them."""
_REJOIN_NS: Final = 2 * S
_UPDATE_NS: Final = 100 * MS
"""Joins that only tell a new position are spread over this much per node: ten floods a second when all turn at once."""


class Joining:
    """The joins of one node."""

    def __init__(
        self, port: Port, updates: PositionUpdates, links: LinkQuality | None, random: Callable[[], float]
    ) -> None:
        self._port = port
        self._updates = updates
        self._links = links
        self._random = random
        self.due_ns: int | None = None
        """The instant at which the node joins next; None: it has no reason to."""

    def start(self, now_ns: int) -> None:
        """Begin: the node is up and belongs to no cluster."""
        self.due_ns = now_ns + _FIRST_NS + int(self._random() * _WINDOW_NS)

    def ask_for_a_place(self, now_ns: int) -> None:
        """The node has lost its place, or follows another leader: it joins soon, if it was not about to."""
        if self.due_ns is None:
            self.due_ns = now_ns + int(self._random() * _WINDOW_NS)

    def rest(self) -> None:
        """The node has a place, or leads."""
        self.due_ns = None

    def on_flooding(self, due_ns: int) -> None:
        """A packet of the node goes to everyone: a sign of life."""
        self._updates.on_flooding(due_ns)

    def may_update(self, now_ns: int) -> bool:
        """True if the last join is long enough ago for another."""
        return self._updates.may_update(now_ns)

    def update_if_outdated(self, *, listed: int, now_ns: int) -> None:
        """Join soon if the leader must be told something new; `listed` nodes may all have to at the same time."""
        if self.due_ns is None and (
            self._updates.outdated(self._port.position, now_ns=now_ns)
            or (self._links is not None and self._updates.may_update(now_ns) and self._links.outdated(now_ns=now_ns))
        ):
            self.due_ns = now_ns + int(self._random() * _UPDATE_NS * (1 + listed))

    def join(self, *, instead_of: int, again: bool, now_ns: int) -> bytes:
        """The inner frames of a join that goes now; `again`: another follows if no schedule names the node."""
        self.due_ns = now_ns + _REJOIN_NS + int(self._random() * _WINDOW_NS) if again else None
        motion = self.motion(now_ns)
        self._updates.on_update(motion)
        node = self._port.node
        inner = Join(node, motion.position, motion.velocity, instead_of).encode_frame(node)
        links = self._links.tell(now_ns=now_ns) if self._links is not None else ()
        return inner + Links(node, links).encode_frames() if links else inner

    def motion(self, now_ns: int) -> Motion:
        """The present motion of the node."""
        return Motion(self._port.position, self._port.velocity, now_ns)

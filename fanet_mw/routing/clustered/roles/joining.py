"""Decides when a node joins: it floods a packet that states where it is, and asks the leader for a place. It does so
until a schedule names it, and again when it is not where the leader believes (`position_updates.py`), or when a
measured link has changed; also to report a silent node, or to object to such a report (`failover.py`).
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.motion import Motion
from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.links.link_quality import LinkQuality
from fanet_mw.routing.clustered.roles.position_updates import UPDATE_NS, PositionUpdates
from fanet_mw.units import MS, S
from fanet_mw.wire.links import Links
from fanet_mw.wire.schedule import Join

_FIRST_NS: Final = 500 * MS
"""The least time between the start of a node and its first join."""
_WINDOW_NS: Final = 3 * S
"""Joins are spread over this time at random: all nodes may start together, and each join is a flood."""
_REJOIN_NS: Final = 2 * S
"""The least time between two joins of a node that has no place."""


class Joining:
    """Decides when one node joins, and makes the join."""

    def __init__(
        self, port: Port, updates: PositionUpdates, links: LinkQuality | None, random: Callable[[], float]
    ) -> None:
        self._port = port
        self._updates = updates
        self._links = links
        self._random = random
        self._has_told_links = False
        self._links_are_announced = False
        """True if the leader has announced measured links, which it does when it knows the links of most nodes."""
        self.due_ns: int | None = None

    def start(self, now_ns: int) -> None:
        self.due_ns = now_ns + _FIRST_NS + int(self._random() * _WINDOW_NS)

    def ask_for_a_place(self, now_ns: int) -> None:
        """The node has lost its place, or follows another leader: it will join soon."""
        self._links_are_announced = False
        if self.due_ns is None:
            self.due_ns = now_ns + int(self._random() * _WINDOW_NS)

    def on_links_announced(self) -> None:
        self._links_are_announced = True

    def rest(self) -> None:
        self.due_ns = None

    def on_flooding(self, due_ns: int) -> None:
        """A packet of this node will be flooded to all, which is a sign of life."""
        self._updates.on_flooding(due_ns)

    def update_if_outdated(self, *, listed: int, now_ns: int) -> None:
        """Plan a join if the leader must be told something new; `listed` nodes may have to at the same time."""
        if self.due_ns is None and (
            self._updates.outdated(self._port.position, now_ns=now_ns)
            or (self._links is not None and self._must_tell(self._links, now_ns))
        ):
            self.due_ns = now_ns + int(self._random() * UPDATE_NS * (1 + listed))

    def _must_tell(self, links: LinkQuality, now_ns: int) -> bool:
        """True if the leader has no links of this node, or outdated ones."""
        if not self._has_told_links:
            return links.has_estimate(now_ns=now_ns)  # even if the node has just joined without them
        return self._updates.may_update(now_ns) and (not self._links_are_announced or links.outdated(now_ns=now_ns))

    def join(self, *, instead_of: int, again: bool, now_ns: int) -> bytes:
        """The inner frames of a join sent now; `again`: another one follows if no schedule names the node."""
        self.due_ns = now_ns + _REJOIN_NS + int(self._random() * _WINDOW_NS) if again else None
        motion = self.motion(now_ns)
        self._updates.on_update(motion)
        node = self._port.node
        inner = Join(node, motion.position, motion.velocity, instead_of).encode_frame(node)
        links = self._links.tell(now_ns=now_ns) if self._links is not None else ()
        self._has_told_links = self._has_told_links or bool(links)
        return inner + Links(node, links).encode_frames() if links else inner

    def motion(self, now_ns: int) -> Motion:
        return Motion(self._port.position, self._port.velocity, now_ns)

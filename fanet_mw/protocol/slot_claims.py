"""Slots with spatial reuse, agreed over the air: each node claims the lowest slot free within its two hops.

                    listened long enough          a stronger rival claims it too
    LISTENING  ------------------------->  HOLDS  ---------------------------->  HOLDS another
                                             ^            (none free: SILENT)

A hello carries the sender's claim and those of the neighbors it hears, so each node knows the claims within two hops
one or two superframes later. Of two that claim one slot, the stronger keeps it: lower priority value, then lower id.
A joiner listens before it claims; one who leaves is forgotten when its hellos stop.

Without losses all claims are free of clashes within `listen + 2 d + 1` superframes after the topology last changed,
where d is the longest chain of ever weaker rivals, two hops apart at most: the strongest of each chain never yields,
its claim is known at two hops after two superframes, and its rivals then yield once. Links must work both ways.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.protocol.coloring import lowest_free
from fanet_mw.units import NodeId


class Claim(NamedTuple):
    """Who says it owns which slot; None while it listens or found none free."""

    node: NodeId
    slot: int | None
    priority: int = 0
    """Lower is stronger."""

    def beats(self, other: "Claim") -> bool:
        return (self.priority, self.node) < (other.priority, other.node)


class Hello(NamedTuple):
    """What a node says about slots once per superframe."""

    own: Claim
    heard: tuple[Claim, ...]
    """The claims of its neighbors, by id."""


class SlotClaims:
    """One node's part: hellos and instants go in, hellos come out."""

    def __init__(
        self,
        node: NodeId,
        *,
        now_ns: int,
        listen_ns: int,
        lifetime_ns: int,
        slots: int | None = None,
        priority: int = 0,
    ) -> None:
        if slots is not None and slots < 1:
            raise LocalProtocolError(f"slots = {slots} must be >= 1, or None for no limit")
        self._listen_until_ns = now_ns + listen_ns
        self._lifetime_ns = lifetime_ns
        self._slots = slots
        self._own = Claim(node, None, priority)
        self._hellos: dict[NodeId, tuple[int, Hello]] = {}
        self.repairs = 0
        """How often a slot was given up to a stronger rival."""

    @property
    def slot(self) -> int | None:
        return self._own.slot

    def hear(self, hello: Hello, *, now_ns: int) -> None:
        """A neighbor's hello. Claims of slots that cannot be are ignored: they come off the air."""
        if hello.own.node != self._own.node and all(c.slot is None or c.slot >= 0 for c in (hello.own, *hello.heard)):
            self._hellos[hello.own.node] = now_ns, hello

    def step(self, now_ns: int) -> Hello:
        """Once per superframe: forget the silent, settle clashes, and say so."""
        horizon_ns = now_ns - self._lifetime_ns
        self._hellos = {node: entry for node, entry in self._hellos.items() if entry[0] >= horizon_ns}
        if self._own.slot is None:
            if now_ns >= self._listen_until_ns:
                self._own = self._own._replace(slot=self._free())
        elif any(rival.beats(self._own) for rival in self._rivals() if rival.slot == self._own.slot):
            self.repairs += 1
            self._own = self._own._replace(slot=self._free())
        return Hello(self._own, tuple(self._hellos[node][1].own for node in sorted(self._hellos)))

    def _free(self) -> int | None:
        slot = lowest_free(rival.slot for rival in self._rivals() if rival.slot is not None)
        return slot if self._slots is None or slot < self._slots else None

    def _rivals(self) -> Iterator[Claim]:
        """Claims within two hops. What a neighbor says of itself is newer than what others say of it."""
        for node in sorted(self._hellos):
            hello = self._hellos[node][1]
            yield hello.own
            for claim in hello.heard:
                if claim.node != self._own.node and claim.node not in self._hellos:
                    yield claim

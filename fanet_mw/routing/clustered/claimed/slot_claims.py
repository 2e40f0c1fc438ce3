"""Distributed TDMA slot assignment with spatial reuse: each node claims the lowest slot that is free within two hops.

                    listened long enough          a stronger rival claims the same slot
    LISTENING  ------------------------->  HOLDS  ---------------------------->  HOLDS another
                                             ^            (SILENT if none is free)

A hello carries the sender's claim and the claims of its neighbors, so each node knows all claims within two hops after
one or two superframes. If two nodes claim the same slot, the stronger keeps it: the one with the lower priority value,
or with the lower id if these are equal. A node that joins listens before it claims. A node that leaves is forgotten
after its last hello.

Without losses, and with links that work both ways, no two claims clash any more `listen + 2 d + 1` superframes after
the last change of the topology. Here d is the length of the longest chain of nodes, each weaker than the one before and
within two hops of it: the strongest node of a chain never yields, its claim is known at two hops after two
superframes, and its rivals then yield once.

**Superframes of variable length** (`sized_to`; after Kanzaki et al., "Dynamic TDMA slot assignment in ad hoc networks",
AINA 2003). The crowd of a node is the number of nodes within two hops of it, itself included. A node's slot repeats
every `length` turns, where length is a power of two and at least the crowd of each node within two hops. Lengths may
differ between nodes: slot a of one node and slot b of another meet if a = b modulo the shorter length. A free slot
always exists, because each of n rivals takes 1/length <= 1/(n+1) of the turns, together less than all. It takes two
superframes until a crowd is known, so the time above grows by four superframes. A node that lengthens its superframe
keeps a part of its turns, so it clashes with nobody. It shortens its superframe only after this was possible for a
while.
"""

from collections.abc import Iterable, Iterator
from itertools import count
from math import gcd
from typing import Final, NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import NodeId

_PATIENCE: Final = 8
"""The number of superframes for which a shorter one must have been possible before a node shortens its own: a neighbor
may only seem to have left because its hellos were lost."""


class SlotClaim(NamedTuple):
    """The slot that a node claims; None while it listens, or if it has found no free slot."""

    node: NodeId
    slot: int | None
    priority: int = 0
    """Of two claims, the one with the lower value is stronger."""
    length: int = 0
    """The slot repeats after this number of turns; 0 if all superframes have the same, fixed length."""
    crowd: int = 1
    """The number of nodes within two hops of the claimant, itself included."""

    def meets(self, other: "SlotClaim") -> bool:
        """True if both nodes would transmit in the same turn."""
        if self.slot is None or other.slot is None:
            return False
        step = gcd(self.length, other.length)
        return (self.slot - other.slot) % step == 0 if step else self.slot == other.slot

    def beats(self, other: "SlotClaim") -> bool:
        return (self.priority, self.node) < (other.priority, other.node)


class SlotHello(NamedTuple):
    """The statement about slots that a node sends once per superframe."""

    own: SlotClaim
    heard: tuple[SlotClaim, ...]
    """The claims of the node's neighbors, in the order of their ids."""


class SlotClaims:
    """The algorithm at one node: it takes in the hellos of neighbors, and gives the node's own once per superframe."""

    def __init__(
        self,
        node: NodeId,
        *,
        now_ns: int,
        listen_ns: int,
        lifetime_ns: int,
        slots: int | None = None,
        sized_to: int | None = None,
        priority: int = 0,
    ) -> None:
        """`slots`: the number of slots, if superframes have a fixed length. `sized_to`: the greatest length of
        superframes whose length varies, a power of two. At most one of them is given.
        """
        if slots is not None and slots < 1:
            raise LocalProtocolError(f"slots = {slots} must be >= 1, or None for no limit")
        if sized_to is not None and (sized_to < 1 or sized_to & (sized_to - 1) or slots is not None):
            raise LocalProtocolError(f"sized_to = {sized_to} must be a power of two, and slots = {slots} None")
        self._listen_until_ns = now_ns + listen_ns
        self._lifetime_ns = lifetime_ns
        self._slots = slots
        self._sized_to = sized_to
        self._own = SlotClaim(node, None, priority, 1 if sized_to else 0)
        self._roomy = 0
        """The number of superframes in a row for which a shorter one would have been enough."""
        self._hellos: dict[NodeId, tuple[int, SlotHello]] = {}
        self.repairs = 0
        """The number of slots that this node has given up to stronger rivals."""

    @property
    def slot(self) -> int | None:
        return self._own.slot

    @property
    def own(self) -> SlotClaim:
        return self._own

    def on_hello(self, hello: SlotHello, *, now_ns: int) -> None:
        """A neighbor's hello was received. Claims of impossible slots are ignored."""
        if hello.own.node != self._own.node and all(self._possible(claim) for claim in (hello.own, *hello.heard)):
            self._hellos[hello.own.node] = now_ns, hello

    def _possible(self, claim: SlotClaim) -> bool:
        if claim.slot is not None and claim.slot < 0:
            return False
        most = self._sized_to or 0
        return 0 <= claim.length <= most and not claim.length & (claim.length - 1)

    def step(self, now_ns: int) -> SlotHello:
        """Forget silent neighbors, give up a slot that a stronger rival claims, and return the next hello.

        To be called once per superframe.
        """
        horizon_ns = now_ns - self._lifetime_ns
        self._hellos = {node: entry for node, entry in self._hellos.items() if entry[0] >= horizon_ns}
        if self._sized_to is not None:
            self._size(self._sized_to)
        if self._own.slot is None:
            if now_ns >= self._listen_until_ns:
                self._own = self._own._replace(slot=self._free(self._own))
        elif any(rival.beats(self._own) for rival in self.rivals() if rival.meets(self._own)):
            self.repairs += 1
            self._own = self._own._replace(slot=self._free(self._own))
        return SlotHello(self._own, tuple(self._hellos[node][1].own for node in sorted(self._hellos)))

    def _size(self, most: int) -> None:
        """Adapt the length of the superframe to the greatest crowd within two hops.

        It is lengthened at once, and the node keeps its slot. It is shortened only after a while, and only if the
        shorter one has a free slot.
        """
        crowds = {rival.node: rival.crowd for rival in self.rivals()}
        crowd = 1 + len(crowds)
        wanted = min(most, 1 << (max(crowd, *crowds.values(), 1) - 1).bit_length())
        self._own = self._own._replace(crowd=crowd)
        if wanted >= self._own.length:
            self._roomy = 0
            self._own = self._own._replace(length=wanted)
            return
        self._roomy += 1
        if self._roomy >= _PATIENCE:
            shorter = self._own._replace(length=wanted, slot=None)
            slot = self._free(shorter)
            if slot is not None and self._own.slot is not None:
                shorter = shorter._replace(slot=slot)
            if slot is not None:
                self._own, self._roomy = shorter, 0

    def _free(self, claim: SlotClaim) -> int | None:
        """The lowest slot in which a claim of this length would meet no other claim; None if there is none."""
        taken = [rival for rival in self.rivals() if rival.slot is not None]
        if not claim.length:
            slot = lowest_free(rival.slot for rival in taken if rival.slot is not None)
            return slot if self._slots is None or slot < self._slots else None
        possible = (claim._replace(slot=slot) for slot in range(claim.length))
        return next((own.slot for own in possible if not any(own.meets(rival) for rival in taken)), None)

    def rivals(self) -> Iterator[SlotClaim]:
        """The claims of all other nodes within two hops; a neighbor's own statement counts before that of others."""
        for node in sorted(self._hellos):
            hello = self._hellos[node][1]
            yield hello.own
            for claim in hello.heard:
                if claim.node != self._own.node and claim.node not in self._hellos:
                    yield claim


def lowest_free(taken: Iterable[int]) -> int:
    """The lowest slot that is not taken."""
    used = frozenset(taken)
    return next(slot for slot in count() if slot not in used)

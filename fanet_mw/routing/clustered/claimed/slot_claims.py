"""Slots with spatial reuse, agreed over the air: each node claims the lowest slot free within its two hops.

                    listened long enough          a stronger rival claims it too
    LISTENING  ------------------------->  HOLDS  ---------------------------->  HOLDS another
                                             ^            (none free: SILENT)

A hello carries the sender's claim and those of the neighbors it hears, so each node knows the claims within two hops
one or two superframes later. Of two that claim one slot, the stronger keeps it: lower priority value, then lower id.
A node that joins listens before it claims; a node that leaves is forgotten when its hellos stop.

Without losses all claims are free of clashes within `listen + 2 d + 1` superframes after the topology last changed,
where d is the longest chain of ever weaker rivals, two hops apart at most: the strongest of each chain never yields,
its claim is known at two hops after two superframes, and its rivals then yield once. Links must work both ways.

**Superframes as long as the neighborhood is crowded** (`sized_to`). A node's slot then repeats every `length` turns, a
power of two not below the crowd (a node and all within two hops of it) of anyone within two hops. Lengths may differ:
slot a of A and slot b of B meet if a = b modulo the shorter length. A slot is always free for everyone: each of its
n rivals takes 1/length <= 1/(n+1) of all turns, so together less than all. After Kanzaki et al., "Dynamic TDMA slot
assignment in ad hoc networks" (AINA 2003). A crowd takes two superframes to be known, so the law gains four.
Lengthening keeps a part of the turns, and so clashes with no claim; shortening waits until it was possible for a while.
"""

from collections.abc import Iterable, Iterator
from itertools import count
from math import gcd
from typing import Final, NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import NodeId

_PATIENCE: Final = 8
"""Superframes for which a shorter one must have been possible: a neighbor whose hellos were lost is soon back."""


class SlotClaim(NamedTuple):
    """The slot that a node says it owns; None while it listens, or has found none free."""

    node: NodeId
    slot: int | None
    priority: int = 0
    """Lower is stronger."""
    length: int = 0
    """The slot repeats every so many turns; 0: all superframes are alike."""
    crowd: int = 1
    """Nodes within two hops of the claimant, itself included."""

    def meets(self, other: "SlotClaim") -> bool:
        """Both would send in the same turn."""
        if self.slot is None or other.slot is None:
            return False
        step = gcd(self.length, other.length)
        return (self.slot - other.slot) % step == 0 if step else self.slot == other.slot

    def beats(self, other: "SlotClaim") -> bool:
        return (self.priority, self.node) < (other.priority, other.node)


class SlotHello(NamedTuple):
    """What a node says about slots once per superframe."""

    own: SlotClaim
    heard: tuple[SlotClaim, ...]
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
        sized_to: int | None = None,
        priority: int = 0,
    ) -> None:
        """`slots`: of a fixed superframe; `sized_to`: the longest of superframes by crowd, a power of two."""
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
        """Superframes in a row for which a shorter one would have done."""
        self._hellos: dict[NodeId, tuple[int, SlotHello]] = {}
        self.repairs = 0
        """The number of slots that were given up to a stronger rival."""

    @property
    def slot(self) -> int | None:
        return self._own.slot

    @property
    def own(self) -> SlotClaim:
        return self._own

    def on_hello(self, hello: SlotHello, *, now_ns: int) -> None:
        """A neighbor's hello. Claims of slots that cannot be are ignored: they come off the air."""
        if hello.own.node != self._own.node and all(self._possible(claim) for claim in (hello.own, *hello.heard)):
            self._hellos[hello.own.node] = now_ns, hello

    def _possible(self, claim: SlotClaim) -> bool:
        if claim.slot is not None and claim.slot < 0:
            return False
        most = self._sized_to or 0
        return 0 <= claim.length <= most and not claim.length & (claim.length - 1)

    def step(self, now_ns: int) -> SlotHello:
        """Once per superframe: forget the silent, settle clashes, and say so."""
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
        """A longer superframe at once, with the slot kept; a shorter one after a while, if a slot is free in it."""
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
        """The lowest slot in which a claim of this length would meet no other."""
        taken = [rival for rival in self.rivals() if rival.slot is not None]
        if not claim.length:
            slot = lowest_free(rival.slot for rival in taken if rival.slot is not None)
            return slot if self._slots is None or slot < self._slots else None
        possible = (claim._replace(slot=slot) for slot in range(claim.length))
        return next((own.slot for own in possible if not any(own.meets(rival) for rival in taken)), None)

    def rivals(self) -> Iterator[SlotClaim]:
        """Claims within two hops. What a neighbor says of itself is newer than what others say of it."""
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

"""FANET_CLAIMS: whom a node hears, and who of them claims which slot, as its hello says it.

With it each receiver knows its two hops: who is there, who hears whom, and which slots are taken. The relays by
neighbor knowledge (`cds`, `mpr`, `heads`) need only the neighbors; slots are "none" then.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import MAX_NODES, NodeId
from fanet_mw.wire import CLAIMS, OVERHEAD, VERSION, decode_every, encode_inner

CAPACITY: Final = 16
"""Entries of one message; a few more neighbors need a second one."""
MESSAGE_BYTES: Final = OVERHEAD + CLAIMS.layout.size
MOST_SLOTS: Final = 254
NO_SLOT: Final = 255
MOST_LOTS: Final = 3
_HEARS_US: Final = 4
_RELAY: Final = 8
_KNOWN: Final = MOST_LOTS | _HEARS_US | _RELAY
_MOST: Final = 255


class Standing(NamedTuple):
    """What a node says of its own slots."""

    slot: int | None = None
    length: int = 0
    """Slots of the superframe in which that slot repeats."""
    crowd: int = 1
    """Nodes within two hops, itself included."""
    lots: int = 0
    """How many lots it has in turns that nobody claims."""


class Heard(NamedTuple):
    """One neighbor, as the sender of a hello knows it."""

    node: NodeId
    standing: Standing
    hears_us: bool
    """The link works both ways: it names the sender of this hello among its own neighbors."""
    relay: bool = False
    """The sender chose it as one of its multipoint relays."""


class Claims(NamedTuple):
    """All that one hello says."""

    node: NodeId
    own: Standing
    heard: tuple[Heard, ...]

    def encode_frames(self, room: int | None = None) -> bytes:
        """One message per `CAPACITY` neighbors, at least one; neighbors for which there is no room are left out."""
        most = len(self.heard) if room is None else max(1, room // MESSAGE_BYTES) * CAPACITY
        heard = self.heard[:most]
        starts = range(0, max(1, len(heard)), CAPACITY)
        chunks = (heard[at : at + CAPACITY] for at in starts)
        return b"".join(encode_inner(CLAIMS, self._payload(chunk), node=self.node) for chunk in chunks)

    def _payload(self, chunk: Sequence[Heard]) -> bytes:
        unused = (0,) * (CAPACITY - len(chunk))
        return CLAIMS.layout.pack(
            self.node,
            *(h.node for h in chunk), *unused,
            *(_slot(h.standing) for h in chunk), *unused,
            *(h.standing.length for h in chunk), *unused,
            *(min(h.standing.crowd, _MOST) for h in chunk), *unused,
            *(h.standing.lots | _HEARS_US * h.hears_us | _RELAY * h.relay for h in chunk), *unused,
            _slot(self.own), self.own.length, min(self.own.crowd, _MOST), self.own.lots, len(chunk), VERSION,
        )  # fmt: skip

    @classmethod
    def decode_frames(cls, frame: bytes) -> Self | None:
        """What the hello in a frame says, None when it says nothing of claims; raises MalformedFrameError."""
        heard: list[Heard] = []
        messages = decode_every(CLAIMS, frame)
        if not messages:
            return None
        for node, *lists, slot, length, crowd, lots, count, version in messages:
            if version != VERSION or count > CAPACITY or lots > MOST_LOTS or not 0 < node <= MAX_NODES:
                raise MalformedFrameError(f"claims of version {version}, node {node}, {count} entries, {lots} lots")
            own = _standing(slot, length, crowd, lots)
            columns = (lists[at * CAPACITY : at * CAPACITY + count] for at in range(5))
            heard += (_heard(*row) for row in zip(*columns, strict=True))
        return cls(NodeId(node), own, tuple(heard))


def _slot(standing: Standing) -> int:
    return NO_SLOT if standing.slot is None else standing.slot


def _standing(slot: int, length: int, crowd: int, lots: int) -> Standing:
    if slot != NO_SLOT and slot >= length:
        raise MalformedFrameError(f"slot {slot} of a superframe of {length}")
    return Standing(None if slot == NO_SLOT else slot, length, crowd, lots)


def _heard(node: int, slot: int, length: int, crowd: int, facts: int) -> Heard:
    if not 0 < node <= MAX_NODES or facts & ~_KNOWN:
        raise MalformedFrameError(f"a claim of node {node}, facts {facts}")
    standing = _standing(slot, length, crowd, facts & MOST_LOTS)
    return Heard(NodeId(node), standing, bool(facts & _HEARS_US), bool(facts & _RELAY))

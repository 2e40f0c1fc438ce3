"""FANET_NEIGHBORS: in a hello, the neighbors that its sender hears.

From it each receiver knows its two hops: which nodes are there, and which of them hear each other. The rules of
relaying by neighbor knowledge (`cds`, `mpr`, `heads`) decide by it.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import MAX_NODES, NodeId
from fanet_mw.wire import NEIGHBORS, OVERHEAD, VERSION, Packed, decode_every, encode_inner

CAPACITY: Final = 16
"""The number of entries in one message; more neighbors need further messages."""
MESSAGE_BYTES: Final = OVERHEAD + NEIGHBORS.layout.size
_HEARS_US: Final = 1
_RELAY: Final = 2
_KNOWN: Final = _HEARS_US | _RELAY


class HeardNeighbor(NamedTuple):
    """One neighbor, as the sender of a hello knows it."""

    node: NodeId
    hears_us: bool
    """True if the link works both ways: the neighbor's own hello names the sender of this hello."""
    relay: bool = False
    """True if the sender has chosen the neighbor as one of its multipoint relays."""


class NeighborList(NamedTuple):
    """All neighbors that one hello names."""

    node: NodeId
    heard: tuple[HeardNeighbor, ...]

    @property
    def links(self) -> tuple[tuple[NodeId, bool], ...]:
        """Each neighbor, and whether the link works both ways."""
        return tuple((each.node, each.hears_us) for each in self.heard)

    def encode_frames(self, room: int | None = None) -> bytes:
        """One message for each `CAPACITY` neighbors, at least one; neighbors for whom there is no room are left out."""
        most = len(self.heard) if room is None else max(1, room // MESSAGE_BYTES) * CAPACITY
        heard = self.heard[:most]
        starts = range(0, max(1, len(heard)), CAPACITY)
        chunks = (heard[at : at + CAPACITY] for at in starts)
        return b"".join(encode_inner(NEIGHBORS, self._payload(chunk), node=self.node) for chunk in chunks)

    def _payload(self, chunk: Sequence[HeardNeighbor]) -> bytes:
        unused = (0,) * (CAPACITY - len(chunk))
        return NEIGHBORS.layout.pack(
            self.node,
            *(h.node for h in chunk), *unused,
            *(_HEARS_US * h.hears_us | _RELAY * h.relay for h in chunk), *unused,
            len(chunk), VERSION,
        )  # fmt: skip

    @classmethod
    def decode_frames(cls, packed: Packed) -> Self | None:
        """The neighbors that a hello names; None when it has no such message. Raises MalformedFrameError."""
        heard: list[HeardNeighbor] = []
        messages = decode_every(NEIGHBORS, packed)
        if not messages:
            return None
        for node, *lists, count, version in messages:
            if version != VERSION or count > CAPACITY or not 0 < node <= MAX_NODES:
                raise MalformedFrameError(f"neighbors of version {version}, node {node}, {count} entries")
            heard += map(_heard, lists[:count], lists[CAPACITY : CAPACITY + count])
        return cls(NodeId(node), tuple(heard))


def _heard(node: int, facts: int) -> HeardNeighbor:
    if not 0 < node <= MAX_NODES or facts & ~_KNOWN:
        raise MalformedFrameError(f"a neighbor {node}, facts {facts}")
    return HeardNeighbor(NodeId(node), bool(facts & _HEARS_US), bool(facts & _RELAY))

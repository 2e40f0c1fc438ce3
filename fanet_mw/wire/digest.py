"""FANET_DIGEST: which recent packets a node holds, per origin, as its hello says it. Sequence numbers as in RFC 1982.

    newest = 107, held = 0b0101   holds 107, 106 and 104; lacks 105

Data packets of one origin are numbered without gaps, so what is missing shows.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire import DIGEST, OVERHEAD, VERSION, decode_every, encode_inner

WINDOW: Final = 33
"""Packets of one origin that an entry speaks of: the newest and 32 before it."""
CAPACITY: Final = 24
"""Entries of one message."""
MESSAGE_BYTES: Final = OVERHEAD + DIGEST.layout.size
_SEQ_MASK: Final = 0xFFFF_FFFF
_HALF: Final = 0x8000_0000


def capacity(room: int) -> int:
    """How many holdings fit into so many bytes; there is room for one message (`scenario_checks`)."""
    return max(1, room // MESSAGE_BYTES) * CAPACITY


class Holding(NamedTuple):
    """What is held of one origin."""

    origin: int
    newest: int
    held: int

    def beyond(self, other: "Holding | None") -> list[int]:
        """What this one holds and the other lacks, newest first; what lies before its window it may or may not have."""
        mine = self.held << 1 | 1
        if other is not None:
            ahead = (self.newest - other.newest) & _SEQ_MASK
            theirs = other.held << 1 | 1
            behind = (other.newest - self.newest) & _SEQ_MASK
            if ahead < WINDOW:
                mine &= ~(theirs << ahead)
            elif behind < WINDOW:
                mine &= ~(theirs >> behind) & ((1 << WINDOW - behind) - 1)
            elif ahead >= _HALF:
                return []  # the other is so far ahead that it says nothing of what we hold
        if not mine:
            return []
        return [(self.newest - back) & _SEQ_MASK for back in range(WINDOW) if mine >> back & 1]

    def with_(self, seq: int) -> "Holding":
        """The same, and this packet."""
        ahead = (seq - self.newest) & _SEQ_MASK
        if ahead == 0:
            return self
        if ahead < _HALF:
            held = (self.held << ahead | 1 << (ahead - 1)) & _SEQ_MASK if ahead < WINDOW else 0
            return Holding(self.origin, seq, held)
        behind = (self.newest - seq) & _SEQ_MASK
        return self._replace(held=self.held | 1 << (behind - 1)) if behind < WINDOW else self


class Digest(NamedTuple):
    """All that one hello says."""

    holdings: tuple[Holding, ...]
    complete: bool
    """An origin without a holding is one of which nothing is held."""

    def encode_frames(self, node: int) -> bytes:
        """One message per `CAPACITY` holdings, at least one."""
        chunks = [self.holdings[at : at + CAPACITY] for at in range(0, max(1, len(self.holdings)), CAPACITY)]
        return b"".join(encode_inner(DIGEST, self._payload(chunk), node=node) for chunk in chunks)

    def _payload(self, chunk: Sequence[Holding]) -> bytes:
        unused = (0,) * (CAPACITY - len(chunk))
        return DIGEST.layout.pack(
            *(h.newest for h in chunk), *unused,
            *(h.held for h in chunk), *unused,
            *(h.origin for h in chunk), *unused,
            len(chunk), self.complete, VERSION,
        )  # fmt: skip

    @classmethod
    def decode_frames(cls, frame: bytes) -> Self | None:
        """The digest in a hello, None when it has none; raises MalformedFrameError."""
        holdings: list[Holding] = []
        messages = decode_every(DIGEST, frame)
        for fields in messages:
            *lists, count, complete, version = fields
            if version != VERSION or count > CAPACITY or complete > 1:
                raise MalformedFrameError(f"digest of version {version}, {count} entries, complete = {complete}")
            newest, held, origins = lists[:CAPACITY], lists[CAPACITY : 2 * CAPACITY], lists[2 * CAPACITY :]
            holdings += map(Holding, origins[:count], newest[:count], held[:count])
        return cls(tuple(holdings), all(fields[-2] for fields in messages)) if messages else None

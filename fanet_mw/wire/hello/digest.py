"""FANET_DIGEST: a part of a hello that states which recent packets of each origin the sender has.

    newest = 107, held = 0b0101   has 107, 106 and 104; lacks 105

The data packets of an origin are numbered without gaps, so a missing packet can be seen. Sequence numbers wrap as in
RFC 1982.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.serial_number import newer
from fanet_mw.wire import DIGEST, OVERHEAD, VERSION, Packed, decode_every, encode_inner

WINDOW: Final = 33
"""The number of packets of one origin that an entry covers: the newest and the 32 before it."""
CAPACITY: Final = 24
"""Entries of one message."""
MESSAGE_BYTES: Final = OVERHEAD + DIGEST.layout.size
_SEQ_MASK: Final = 0xFFFF_FFFF
_HALF: Final = 1 << 31
_new: Final = tuple.__new__  # for what is made once per packet


def capacity(room: int) -> int:
    """The number of holdings that fit into so many bytes; at least those of one message (checked with the scenario)."""
    return max(1, room // MESSAGE_BYTES) * CAPACITY


class Holding(NamedTuple):
    """The packets of one origin that a node has."""

    origin: int
    newest: int
    held: int

    def beyond(self, other: "Holding | None") -> list[int]:
        """The packets that this has and the other lacks, newest first; those before the other's window, too."""
        mine = self.held << 1 | 1
        if other is not None:
            ahead = (self.newest - other.newest) & _SEQ_MASK
            theirs = other.held << 1 | 1
            behind = (other.newest - self.newest) & _SEQ_MASK
            if ahead < WINDOW:
                mine &= ~(theirs << ahead)
            elif behind < WINDOW:
                mine &= ~(theirs >> behind) & ((1 << WINDOW - behind) - 1)
            elif not newer(self.newest, other.newest):
                return []  # the other is so far ahead that its window says nothing about these packets
        missing = []
        while mine:
            lowest = mine & -mine
            missing.append((self.newest - lowest.bit_length() + 1) & _SEQ_MASK)
            mine ^= lowest
        return missing

    def with_(self, seq: int) -> "Holding":
        """The holding with this packet added."""
        origin, newest, held = self
        ahead = (seq - newest) & _SEQ_MASK
        if 0 < ahead < _HALF:
            held = (held << ahead | 1 << (ahead - 1)) & _SEQ_MASK if ahead < WINDOW else 0
            return _new(Holding, (origin, seq, held))
        behind = (newest - seq) & _SEQ_MASK
        return _new(Holding, (origin, newest, held | 1 << (behind - 1))) if 0 < behind < WINDOW else self


@dataclass(frozen=True)
class Digest:
    """All holdings that one hello states."""

    holdings: tuple[Holding, ...]
    complete: bool
    """True if the sender has no packets of the origins that are missing here."""

    @cached_property
    def by_origin(self) -> Mapping[int, Holding]:
        """The holdings by origin, arranged once for all nodes that receive the hello."""
        return {holding.origin: holding for holding in self.holdings}

    def encode_frames(self, node: int) -> bytes:
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
    def decode_frames(cls, packed: Packed) -> Self | None:
        """The digest in a hello; None when it has none. Raises MalformedFrameError."""
        holdings: list[Holding] = []
        messages = decode_every(DIGEST, packed)
        for fields in messages:
            *lists, count, complete, version = fields
            if version != VERSION or count > CAPACITY or complete > 1:
                raise MalformedFrameError(f"digest of version {version}, {count} entries, complete = {complete}")
            newest, held, origins = lists[:CAPACITY], lists[CAPACITY : 2 * CAPACITY], lists[2 * CAPACITY :]
            holdings += map(Holding, origins[:count], newest[:count], held[:count])
        return cls(tuple(holdings), all(fields[-2] for fields in messages)) if messages else None

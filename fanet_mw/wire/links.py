"""FANET_LINKS: the measured quality of links, as nodes report it in joins and as the leader announces it to all.

    join of a node       epoch 0; from_nodes: the neighbor, to_nodes: the sender of the join
    leader to all        the links of one assignment, both directions of a pair as one entry, in parts of one frame each

The grade of a link is the negative logarithm of the share of frames that it loses, so grades of independent copies add
up.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import NodeId
from fanet_mw.wire import ANY_NODE, LINKS, VERSION, Packed, decode_every, encode_inner

CAPACITY: Final = 36
"""Entries of one message."""
MESSAGES: Final = 4
"""Messages of one frame: 144 links, which take just under 1000 bytes."""
NEPERS: Final = 25.0
"""The number of steps of the grade for a loss that is smaller by the factor e."""
_MOST_GRADE: Final = 230
_LEAST_DBM: Final = -128
_MOST_DBM: Final = 127


class Link(NamedTuple):
    """A measured link; if the leader announces it, it stands for both directions."""

    a: NodeId
    b: NodeId
    grade: int
    power_dbm: int

    @property
    def chance(self) -> float:
        """The share of frames that arrive."""
        return 1 - math.exp(-self.grade / NEPERS)


def grade_of(chance: float) -> int:
    """The grade of a link on which this share of frames arrives."""
    return min(_MOST_GRADE, round(-NEPERS * math.log(max(1e-9, 1 - chance))))


def power_of(rssi_dbm: float) -> int:
    """A received power in whole dBm, as it is sent."""
    return max(_LEAST_DBM, min(_MOST_DBM, round(rssi_dbm)))


def frames_of(links: Sequence[Link]) -> list[tuple[Link, ...]]:
    """The links of an assignment, divided into frames."""
    most = CAPACITY * MESSAGES
    return [tuple(links[at : at + most]) for at in range(0, len(links), most)]


class Links(NamedTuple):
    """The links in one packet."""

    node: int
    links: tuple[Link, ...]
    term: int = 0
    epoch: int = 0
    part: int = 0
    parts: int = 1

    def encode_frames(self) -> bytes:
        """One message per `CAPACITY` links, at least one."""
        starts = range(0, max(1, len(self.links)), CAPACITY)
        return b"".join(
            encode_inner(LINKS, self._payload(self.links[at : at + CAPACITY]), node=self.node) for at in starts
        )

    def _payload(self, chunk: Sequence[Link]) -> bytes:
        unused = (0,) * (CAPACITY - len(chunk))
        return LINKS.layout.pack(
            self.term, self.node, self.epoch,
            *(link.a for link in chunk), *unused,
            *(link.b for link in chunk), *unused,
            *(link.grade for link in chunk), *unused,
            *(link.power_dbm for link in chunk), *unused,
            self.part, self.parts, len(chunk), VERSION,
        )  # fmt: skip

    @classmethod
    def decode_frames(cls, packed: Packed) -> Self | None:
        """All links in a packet; None when it has none. Raises MalformedFrameError."""
        found: list[Link] = []
        names: set[tuple[int, ...]] = set()
        for term, node, epoch, *lists, part, parts, count, version in decode_every(LINKS, packed):
            if version != VERSION or count > CAPACITY or part >= parts or not 0 < node < ANY_NODE:
                raise MalformedFrameError(f"links of version {version}, node {node}, part {part}, {count} entries")
            names.add((node, term, epoch, part, parts))
            found += _entries([lists[at * CAPACITY : at * CAPACITY + count] for at in range(4)])
        if not names:
            return None
        if len(names) > 1 or len(found) > CAPACITY * MESSAGES:
            raise MalformedFrameError(f"links of {len(names)} senders or parts, {len(found)} entries, in one packet")
        node, term, epoch, part, parts = names.pop()
        return cls(node, tuple(found), term, epoch, part, parts)


def _entries(columns: Sequence[Iterable[int]]) -> list[Link]:
    links = [Link(NodeId(a), NodeId(b), grade, dbm) for a, b, grade, dbm in zip(*columns, strict=True)]
    for link in links:
        if not (0 < link.a < ANY_NODE and 0 < link.b < ANY_NODE and link.a != link.b):
            raise MalformedFrameError(f"a link from node {link.a} to node {link.b}")
    return links

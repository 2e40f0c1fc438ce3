"""FANET_PLACES: positions of the members in a part of a schedule, in whole metres: all nodes compute one timetable.

The message follows its FANET_SCHEDULE in the same packet; entry i belongs to member `first + i` of that part.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import Enu
from fanet_mw.wire import PLACES, VERSION, Packed, decode_every, encode_inner

CAPACITY: Final = 28
"""The number of entries in one message; two messages hold the members of one part of a schedule."""
_MOST_M: Final = 32767


def rounded(place: Enu) -> Enu:
    """A place as it arrives: in whole meters, within 32 km of the origin."""
    east, north, up = (float(max(-_MOST_M, min(_MOST_M, round(part)))) for part in place)
    return Enu(east, north, up)


class Places(NamedTuple):
    """The positions of one part of a schedule, and that of the leader, who is in no cluster."""

    members: tuple[Enu, ...]
    leader: Enu

    def encode_frames(self, node: int) -> bytes:
        starts = range(0, len(self.members), CAPACITY)
        return b"".join(
            encode_inner(PLACES, self._payload(at, self.members[at : at + CAPACITY]), node=node) for at in starts
        )

    def _payload(self, first: int, chunk: Sequence[Enu]) -> bytes:
        axes = [[int(part) for part in axis] for axis in zip(*map(rounded, chunk), strict=True)]
        unused = [0] * (CAPACITY - len(chunk))
        flat = [value for axis in axes for value in axis + unused]
        leader = [int(part) for part in rounded(self.leader)]
        return PLACES.layout.pack(*flat, *leader, first, len(chunk), VERSION)

    @classmethod
    def decode_frames(cls, packed: Packed) -> Self:
        """All places in a packet; raises MalformedFrameError when there are none, or when they are out of order."""
        found: list[Enu] = []
        leader: Enu | None = None
        for *values, first, count, version in decode_every(PLACES, packed):
            if version != VERSION or not 0 < count <= CAPACITY or first != len(found):
                raise MalformedFrameError(f"places of version {version}: {count} from {first} on, after {len(found)}")
            east, north, up = (values[at : at + count] for at in (0, CAPACITY, 2 * CAPACITY))
            found += map(Enu, map(float, east), map(float, north), map(float, up))
            leader = Enu(*map(float, values[3 * CAPACITY :]))
        if leader is None:
            raise MalformedFrameError("no places in the frame")
        return cls(tuple(found), leader)

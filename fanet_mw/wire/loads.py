"""FANET_LOADS: how much each member of a schedule part sends, so that all nodes compute one timetable.

The message follows its FANET_SCHEDULE in the same packet; entry i belongs to member i of that part. Loads are whole
numbers of packets in 100 s, so that all machines compute with the same ones.
"""

from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import S
from fanet_mw.wire import LOADS, VERSION, Packed, decode_every, encode_inner

CAPACITY: Final = 56
"""Entries of a message, which are as many as members of a schedule part."""
PER_NS: Final = 100 * S
AS_EXPECTED: Final = 0xFFFF
"""The load of a node that is assumed to send as the scenario states."""
LEAST_LOAD: Final = 1
"""The load of a node that sends nothing, or next to nothing."""
MOST_LOAD: Final = 20_000
"""The greatest load that can be announced: 200 packets a second of one node."""


def interval_ns_of(load: int, *, expected_ns: int) -> int:
    """The mean interval between packets of such a node; a load of 0, which is forged, counts as the least."""
    return expected_ns if load == AS_EXPECTED else PER_NS // max(LEAST_LOAD, load)


class Loads(NamedTuple):
    """The loads of the members of one schedule part."""

    members: tuple[int, ...]

    def encode_frames(self, node: int) -> bytes:
        unused = (0,) * (CAPACITY - len(self.members))
        return encode_inner(LOADS, LOADS.layout.pack(*self.members, *unused, len(self.members), VERSION), node=node)

    @classmethod
    def decode_frames(cls, packed: Packed) -> Self:
        """The loads in a packet; raises MalformedFrameError when there are none, or when one is impossible."""
        found = decode_every(LOADS, packed)
        if len(found) != 1:
            raise MalformedFrameError(f"{len(found)} messages of loads in the frame, not 1")
        *loads, count, version = found[0]
        if version != VERSION or count > CAPACITY:
            raise MalformedFrameError(f"loads of version {version}, {count} entries")
        members = tuple(loads[:count])
        for load in members:
            if load > MOST_LOAD and load != AS_EXPECTED:
                raise MalformedFrameError(f"a load of {load} packets in 100 s must be <= {MOST_LOAD}")
        return cls(members)

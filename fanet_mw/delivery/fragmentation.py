"""Fragmentation: a message that is longer than a packet is cut into pieces, each of which fits one packet.

    data = stride bytes | stride bytes | ... | the rest       piece 0, 1, ..., pieces - 1; the receiver joins them again
                                                              (`receiver.py`)

A MAVLink frame is never cut. A packet has less room for data if it names the targets of its message one by one.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from fanet_mw.units import NodeId
from fanet_mw.wire import application_message
from fanet_mw.wire.application_message import MAVLINK_PORT, MOST_PIECES

FEW: Final = 2
"""Up to this number of targets, missing pieces are sent to each target; to more targets they are broadcast."""
MOST_NAMED: Final = 32
"""A message for all nodes that is broadcast again names at most this many nodes that still lack something."""
Targets = tuple[NodeId, ...] | None
"""The nodes that a message is for, one by one; None if it is for all."""


class Fragments(NamedTuple):
    """How a message is cut."""

    stride: int
    """The number of bytes of each piece but the last."""
    pieces: int

    def part(self, data: bytes, piece: int) -> bytes:
        return data[piece * self.stride : (piece + 1) * self.stride]


class Fragmentation:
    """Cuts the messages of one node."""

    def __init__(self, others: int, room: Callable[[int], int]) -> None:
        """`others`: the number of other nodes. `room`: the room for inner frames in a packet of a priority [bytes]."""
        self._others = others
        self._room = room

    def most_bytes(self, *, port: int, targets: Targets, confirm: bool, priority: int) -> int:
        """The length of the longest message to these targets; below 0 if not even an empty one fits a packet."""
        room = self._room_beside_head(self._most_named(targets, confirm=confirm), priority)
        return room if port == MAVLINK_PORT or room < 0 else MOST_PIECES * application_message.room_for_data(room)

    def cut(self, data: bytes, *, port: int, targets: Targets, confirm: bool, priority: int) -> Fragments:
        """How to cut a message to these targets that is no longer than `most_bytes`."""
        if port == MAVLINK_PORT or not data:
            return Fragments(len(data), 1)
        room = self._room_beside_head(self._most_named(targets, confirm=confirm), priority)
        stride = min(len(data), application_message.room_for_data(room))
        return Fragments(stride, -(-len(data) // stride))

    def _most_named(self, targets: Targets, *, confirm: bool) -> int:
        """The greatest number of targets that any packet of a message names; a repetition to all nodes names some."""
        if targets is not None:
            return len(targets) if len(targets) > 1 else 0
        return min(self._others, MOST_NAMED) if confirm and self._others > FEW else 0

    def _room_beside_head(self, named: int, priority: int) -> int:
        """The room of a packet for data, and for what stands around it."""
        return self._room(priority) - application_message.HEAD_BYTES - application_message.targets_bytes(named)

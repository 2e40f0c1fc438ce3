"""A frame as whoever hears it finds it: which packet, in which phase, and its header when somebody asks.

A broadcast is one object of bytes to all who hear it in virtual time, and they hear it one after another: what the
first of them has read serves the others. Nothing here depends on who reads. In real time every frame is read once.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node import duplicates
from fanet_mw.node.packet import Packet

PHASES: Final = {0: duplicates.DELIVERED, wire.FLAG_FLOOD: duplicates.FLOODED, wire.FLAG_TO_HEAD: duplicates.CARRIED}
"""Which bit says that a packet was handled, by the phase flags of the frame that brought it."""
_new: Final = tuple.__new__  # for what is made once per frame
BUNDLE: Final = 1 << 30
"""The phase of a frame with several packets in it: no node has ever handled that."""


def name_of(frame: bytes) -> int:
    """One number per packet, the same at every hop: of all that its origin wrote, not of its sequence number alone.

    So nobody takes the place of a packet by sending another one under its origin and number. The hash is Python's own,
    keyed anew for each process (SipHash), so that nobody can aim at it; no order of anything depends on it.
    """
    return hash(frame[wire.END_TO_END] + frame[wire.HEADER_BYTES :])


class Reader:
    """Reads frames; what was read of the latest is at hand."""

    def __init__(self) -> None:
        self.frame = b""
        self.name = 0
        """`name_of` its packet, unchecked."""
        self.key = 0
        """`duplicates.key_of` its packet, unchecked; 0 when it has none, or several."""
        self.phase = 0
        """The bit of its packet's phase, unchecked; 0 when these bytes can have none; BUNDLE: it has several."""
        self.packet: Packet | None = None
        """The packet in the frame, once somebody has asked for it."""
        self.fields = wire.NO_FIELDS
        """What lies where its header has its fields, unchecked until somebody has asked for the packet."""

    def look(self, frame: bytes, *, alone: bool = False) -> None:
        """Take up another frame. `alone`: it is one packet of a bundle, whatever its flags say of more."""
        self.frame, self.packet = frame, None
        fields = self.fields = wire.fields_of(frame) or wire.NO_FIELDS
        _, _, _, seq, origin, _, _, _, _, _, _, flags, _, _ = fields
        if flags & wire.FLAG_MORE and not alone:
            self.name, self.key, self.phase = 0, 0, BUNDLE
        else:
            self.name = name_of(frame)
            self.key, self.phase = duplicates.key_of(origin, seq), PHASES.get(flags & wire.PHASE_MASK, 0)

    def read(self) -> Packet:
        """The packet in the frame; raises MalformedFrameError, each time."""
        if not self.phase:
            raise MalformedFrameError("no routing header, or one of two phases")
        packet = self.packet = _new(Packet, (wire.checked(self.frame, self.fields), self.frame))
        return packet


shared: Final = Reader()
"""For all nodes of this process."""
T = TypeVar("T")


class Memo:
    """What has been decoded of the latest packet that somebody asked about; values are immutable."""

    def __init__(self) -> None:
        self._packet: Packet | None = None
        self._found: dict[Callable[[bytes], Any], Any] = {}

    def of(self, packet: Packet, decode: Callable[[bytes], T]) -> T:
        """What `decode` makes of the packet's bytes; raises what it raises, each time."""
        if packet is not self._packet:
            self._packet = packet
            self._found.clear()
        elif decode in self._found:
            return self._found[decode]  # type: ignore[no-any-return]
        found = self._found[decode] = decode(packet.frame)
        return found


decoded: Final = Memo().of
"""For all nodes of this process: a hello that forty hear is decoded once."""

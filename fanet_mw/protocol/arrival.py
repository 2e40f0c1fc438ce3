"""A frame as whoever hears it finds it: which packet, in which phase, and its header when somebody asks.

A broadcast is one object of bytes to all who hear it in virtual time, and they hear it one after another: what the
first of them has read serves the others. Nothing here depends on who reads. In real time every frame is read once.
"""

from typing import Final

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.protocol import seen
from fanet_mw.protocol.txqueue import Packet

PHASES: Final = {0: seen.DELIVERED, wire.FLAG_FLOOD: seen.FLOODED, wire.FLAG_TO_HEAD: seen.CARRIED}
"""Which bit says that a packet was handled, by the phase flags of the frame that brought it."""
_new: Final = tuple.__new__  # for what is made once per frame
_NOTHING: Final = (0, 0)
BUNDLE: Final = 1 << 30
"""The phase of a frame with several packets in it: no node has ever handled that."""
_SEVERAL: Final = (0, BUNDLE)


def glance(packet: bytes) -> tuple[int, int]:
    """`seen.key_of` a packet and the bit of its phase, unchecked; (0, 0) when there can be none in these bytes."""
    peeked = wire.peek(packet)
    if peeked is None:
        return _NOTHING
    origin, seq, flags = peeked
    phase = PHASES.get(flags & wire.PHASE_MASK)
    return _NOTHING if phase is None else (seen.key_of(origin, seq), phase)


def read(packet: bytes, phase: int) -> Packet:
    """The packet in these bytes, whose phase `glance` has given; raises MalformedFrameError."""
    if not phase:
        raise MalformedFrameError("no routing header, or one of two phases")
    return _new(Packet, (wire.decode_header(packet), packet))


class Reader:
    """Reads frames; what was read of the latest is at hand."""

    def __init__(self) -> None:
        self._frame = b""
        self._glance = _NOTHING
        self._packet: Packet | None = None

    def glance(self, frame: bytes) -> tuple[int, int]:
        """`glance` at the packet of this frame; (0, BUNDLE) when it has several."""
        if frame is not self._frame:
            self._frame, self._packet = frame, None
            self._glance = _SEVERAL if wire.is_bundle(frame) else glance(frame)
        return self._glance

    def packet(self, frame: bytes) -> Packet:
        """The packet in the frame of the last `glance`; raises MalformedFrameError."""
        assert frame is self._frame, "whoever wants the packet has glanced at its frame"
        if self._packet is None:
            self._packet = read(frame, self._glance[1])
        return self._packet


shared: Final = Reader()
"""For all nodes of this process."""

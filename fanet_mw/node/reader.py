"""Reads frames off the air: which packet a frame brings, in which phase, and, when asked, what the packet holds.

In virtual time a broadcast is one object of bytes for all nodes that hear it, one after another: what the first of them
has read serves the others. So the nodes of one run share a reader; a node that is alone in its process has its own.
What is remembered for the whole process depends on the bytes alone, whichever run and thread asks.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final, TypeVar

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node import duplicates
from fanet_mw.node.packet import Packet
from fanet_mw.wire import Content, Kind

PHASES: Final = {0: duplicates.DELIVERED, wire.FLAG_FLOOD: duplicates.FLOODED, wire.FLAG_TO_HEAD: duplicates.CARRIED}
"""Which bit says that a packet was handled, by the phase flags of the frame that brought it."""
_new: Final = tuple.__new__  # for what is made once per frame
_HELLO: Final = int(Kind.HELLO)
_KIND: Final = 7
"""The place of the kind among the fields of a header (`wire.Fields`)."""
BUNDLE: Final = 1 << 30
"""The phase of a frame with several packets in it: no node has ever handled that."""
_LATEST: Final = 64
"""Packets of which is kept what was decoded; more hellos than one handover of a radio brings."""


def name_of(frame: bytes) -> int:
    """One number per packet, the same at every hop: of all that its origin wrote, not of its sequence number alone.

    So no node takes the place of a packet by sending another one under its origin and number. The hash is Python's own,
    keyed anew for each process (SipHash), so that no forger can aim at it; no order of anything depends on it.
    """
    return hash(frame[wire.END_TO_END] + frame[wire.HEADER_BYTES :])


class Reader:
    """Reads frames of one run; what was read of the latest is at hand."""

    def __init__(self) -> None:
        self.frame = b""
        self.name = 0
        """`name_of` its packet, unchecked."""
        self.key = 0
        """`duplicates.key_of` its packet, unchecked; 0 when it has none, or several."""
        self.phase = 0
        """The bit of its packet's phase, unchecked; 0 when these bytes can have none; BUNDLE: it has several."""
        self.packet: Packet | None = None
        """The packet in the frame, once `read` has been called."""
        self.fields = wire.NO_FIELDS
        """The values at the places of the header's fields, unchecked until `read` has been called."""

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
        hello = self.phase and self.fields[_KIND] == _HELLO  # a node's clock has read it before the node does
        packet = self.packet = packet_of(self.frame) if hello else self.checked()
        return packet

    def checked(self) -> Packet:
        """The packet in the frame, which nothing remembers; raises MalformedFrameError."""
        if not self.phase:
            raise MalformedFrameError("no routing header, or one of two phases")
        return _new(Packet, (wire.checked(self.frame, self.fields), self.frame))


T = TypeVar("T")


class _Inside:
    """What has been decoded of one packet; values are immutable."""

    def __init__(self) -> None:
        self.content: Content | None = None
        self.messages: dict[Callable[[Content], Any], Any] = {}
        """The result of each decoder for the content, by decoder."""


class Decoded:
    """What has been decoded of the latest packets.

    The inner frames of a packet are found and checked once, and each of its messages is decoded once, for the
    clock, the protocol and the applications of a node, and for all nodes that hear the same bytes.
    """

    def __init__(self) -> None:
        self._inside_of = lru_cache(maxsize=_LATEST)(lambda _: _Inside())
        """What was read inside a packet, by the packet: a radio may hand over several frames to each node."""

    def of(self, frame: bytes, decode: Callable[[Content], T]) -> T:
        """What `decode` makes of a packet, routing header first; raises what it raises, each time."""
        inside = self._inside_of(frame)
        if decode in inside.messages:
            return inside.messages[decode]  # type: ignore[no-any-return]
        if inside.content is None:
            inside.content = Content.of(frame)
        found = inside.messages[decode] = decode(inside.content)
        return found


decoded: Final = Decoded().of
"""The decoder of all nodes of this process: a hello that forty of them hear is decoded once."""


@lru_cache(maxsize=_LATEST)
def packet_of(frame: bytes) -> Packet:
    """The packet in a frame, its header decoded; raises MalformedFrameError."""
    reader = Reader()
    reader.look(frame)
    return reader.checked()

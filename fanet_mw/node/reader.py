"""Reads received frames: first only what identifies the packet and its phase, then, if a node asks, the whole packet.

Most receptions are copies, so a node looks a packet up before it decodes it. In virtual time nodes that hear a
broadcast share one `Reader`, so that a frame is read once. Caches depend on nothing but the bytes of a frame, so
several runs and threads may share them.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Final, Protocol, TypeVar

from fanet_mw import mavlink
from fanet_mw.errors import MalformedFrameError
from fanet_mw.motion import Motion
from fanet_mw.node.duplicates import PHASES, hash_of
from fanet_mw.node.packet import Packet
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire import (
    END_TO_END,
    FLAG_MORE,
    HEADER_BYTES,
    NO_FIELDS,
    PHASE_MASK,
    Content,
    Fields,
    Kind,
    checked,
    fields_of,
    unbundle,
)

_new: Final = tuple.__new__  # faster than the constructor, for objects that are made once per frame
_HELLO: Final = int(Kind.HELLO)
_KIND: Final = 7
"""The index of the packet's kind among the fields of a header (`wire.Fields`)."""
_FLAGS: Final = 11
"""The index of its flags among them."""
BUNDLE: Final = 1 << 30
"""Stands for the phase of a frame with several packets; in no duplicate set, so each such frame is opened."""
_LATEST: Final = 64
"""The number of packets whose decoded content is cached: more than the hellos that a radio hands over at once."""
_MESSAGES: Final = 4
"""The messages in a packet, about, which different parts of a node decode."""
_UNKNOWN: Final = (-1, b"", 0)
"""Length, inner frames and hash of a packet that was not looked at lately; no frame has this length."""
_LONG: Final = 400
"""A packet of this length has so many inner frames that to pass over them at once pays."""
_REMEMBERED: Final = 512
"""The number of packets whose hash a reader remembers: as many as plain flooding by 44 nodes carries in one second."""


class Looked:
    """What has been read of a packet, or of a frame with several. Nothing is checked until `read`."""

    __slots__ = ("fields", "frame", "hash", "packet", "parts", "phase")

    def __init__(self, frame: bytes, fields: Fields, packet_hash: int, phase: int) -> None:
        self.frame = frame
        self.fields = fields
        """The fields of the header, which may be nonsense until `read` has checked them."""
        self.hash = packet_hash
        """`duplicates.hash_of` the packet, by which duplicates are found; 0 if the frame holds several packets."""
        self.phase = phase
        """The bit of the packet's phase (`duplicates.PHASES`); 0: invalid flags; BUNDLE: several packets."""
        self.packet: Packet | None = None
        """The packet in the frame; None until `read` has been called."""
        self.parts: Sequence[Looked] | None = None
        """The packets of a frame that holds several; None until `Reader.parts` has been asked."""

    def read(self, cached: bool = True) -> Packet:
        """The packet; raises MalformedFrameError. `cached`: a hello, which the clock has asked for already."""
        frame, fields = self.frame, self.fields
        if not self.phase:
            raise MalformedFrameError("no routing header, or one of two phases")
        if cached and fields[_KIND] == _HELLO:
            packet = packet_of(frame)
        else:
            packet = _new(Packet, (checked(frame, fields), frame))
        self.packet = packet
        return packet


class Reader:
    """Looks at one frame after another, and knows the last one and the latest packets again."""

    def __init__(self) -> None:
        self.last = Looked(b"", NO_FIELDS, 0, 0)
        self._hashes: dict[bytes, tuple[int, bytes, int]] = {}
        """The length, the inner frames and the hash of packets that were looked at lately, by what no hop changes in
        their headers. A packet is looked at once for each node that relays it, and to compare its bytes takes a third
        of the time that hashing them takes."""
        self._cut_out: dict[bytes, bytes] = {}
        """The inner frames of long packets that were lately cut out of frames with several, likewise."""

    def look(self, frame: bytes) -> Looked:
        fields = fields_of(frame)
        if fields[_FLAGS] & FLAG_MORE:
            self.last = Looked(frame, fields, 0, BUNDLE)
        else:
            self.last = self._packet(frame, fields)
        return self.last

    def parts(self, looked: Looked) -> Sequence[Looked]:
        """The packets of a frame with several; raises MalformedFrameError. Each one's flag for more is ignored."""
        if looked.parts is None:
            looked.parts = [self._packet(part, fields_of(part)) for part in unbundle(looked.frame, self._cut_out)]
            for part in looked.parts:
                if len(part.frame) >= _LONG and part.frame[END_TO_END] not in self._cut_out:
                    if len(self._cut_out) >= _REMEMBERED:
                        self._cut_out.clear()
                    self._cut_out[part.frame[END_TO_END]] = part.frame[HEADER_BYTES:]
        return looked.parts

    def _packet(self, frame: bytes, fields: Fields) -> Looked:
        name = frame[END_TO_END]
        size, inner, packet_hash = self._hashes.get(name, _UNKNOWN)
        # packets that differ only in their inner frames are told apart by them: no copy is taken for another packet
        if len(frame) != size or not frame.endswith(inner):
            packet_hash = self._remember(name, frame)
        return Looked(frame, fields, packet_hash, PHASES.get(fields[_FLAGS] & PHASE_MASK, 0))

    def _remember(self, name: bytes, frame: bytes) -> int:
        if len(self._hashes) >= _REMEMBERED:
            self._hashes.clear()
        packet_hash = hash_of(frame)
        self._hashes[name] = len(frame), frame[HEADER_BYTES:], packet_hash
        return packet_hash


T = TypeVar("T")


class _Decode(Protocol):
    def __call__(self, frame: bytes, decode: Callable[[Content], T], /) -> T:
        """The result of `decode` for the packet in a frame; whatever `decode` raises is raised at every call."""


class Decoded:
    """A cache of the latest packets: each is opened and decoded once for all parts of all nodes of a run. What has been
    decoded is immutable, so all may share it.
    """

    def __init__(self) -> None:
        content_of = lru_cache(maxsize=_LATEST)(Content.of)
        self.of: _Decode = lru_cache(maxsize=_MESSAGES * _LATEST)(lambda frame, decode: decode(content_of(frame)))


decoded: Final = Decoded().of
"""Decodes a packet through the cache that all nodes of this process share: a hello heard by forty is decoded once."""


@lru_cache(maxsize=_LATEST)
def packet_of(frame: bytes) -> Packet:
    """The packet in a frame, checked; raises MalformedFrameError. The latest packets are cached."""
    return Reader().look(frame).read(cached=False)


FUTURE_NS: Final = S
"""What was sent by an instant further in the future than this is rejected: the clocks of a swarm differ by less."""


def motion_in(frame: bytes, *, own: NodeId, now_ns: int, place: mavlink.Geodetic) -> tuple[NodeId, Motion] | None:
    """The origin of a frame and its motion; None if malformed, without position, too far in the future, or `own`."""
    try:
        origin, heard = packet_of(frame).origin, decoded(frame, mavlink.kinematics_about(place))
    except MalformedFrameError:
        return None
    motion = Motion(heard.position, heard.velocity, heard.t_ms * MS)
    if origin == own or motion.at_ns > now_ns + FUTURE_NS:
        return None
    return origin, motion

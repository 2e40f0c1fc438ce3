r"""Watches own packets for the applications that want to know what becomes of them.

    accepted -> first frame announced -> the radio has finished with that frame, or has not tried to send it
           \-> dropped in this node, and why

A frame may carry several packets, so its status may tell of several. A status that never comes, because the bus or the
radio's process lost it, leaves an entry behind; the oldest are forgotten.
"""

from enum import Enum
from typing import Final, NamedTuple

from fanet_mw.errors import DropReason

_MOST_ON_RADIO: Final = 1024
"""The greatest number of frames whose status is awaited; the radio's queue holds fewer."""


class RadioStage(Enum):
    """How far the radio has come with the first frame of a packet."""

    ANNOUNCED = "announced"
    SENT = "sent"
    """The radio has finished with it; whether a neighbor has received it is another question."""
    NOT_TRIED = "not tried"


class PacketNews(NamedTuple):
    """What has become of a watched packet."""

    seq: int
    t_ns: int
    what: RadioStage | DropReason


class PacketWatch:
    """The watched packets of one node, by sequence number."""

    def __init__(self) -> None:
        self.watched: set[int] = set()
        self.news: list[PacketNews] = []
        """What has become of them since somebody emptied this list, in order."""
        self._for_radio: set[int] = set()
        """The watched packets whose first frame is still to be announced, and whose radio status is wanted then."""
        self._on_radio: dict[int, list[int]] = {}
        """The packets whose first frame is with the radio, by the number of its request."""

    def begin(self, seq: int, *, radio: bool) -> None:
        """Watch a packet; with `radio` until the radio has finished with its first frame."""
        self.watched.add(seq)
        if radio:
            self._for_radio.add(seq)

    def end(self, seq: int) -> None:
        self.watched.discard(seq)
        self._for_radio.discard(seq)

    def announced(self, seq: int, request: int, t_ns: int) -> bool:
        """The first frame of an own packet is announced by this request; True if the radio is to report on it."""
        if seq in self.watched:
            self.news.append(PacketNews(seq, t_ns, RadioStage.ANNOUNCED))
        if seq not in self._for_radio:
            return False
        self._for_radio.discard(seq)  # later frames of the packet repeat it
        self._on_radio.setdefault(request, []).append(seq)
        if len(self._on_radio) > _MOST_ON_RADIO:
            del self._on_radio[next(iter(self._on_radio))]
        return True

    def radio_done(self, request: int, *, tried: bool, now_ns: int) -> None:
        """The radio has reported on a request, which may be one that nobody waits for."""
        stage = RadioStage.SENT if tried else RadioStage.NOT_TRIED
        self.news += [PacketNews(seq, now_ns, stage) for seq in self._on_radio.pop(request, ()) if seq in self.watched]

    def dropped(self, seq: int, reason: DropReason, now_ns: int) -> None:
        if seq in self.watched:
            self.news.append(PacketNews(seq, now_ns, reason))

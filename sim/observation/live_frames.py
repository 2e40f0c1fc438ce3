"""The frames that the nodes of a running swarm announce; in a swarm with keys only the emulator hears them."""

from collections import deque
from collections.abc import Iterator
from typing import Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TxRequest
from fanet_mw.bus.topics import node_of
from fanet_mw.errors import MalformedFrameError

_MOST_PUTS: Final = 20_000


class LiveFrames:
    """The frames as they come; those for which there is no time are skipped and counted."""

    def __init__(self) -> None:
        self.skipped = self.malformed = 0
        self.wanted = True
        """False: what comes is passed over."""
        self._puts: deque[tuple[str, bytes]] = deque(maxlen=_MOST_PUTS)

    def keep(self, topic: str, payload: bytes) -> None:
        """Called on the bus's threads."""
        if self.wanted:
            self.skipped += len(self._puts) == _MOST_PUTS
            self._puts.append((topic, payload))

    def take(self) -> Iterator[tuple[int, TxRequest]]:
        for _ in range(len(self._puts)):
            topic, payload = self._puts.popleft()
            try:
                messages = codecs.decode(payload)
            except MalformedFrameError:
                self.malformed += 1
                continue
            for message in messages:
                if isinstance(message, TxRequest):
                    yield node_of(topic), message

"""Runs the inspector on a swarm or on the folder of a run."""

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TxRequest
from fanet_mw.bus.topics import node_of
from fanet_mw.errors import BusError, MalformedFrameError
from fanet_mw.hosts import interrupts
from sim.inspection.inspection import Inspection, of_folder
from sim.inspection.screen import Inspector
from sim.observation.bus_feed import BusFeed
from sim.results.run_folder import RunFolder

_MOST_FRAMES: Final = 20_000


class LiveFrames:
    """The frames that nodes send, as they come; those for which there is no time are skipped and counted."""

    def __init__(self) -> None:
        self.skipped = 0
        self._puts: deque[tuple[str, bytes]] = deque(maxlen=_MOST_FRAMES)

    def keep(self, topic: str, payload: bytes) -> None:
        """Called on the bus's threads."""
        self.skipped += len(self._puts) == _MOST_FRAMES
        self._puts.append((topic, payload))

    def pump(self, inspection: Inspection) -> None:
        for _ in range(len(self._puts)):
            topic, payload = self._puts.popleft()
            try:
                requests = [message for message in codecs.decode(payload) if isinstance(message, TxRequest)]
            except MalformedFrameError:
                inspection.messages.malformed += 1
                continue
            for request in requests:
                inspection.take_frame(node_of(topic), request.start_ns, request.frame)


def live(endpoint: str, swarm: str | None, *, zenoh_config: Path | None) -> int:
    """Inspect a swarm that runs until its user has seen enough."""
    with BusFeed(endpoint, swarm, zenoh_config=zenoh_config) as feed:
        inspection, frames = Inspection(feed.scenario), LiveFrames()

        def pump(into: Inspection) -> str:
            try:
                feed.pump(into)
            except BusError:
                feed.over = True
            frames.pump(into)
            into.now_ns = max(into.now_ns, feed.now_ns())
            skipped = feed.lost + frames.skipped
            over = "; the swarm is over" if feed.over else ""
            return (f"{skipped} puts skipped" if skipped else "nothing skipped") + over

        feed.listen()
        feed.bus.subscribe(feed.names.all_tx, frames.keep)
        _run(lambda ended: Inspector(inspection, title=f"swarm {feed.names.swarm}", pump=pump, live=True, ended=ended))
    return 0


def recorded(folder: Path) -> int:
    """Inspect the folder of a run."""
    inspection = of_folder(RunFolder(folder))
    note = "a recording: rates are of the whole run"
    _run(lambda ended: Inspector(inspection, title=str(folder), pump=lambda _: note, live=False, ended=ended))
    return 0


def _run(made: Callable[[Sequence[int]], Inspector]) -> None:
    """Run the screen until its user or a signal ends it; a signal that interrupted its event loop would not."""
    signals: list[int] = []
    with interrupts.handed_to(signals.append):
        made(signals).run()

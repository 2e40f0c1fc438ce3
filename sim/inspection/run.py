"""Runs the inspector on a swarm or on the folder of a run."""

from collections.abc import Callable, Sequence
from pathlib import Path

from fanet_mw.errors import BusError
from fanet_mw.hosts import interrupts
from sim.inspection.inspection import Inspection, of_folder
from sim.inspection.screen import Inspector
from sim.observation.bus_feed import BusFeed
from sim.observation.live_frames import LiveFrames
from sim.results.run_folder import RunFolder


def live(endpoint: str, swarm: str | None, *, zenoh_config: Path | None) -> int:
    with BusFeed(endpoint, swarm, zenoh_config=zenoh_config) as feed:
        inspection, frames = Inspection(feed.scenario), LiveFrames()

        def pump(into: Inspection) -> str:
            try:
                feed.pump(into)
            except BusError:
                feed.over = True
            for node, request in frames.take():
                into.take_frame(node, request.start_ns, request.frame)
            into.messages.malformed += frames.malformed
            frames.malformed = 0
            into.now_ns = max(into.now_ns, feed.now_ns())
            skipped = feed.lost + frames.skipped
            over = "; the swarm is over" if feed.over else ""
            return (f"{skipped} puts skipped" if skipped else "nothing skipped") + over

        feed.listen()
        feed.bus.subscribe(feed.names.all_tx, frames.keep)
        _run(lambda ended: Inspector(inspection, title=f"swarm {feed.names.swarm}", pump=pump, live=True, ended=ended))
    return 0


def recorded(folder: Path) -> int:
    inspection = of_folder(RunFolder(folder))
    note = "a recording: rates are of the whole run"
    _run(lambda ended: Inspector(inspection, title=str(folder), pump=lambda _: note, live=False, ended=ended))
    return 0


def _run(made: Callable[[Sequence[int]], Inspector]) -> None:
    """Run the screen until its user or a signal ends it; a signal that interrupted its event loop would not."""
    signals: list[int] = []
    with interrupts.handed_to(signals.append):
        made(signals).run()

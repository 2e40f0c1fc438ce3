"""Records a running swarm as MCAP, until it is over or somebody ends the recording."""

import contextlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from fanet_mw.errors import BusError
from fanet_mw.units import S
from sim.observation.bus_feed import BusFeed, Paced
from sim.recording.mcap_recording import McapRecording

_RATE_HZ: Final = 10.0
_LAST_WORDS_S: Final = 3.0
"""How long the last records of a swarm that is over are waited for."""


def record(
    feed: BusFeed, path: Path, *, ended: Sequence[int] = (), on_progress: Callable[[float], None] = lambda _: None
) -> int:
    """Write what is heard to a file until the swarm is over, its router is gone, or `ended` is not empty; returns how
    many puts were heard.
    """
    paced, heard = Paced(_RATE_HZ), 0
    feed.listen()
    while feed.clock is None and not ended:
        paced.wait()
        feed.look()
    if feed.clock is None:
        return 0
    with McapRecording(path, feed.scenario, epoch_unix_ns=feed.clock.epoch_unix_ns) as recording:
        over_s: float | None = None
        with contextlib.suppress(BusError):  # the launcher ends with its swarm
            while not ended and (over_s is None or time.monotonic() < over_s + _LAST_WORDS_S):
                heard += feed.pump(recording)
                recording.state.time_scale = feed.time_scale
                over_s = time.monotonic() if feed.over and over_s is None else over_s
                on_progress(feed.now_ns() / S)
                paced.wait()
        heard += feed.drain(recording)
    return heard

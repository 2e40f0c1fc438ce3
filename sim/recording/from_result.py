"""Makes a recording of a run that is over, from its trace and telemetry log: poses once a second."""

import contextlib
import heapq
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, groupby
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus.messages import Poses
from fanet_mw.errors import BusError, ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Posed, Record
from fanet_mw.units import STILL, Enu, S
from fanet_mw.whole_file import replacing, writing
from fanet_mw.wire import node_of_system
from sim.observation.bus_feed import BusFeed, Paced
from sim.recording.mcap_recording import McapRecording
from sim.results.outcome import Outcome
from sim.world.environment.layout import positions

_RATE_HZ: Final = 10.0
_LAST_WORDS_S: Final = 3.0
"""How long the last records of a swarm that is over are waited for."""


def record(
    feed: BusFeed, path: Path, *, ended: Sequence[int] = (), on_progress: Callable[[float], None] = lambda _: None
) -> int:
    """Write what is heard until the swarm is over, its router gone, or a signal has `ended` it; returns the puts.
    Raises BusError if the router is gone before the swarm's time has begun.
    """
    paced, heard = Paced(_RATE_HZ), 0
    feed.listen()
    while feed.clock is None and not ended:
        paced.wait()
        feed.bus.check()
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
    if recording.failure is not None:
        raise ConfigError(f"{path}: ends early: {recording.failure}")
    return heard


def write_mcap(outcome: Outcome, path: Path) -> int:
    """Write the recording; returns its number of messages. A trace has no links and airtime per second."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with (
            replacing(path) as file,
            McapRecording(path, outcome.scenario, epoch_unix_ns=outcome.epoch_unix_ns, file=file) as recording,
        ):
            _retell(outcome, recording)
    return recording.count


def _retell(outcome: Outcome, recording: McapRecording) -> None:
    velocities: dict[int, tuple[float, float, float]] = {}
    last: dict[int, Posed] = {}
    standing = _standing(outcome.scenario)
    for t_ns, together in groupby(_timeline(outcome), key=lambda item: item[0]):
        items = [item for _, _, item in together if item is not None]
        posed = {item.node: item for item in items if isinstance(item, Posed)}
        for node, one in posed.items():
            before = last.get(node)
            span_s = (t_ns - before.t_ns) / S if before is not None else 0.0
            still = before is None or span_s <= 0
            velocities[node] = (
                (0.0, 0.0, 0.0) if still or before is None
                else tuple((b - a) / span_s for a, b in zip(before[2:], one[2:], strict=True))  # type: ignore[assignment]
            )  # fmt: skip
        last |= posed
        if posed:
            standing = {node: at for node, at in standing.items() if node not in posed}
        states = {node: (*one[2:], *velocities[node]) for node, one in posed.items()}
        if t_ns % S == 0:
            states |= {node: (*at, *STILL) for node, at in standing.items()}
        if states:
            ids = sorted(states)
            recording.take_poses(Poses(t_ns, array("H", ids), array("d", chain(*(states[node] for node in ids)))))
        recording.take_records(item for item in items if not isinstance(item, Posed | bytes))
        for item in items:
            if isinstance(item, bytes):
                recording.take_tap(node_of_system(item[5], nodes=outcome.scenario.node_count), t_ns, item)


def _standing(scenario: Scenario) -> dict[int, Enu]:
    """The places of nodes that the trace does not tell: of the post, and of UAVs that stand until they are moved; none
    if the map on which they stand is gone.
    """
    try:
        places = dict(enumerate(positions(scenario), 1))
    except ConfigError:
        return {}
    still = scenario.mobility.model == "static"
    return {node: at for node, at in places.items() if still or node == scenario.post}


def _timeline(outcome: Outcome) -> Iterator[tuple[int, int, Any]]:
    """Whole seconds, records and frames of telemetry by instant, in this order."""
    seconds: Iterator[tuple[int, int, Any]] = ((t_ns, -1, None) for t_ns in range(0, outcome.simulated_ns + 1, S))
    records: Iterator[tuple[int, int, Record]] = ((record.t_ns, 0, record) for record in outcome.records)
    taps = ((t_ns, 1, frame) for t_ns, frame in outcome.taps)
    return heapq.merge(seconds, records, taps, key=lambda item: item[:2])

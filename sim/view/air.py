"""The air of the moment as a picture: who sends when and why, and what each cause takes of it.

live      frames as nodes announce them, from when somebody wants to see them
replayed  the transmissions of the capture in the folder of a run
"""

import html
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final, Protocol

from emulator.pcap_file import NAME, captures
from emulator.pcap_reader import frames_of
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, S
from fanet_mw.wire import PRIORITIES
from sim.figures.colors import BLUE, GRAY, GREEN, ORANGE, PINK, RED
from sim.observation.air_causes import AirCauses, AirTime, Cause, transmissions
from sim.observation.bus_feed import BusFeed, LiveFrames

_COLORS: Final = dict(zip(Cause, (BLUE, GREEN, RED, ORANGE, PINK, GRAY), strict=True))
TAKEN_NS: Final = 5 * S
"""Shares are those of so long a time."""
_PICTURE_NS: Final = S
"""The longest time that is drawn."""
_LEAST_NS: Final = 150 * MS
_UNKNOWN_NS: Final = 500 * MS
"""What is drawn where nobody owns turns."""
_REMEMBERED: Final = 100_000
_WIDTH: Final = 290
_LEFT: Final = 24
_HEIGHT: Final = 230


class AirSource(Protocol):
    """Where transmissions are known from."""

    nothing: str
    """Why there may be none, for people."""

    def between(self, since_ns: int, until_ns: int) -> Sequence[AirTime]:
        """The transmissions that began in a span of swarm time, in their order."""
        ...

    def rest(self) -> None: ...


class LiveAir:
    """The frames that nodes announce on the bus."""

    nothing = "No frames are heard. In a swarm with keys only the emulator hears them."

    def __init__(self, feed: BusFeed) -> None:
        self._feed, self._frames = feed, LiveFrames()
        self._causes = AirCauses(feed.scenario, remembers=_REMEMBERED)
        self._sent: deque[AirTime] = deque()
        self._listens = False

    def between(self, since_ns: int, until_ns: int) -> Sequence[AirTime]:
        self._frames.wanted = True
        if not self._listens:
            self._listens = True
            self._feed.bus.subscribe(self._feed.names.all_tx, self._frames.keep)
        for node, request in self._frames.take():
            self._sent.append(self._causes.frame(request.start_ns, node, request.frame, frame_bytes=len(request.frame)))
        while self._sent and self._sent[0].start_ns < since_ns - S:  # announced ahead, so about in their order
            self._sent.popleft()
        return sorted(one for one in self._sent if since_ns <= one.start_ns < until_ns)

    def rest(self) -> None:
        self._frames.wanted = False
        self._sent.clear()


class CapturedAir:
    """The capture in the folder of a run, which is read when somebody looks."""

    nothing = "No frames: the folder has no capture of this time. `fanet simulate ... --out DIR --pcap` makes one."

    def __init__(self, folder: Path, scenario: Scenario, *, epoch_unix_ns: int) -> None:
        self._folder, self._scenario, self._epoch_ns = folder, scenario, epoch_unix_ns
        self._sent: list[AirTime] | None = None

    def between(self, since_ns: int, until_ns: int) -> Sequence[AirTime]:
        if self._sent is None:
            self._sent = self._read()
        first, last = (bisect_left(self._sent, at, key=lambda one: one.start_ns) for at in (since_ns, until_ns))
        return self._sent[first:last]

    def rest(self) -> None:
        """It stays read."""

    def _read(self) -> list[AirTime]:
        try:
            return sorted(
                one
                for path in captures(self._folder / NAME)
                for one in transmissions(AirCauses(self._scenario), frames_of(path, epoch_unix_ns=self._epoch_ns))
            )
        except ConfigError as error:
            self.nothing = str(error)
            return []


def drawn_ns(period_ns: int) -> int:
    """How long a time is drawn: whole rounds or superframes, if they are no longer than can be seen."""
    rounds = -(-_LEAST_NS // period_ns) if period_ns else 0
    return min(rounds * period_ns, _PICTURE_NS) if rounds else _UNKNOWN_NS


def air_text(
    source: AirSource,
    nodes: Sequence[int],
    t_ns: int,
    *,
    length_ns: int,
    losses: Mapping[str, float] = MappingProxyType({}),
    selected: int = 0,
) -> str:
    """The picture before an instant, and shares of the last seconds, as HTML. `losses`: share of copies, by reason."""
    span_ns = min(TAKEN_NS, t_ns)
    sent = source.between(t_ns - span_ns, t_ns)
    if not sent or not span_ns:
        return html.escape(source.nothing)
    shown = [one for one in sent if one.start_ns >= t_ns - length_ns and one.cause is not Cause.ACK]
    of_cause = [
        _row(f"<span style='color:{_COLORS[cause]}'>&#9632;</span> {cause}", own, span_ns)
        for cause in Cause
        if (own := [one for one in sent if one.cause is cause])
    ]
    of_priority = [
        _row(f"packets: {name}", own, span_ns)
        for name, priority in PRIORITIES.items()
        if (own := [one for one in sent if one.priority == priority])
    ]
    lost = "".join(
        f"<tr><td>copies lost: {html.escape(reason.replace('_', ' '))}</td><td></td><td>{100 * share:.2f} %</td></tr>"
        for reason, share in sorted(losses.items(), key=lambda item: -item[1])
    )
    return (
        f"{_picture(shown, nodes, t_ns - length_ns, t_ns, selected)}"
        f"<style>.air td{{padding-right:14px}}.air td+td{{text-align:right}}</style><table class='air'>"
        f"<tr><td>last {span_ns / S:.0f} s</td><td>frames/s</td><td>airtime</td></tr>{''.join(of_cause)}"
        f"{_row('all senders', sent, span_ns)}{''.join(of_priority)}{lost}</table>"
        "Of a frame with several packets the first cause in this order and the most urgent priority count; senders far "
        "apart may send at once. Copies are those at stations in range."
    )


def _row(name: str, sent: Sequence[AirTime], span_ns: int) -> str:
    share = sum(one.length_ns for one in sent) / span_ns
    return f"<tr><td>{name}</td><td>{len(sent) * S / span_ns:.0f}</td><td>{100 * share:.2f} %</td></tr>"


def _picture(shown: Sequence[AirTime], nodes: Sequence[int], since_ns: int, until_ns: int, selected: int) -> str:
    """A row for each node, time to the right, one path for each cause."""
    row = {node: place for place, node in enumerate(nodes)}
    high = _HEIGHT / max(1, len(nodes))
    per_ns = (_WIDTH - _LEFT) / (until_ns - since_ns)
    paths = []
    for cause in Cause:
        marks = [
            f"M{_LEFT + (one.start_ns - since_ns) * per_ns:.1f} {(row[one.node] + 0.5) * high:.1f}"
            f"h{max(0.8, one.length_ns * per_ns):.1f}"
            for one in shown
            if one.cause is cause and one.node in row
        ]
        if marks:
            paths.append(f"<path stroke='{_COLORS[cause]}' stroke-width='{0.9 * high:.1f}' d='{''.join(marks)}'/>")
    band = ""
    if selected in row:
        band = f"<rect x='{_LEFT}' y='{row[selected] * high:.1f}' width='100%' height='{high:.1f}' fill='#dde6ee'/>"
    every = next(step for step in (1, 2, 5, 10, 20, 50, 100, 1000) if step * high >= 12)
    names = "".join(
        f"<text x='{_LEFT - 4}' y='{(place + 0.5) * high + 3.5:.1f}' text-anchor='end'>{node}</text>"
        for place, node in enumerate(nodes)
        if place % every == 0
    )
    return (
        f"<svg viewBox='0 -5 {_WIDTH} {_HEIGHT + 21}' width='100%' font-size='10' role='img' "
        f"aria-label='Frames by sender and cause'>{band}{names}{''.join(paths)}"
        f"<path stroke='#999' d='M{_LEFT} {_HEIGHT}.5H{_WIDTH}M{_LEFT}.5 0V{_HEIGHT}'/>"
        f"<text x='{_LEFT}' y='{_HEIGHT + 13}'>{since_ns / S:.2f} s</text>"
        f"<text x='{_WIDTH}' y='{_HEIGHT + 13}' text-anchor='end'>{until_ns / S:.2f} s</text></svg>"
    )

"""The inspector on the terminal (textual): messages, packets, turns and links, of a swarm that runs or of a recording.

Whatever could not be looked at in time is counted in the last line.
"""

import contextlib
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, Final

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.css.query import NoMatches
from textual.widgets import Footer, Input, Static, TabbedContent, TabPane

from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts import interrupts
from fanet_mw.units import MS, S
from sim.inspection.inspection import Inspection, LinkLine, of_folder
from sim.inspection.messages import Key, fields_of, name_of
from sim.inspection.packets import Way
from sim.inspection.rows import Column, Rows
from sim.observation.bus_feed import BusFeed, LiveFrames
from sim.observation.turns import Turns
from sim.results.run_folder import RunFolder

_TABS: Final = {"messages": "#streams", "packets": "#ways", "turns": None, "links": "#pairs"}
"""The tabs, each with the table that has the focus there."""
_REFRESH_S: Final = 0.5
_WIDTH: Final = 100
_STREAM_COLUMNS: Final = (
    Column("node", 4, number=True), Column("way", 4), Column("message", 27), Column("Hz", 7, number=True),
    Column("B/s", 7, number=True), Column("count", 8, number=True), Column("age s", 6, number=True),
)  # fmt: skip
_WAY_COLUMNS: Final = (
    Column("packet", 12), Column("application", 14), Column("bytes", 6, number=True),
    Column("born s", 9, number=True), Column("nodes", 5, number=True), Column("ended", 24),
)  # fmt: skip
_LINK_COLUMNS: Final = (
    Column("from", 4, number=True), Column("to", 4, number=True), Column("received", 16),
    Column("RSSI dBm", 8, number=True), Column("lost", 60),
)  # fmt: skip
Pump = Callable[[Inspection], str]
"""Takes in what has come, and says what of it was skipped."""


class Inspector(App[None]):
    """The application."""

    CSS = """
    #filter { height: 3; }
    TabbedContent { height: 1fr; }
    #detail, #ways-detail { border-left: solid $panel; padding: 0 1; }
    #detail { width: 62; max-width: 50%; }
    #status { height: 1; background: $panel; padding: 0 1; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "Quit"),
        Binding("f", "freeze", "Freeze"),
        Binding("slash", "filter", "Filter"),
        Binding("escape", "table", "Table"),
        *(Binding(str(number), f"tab('{name}')", name.title()) for number, name in enumerate(_TABS, start=1)),
    ]

    def __init__(
        self, inspection: Inspection, *, title: str, pump: Pump, live: bool, ended: Sequence[int] = ()
    ) -> None:
        """`ended`: signals that have come; the first one ends the application."""
        super().__init__()
        self._ended = ended
        self.title = title
        self._inspection, self._pump, self._live = inspection, pump, live
        self.frozen = False
        self._skipped = ""
        self._said: dict[str, Text | str] = {}

    def compose(self) -> ComposeResult:
        yield Input(placeholder="filter: node, tap or air, part of a message's name", id="filter")
        with TabbedContent(initial="messages"):
            with TabPane("Messages", id="messages"), Horizontal():
                yield Rows[Key](*_STREAM_COLUMNS, id="streams")
                yield VerticalScroll(Static(id="fields"), id="detail")
            with TabPane("Packets", id="packets"), Horizontal():
                yield Rows[tuple[int, int]](*_WAY_COLUMNS, id="ways")
                yield VerticalScroll(Static(id="way"), id="ways-detail")
            with TabPane("Turns", id="turns"):
                yield VerticalScroll(Static(id="superframe"))
            with TabPane("Links", id="links"):
                yield Rows[tuple[int, int]](*_LINK_COLUMNS, id="pairs")
        yield Static(id="status")
        yield Footer()

    def on_mount(self) -> None:
        self.query_one("#streams", Rows).focus()
        self.refresh_all()
        self.set_interval(_REFRESH_S, self.tick)

    # --- what keys and clicks do ----------------------------------------------------------------------------------

    def action_freeze(self) -> None:
        """Stop taking in, so that what is shown can be read; what comes meanwhile waits, or is skipped and counted."""
        self.frozen = not self.frozen
        self.refresh_all()

    def action_filter(self) -> None:
        self.query_one("#filter", Input).focus()

    def action_table(self) -> None:
        table = _TABS[self.query_one(TabbedContent).active]
        if table is not None:
            self.query_one(table, Rows).focus()
        else:
            self.set_focus(None)

    def action_tab(self, name: str) -> None:
        self.set_focus(None)
        self.query_one(TabbedContent).active = name
        self.call_after_refresh(self.action_table)
        self.call_after_refresh(self.refresh_all)

    def on_input_changed(self, _event: Input.Changed) -> None:
        self.refresh_all()

    def on_rows_chosen(self, _event: Rows.Chosen) -> None:
        self._show_detail()

    # --- what is shown --------------------------------------------------------------------------------------------

    def refresh_all(self) -> None:
        if self._ended:
            self.exit()
            return
        if not self.frozen:
            self._skipped = self._pump(self._inspection)
        shown = {
            "messages": self._show_streams, "packets": self._show_ways, "turns": self._show_turns,
            "links": self._show_links,
        }  # fmt: skip
        shown[self.query_one(TabbedContent).active]()
        self._show_status()

    def tick(self) -> None:
        """What the timer does; its last tick may come while the widgets go."""
        with contextlib.suppress(NoMatches):
            self.refresh_all()

    def _show_status(self) -> None:
        seen = self._inspection
        parts = [
            f"{seen.now_ns / S:.1f} s", f"{seen.messages.count} messages", f"{len(seen.messages.streams)} kinds",
            *([f"{seen.messages.malformed} malformed"] if seen.messages.malformed else []),
            *([f"{seen.packets.forgotten} older packets forgotten"] if seen.packets.forgotten else []),
            self._skipped or "nothing skipped",
            *(["FROZEN"] if self.frozen else []),
        ]  # fmt: skip
        self._say("status", "  |  ".join(parts))

    def _say(self, where: str, what: Text | str) -> None:
        """Change a text; the screen is laid out anew only if the text has another number of lines."""
        before = self._said.get(where, "")
        if what != before:
            self._said[where] = what
            lines = [str(text).count("\n") for text in (before, what)]
            self.query_one(f"#{where}", Static).update(what, layout=lines[0] != lines[1])

    def _show_streams(self) -> None:
        seen, words = self._inspection.messages, self.query_one("#filter", Input).value
        now_ns = self._inspection.now_ns

        def cells(key: Key) -> list[str]:
            stream = seen.streams[key]
            hz, size = stream.rates(now_ns) if self._live else stream.mean_rates(now_ns)
            return [
                str(key.node), key.where, name_of(key.message_id), f"{hz:.2f}", f"{size:.0f}", str(stream.count),
                f"{max(0, now_ns - stream.last_ns) / S:.1f}",
            ]  # fmt: skip

        self.query_one("#streams", Rows).show(seen.found(words), cells)
        self._show_fields()

    def _show_detail(self) -> None:
        self._show_fields()
        self._show_way()

    def _show_fields(self) -> None:
        key = self.query_one("#streams", Rows).chosen
        if key is None:
            return
        frame = self._inspection.messages.streams[key].frame
        text = Text(f"{name_of(key.message_id)} of node {key.node}, {len(frame)} bytes\n\n", "bold")
        for field in fields_of(frame):
            text.append(f"{field.name:<24.24} ", "cyan").append(field.value)
            text.append(f" {field.unit}" if field.unit else "", "dim")
            text.append(f"  {field.meaning}" if field.meaning else "", "green").append("\n")
        self._say("fields", text)

    def _show_ways(self) -> None:
        words, ways = self.query_one("#filter", Input).value.split(), self._inspection.packets.ways
        found = [(way.origin, way.seq) for way in reversed(ways.values()) if _fits(way, words)]

        def cells(key: tuple[int, int]) -> list[str]:
            way = ways[key]
            return [
                f"{way.origin}:{way.seq}", way.app, str(way.size),
                "-" if way.born_ns is None else f"{way.born_ns / S:.3f}", str(len(way.delivered)),
                ", ".join(sorted({reason for _, _, reason in way.dropped})),
            ]  # fmt: skip

        self.query_one("#ways", Rows).show(found, cells)
        self._show_way()

    def _show_way(self) -> None:
        key = self.query_one("#ways", Rows).chosen
        if key is not None and (way := self._inspection.packets.ways.get(key)) is not None:
            self._say("way", "\n".join(way.lines()))

    def _show_turns(self) -> None:
        found = self._inspection.turns()
        self._say(
            "superframe",
            "nobody owns slots or turns: all contend for the channel" if found is None
            else turn_lines(found, self._inspection.now_ns),
        )  # fmt: skip

    def _show_links(self) -> None:
        lines: dict[tuple[int, int], LinkLine] = {(line.src, line.dst): line for line in self._inspection.links}

        def cells(key: tuple[int, int]) -> list[str]:
            line = lines[key]
            return [
                str(line.src), str(line.dst), f"{line.received} of {line.copies}",
                "-" if line.rssi_dbm is None else f"{line.rssi_dbm:.1f}",
                ", ".join(f"{reason} {count}" for reason, count in line.lost.items() if count),
            ]  # fmt: skip

        self.query_one("#pairs", Rows).show([*lines], cells)


def turn_lines(found: Turns, now_ns: int) -> Text:
    """A line for each owner, `#` where it may send, `~` what is left, and whose turn it is now."""
    period_ns = found.period_ns
    superframe, place_ns = divmod(now_ns - found.start_ns, period_ns)
    owners = sorted({span.node for span in found.own})
    now = found.owners(now_ns)
    text = Text(f"{found.period_called} {superframe} of {period_ns / MS:g} ms, {place_ns / MS:.1f} ms into it; ")
    free = found.window_called if found.in_window(now_ns) else "nobody's"
    text.append(f"now: {found.called} of {', '.join(map(str, now))}\n\n" if now else f"now: {free}\n\n", "bold")
    if found.windows:
        middles = ((2 * at + 1) * period_ns // (2 * _WIDTH) + found.start_ns for at in range(_WIDTH))
        text.append(f"{'all':>5} {''.join('~' if found.in_window(at_ns) else '.' for at_ns in middles)}\n", "dim")
    for owner in owners:
        line = ["."] * _WIDTH
        for span in found.own:
            if span.node == owner:
                first = span.start_ns * _WIDTH // period_ns
                last = max(first + 1, (span.start_ns + span.length_ns) * _WIDTH // period_ns)
                for at in range(first, last):
                    line[at % _WIDTH] = "#"
        text.append(f"{owner:>5} ").append("".join(line), "bold green" if owner in now else "").append("\n")
    return text.append(" " * (6 + place_ns * _WIDTH // period_ns) + "^\n", "bold")


def _fits(way: Way, words: list[str]) -> bool:
    text = f"{way.origin} {way.origin}:{way.seq} {way.app} " + " ".join(reason for _, _, reason in way.dropped)
    return all(word in text.split() for word in words)


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
    if not (sys.stdin.isatty() and sys.stderr.isatty()):  # which textual reads, and draws on
        raise ConfigError("fanet inspect: needs a terminal; fanet topic and fanet log print what scripts can read")
    signals: list[int] = []
    with interrupts.handed_to(signals.append):
        made(signals).run()

"""The inspector on the terminal (textual): messages, packets, turns and links, of a swarm that runs or of a recording.

Whatever could not be looked at in time is counted in the last line.
"""

from collections.abc import Callable, Sequence
from typing import ClassVar, Final

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.widgets import DataTable, Footer, Input, Static, TabbedContent, TabPane

from fanet_mw.units import MS, S
from sim.inspection.inspection import Inspection
from sim.inspection.messages import Key, fields_of, name_of
from sim.inspection.packets import Way
from sim.observation.turns import Turns

_TABS: Final = {"messages": "#streams", "packets": "#ways", "turns": None, "links": "#pairs"}
"""The tabs, each with the table that has the focus there."""
_REFRESH_S: Final = 0.5
_MOST_ROWS: Final = 400
_WIDTH: Final = 100
Pump = Callable[[Inspection], str]
"""Takes in what has come, and says what of it was skipped."""


class Inspector(App[None]):
    """The application."""

    CSS = """
    #filter { height: 3; }
    TabbedContent { height: 1fr; }
    #detail { width: 62; border-left: solid $panel; padding: 0 1; }
    DataTable { height: 1fr; }
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
        self._key: Key | None = None
        self._way: tuple[int, int] | None = None

    def compose(self) -> ComposeResult:
        yield Input(placeholder="filter: node, tap or air, part of a message's name", id="filter")
        with TabbedContent(initial="messages"):
            with TabPane("Messages", id="messages"), Horizontal():
                yield DataTable[Text | str](id="streams", cursor_type="row", zebra_stripes=True)
                yield VerticalScroll(Static(id="fields"), id="detail")
            with TabPane("Packets", id="packets"), Horizontal():
                yield DataTable[Text | str](id="ways", cursor_type="row", zebra_stripes=True)
                yield VerticalScroll(Static(id="way"))
            with TabPane("Turns", id="turns"):
                yield VerticalScroll(Static(id="superframe"))
            with TabPane("Links", id="links"):
                yield DataTable[Text | str](id="pairs", zebra_stripes=True)
        yield Static(id="status")
        yield Footer()

    def on_mount(self) -> None:
        self.query_one("#streams", DataTable).add_columns("node", "way", "message", "Hz", "B/s", "count", "age s")
        self.query_one("#ways", DataTable).add_columns("packet", "application", "bytes", "born s", "nodes", "ended")
        self.query_one("#pairs", DataTable).add_columns("from", "to", "received", "RSSI dBm", "lost")
        self.query_one("#streams", DataTable).focus()
        self.refresh_all()
        self.set_interval(_REFRESH_S, self.refresh_all)

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
            self.query_one(table, DataTable).focus()
        else:
            self.set_focus(None)

    def action_tab(self, name: str) -> None:
        self.set_focus(None)
        self.query_one(TabbedContent).active = name
        self.call_after_refresh(self.action_table)
        self.call_after_refresh(self.refresh_all)

    def on_input_changed(self, _event: Input.Changed) -> None:
        self.refresh_all()

    def on_data_table_row_highlighted(self, event: DataTable.RowHighlighted) -> None:
        key = event.row_key.value if event.row_key is not None else None
        if key is None:
            return
        if event.data_table.id == "streams":
            node, where, message_id = key.split("/")
            self._key = Key(int(node), where, int(message_id))
            self._show_fields()
        elif event.data_table.id == "ways":
            origin, seq = key.split("/")
            self._way = int(origin), int(seq)
            self._show_way()

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

    def _show_status(self) -> None:
        seen = self._inspection
        parts = [
            f"{seen.now_ns / S:.1f} s", f"{seen.messages.count} messages", f"{len(seen.messages.streams)} kinds",
            *([f"{seen.messages.malformed} malformed"] if seen.messages.malformed else []),
            *([f"{seen.packets.forgotten} older packets forgotten"] if seen.packets.forgotten else []),
            self._skipped or "nothing skipped",
            *(["FROZEN"] if self.frozen else []),
        ]  # fmt: skip
        self.query_one("#status", Static).update("  |  ".join(parts))

    def _show_streams(self) -> None:
        words, now_ns = self.query_one("#filter", Input).value, self._inspection.now_ns
        rows = []
        for key, stream in self._inspection.messages.found(words):
            hz, size = stream.rates(now_ns) if self._live else stream.mean_rates(now_ns)
            age_s = f"{max(0, now_ns - stream.last_ns) / S:.1f}"
            cells = [
                str(key.node),
                key.where,
                name_of(key.message_id),
                f"{hz:.2f}",
                f"{size:.0f}",
                str(stream.count),
                age_s,
            ]
            rows.append((f"{key.node}/{key.where}/{key.message_id}", cells))
        _fill(self.query_one("#streams", DataTable), rows)
        self._show_fields()

    def _show_fields(self) -> None:
        stream = None if self._key is None else self._inspection.messages.streams.get(self._key)
        if stream is None or self._key is None:
            return
        text = Text(f"{name_of(self._key.message_id)} of node {self._key.node}, {len(stream.frame)} bytes\n\n", "bold")
        for field in fields_of(stream.frame):
            text.append(f"{field.name:<24.24} ", "cyan").append(field.value)
            text.append(f" {field.unit}" if field.unit else "", "dim")
            text.append(f"  {field.meaning}" if field.meaning else "", "green").append("\n")
        self.query_one("#fields", Static).update(text)

    def _show_ways(self) -> None:
        words = self.query_one("#filter", Input).value.split()
        ways = [way for way in reversed(self._inspection.packets.ways.values()) if _fits(way, words)]
        rows = [
            (f"{way.origin}/{way.seq}", [
                f"{way.origin}:{way.seq}", way.app, str(way.size),
                "-" if way.born_ns is None else f"{way.born_ns / S:.3f}", str(len(way.delivered)),
                ", ".join(sorted({reason for _, _, reason in way.dropped}))[:24],
            ])
            for way in ways[:_MOST_ROWS]
        ]  # fmt: skip
        _fill(self.query_one("#ways", DataTable), rows)
        self._show_way()

    def _show_way(self) -> None:
        way = None if self._way is None else self._inspection.packets.ways.get(self._way)
        if way is not None:
            self.query_one("#way", Static).update("\n".join(way.lines()))

    def _show_turns(self) -> None:
        found = self._inspection.turns()
        self.query_one("#superframe", Static).update(
            "nobody owns slots or turns: all contend for the channel" if found is None
            else turn_lines(found, self._inspection.now_ns)
        )  # fmt: skip

    def _show_links(self) -> None:
        rows = []
        for line in self._inspection.links[:_MOST_ROWS]:
            lost = ", ".join(f"{reason} {count}" for reason, count in line.lost.items() if count)
            rssi = "-" if line.rssi_dbm is None else f"{line.rssi_dbm:.1f}"
            cells = [str(line.src), str(line.dst), f"{line.received} of {line.copies}", rssi, lost]
            rows.append((f"{line.src}/{line.dst}", cells))
        _fill(self.query_one("#pairs", DataTable), rows)


def turn_lines(found: Turns, now_ns: int) -> Text:
    """The superframe of the moment: one line for each owner, `#` where it may send, `~` what is left, and whose
    turn it is now.
    """
    period_ns = found.period_ns
    superframe, place_ns = divmod(now_ns - found.start_ns, period_ns)
    owners = sorted({span.node for span in found.own})
    now = found.owners(now_ns)
    text = Text(f"{found.period_called} {superframe} of {period_ns / MS:g} ms, {place_ns / MS:.1f} ms into it; ")
    free = found.window_called if found.in_window(now_ns) else "nobody's"
    text.append(f"now: {found.called} of {', '.join(map(str, now))}\n\n" if now else f"now: {free}\n\n", "bold")
    if found.window[1]:
        first, last = (at * _WIDTH // period_ns for at in (found.window[0], sum(found.window)))
        text.append(f"{'all':>5} {'.' * first}{'~' * (last - first)}{'.' * (_WIDTH - last)}\n", "dim")
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


def _fill(table: DataTable[Text | str], rows: list[tuple[str, list[str]]]) -> None:
    """Show these rows; the cursor stays on its row, and rows that are there already are only changed."""
    wanted = [key for key, _ in rows]
    if [key.value for key in table.rows] == wanted:
        for key, cells in rows:
            for column, cell in zip(table.columns, cells, strict=True):
                table.update_cell(key, column, cell)
        return
    at = table.cursor_row
    chosen = [*table.rows][at].value if 0 <= at < len(table.rows) else None
    table.clear()
    for key, cells in rows:
        table.add_row(*cells, key=key)
    if chosen in wanted:
        table.move_cursor(row=wanted.index(chosen))

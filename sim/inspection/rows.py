"""A table on the terminal that works for its visible rows only, however many there are.

textual's own DataTable formats and measures each cell that changes; of 1,164 rows that change twice a second this took
a third of a core.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import ClassVar, Final, Generic, NamedTuple, TypeVar

from rich.cells import set_cell_size
from rich.segment import Segment
from textual import events
from textual.binding import Binding, BindingType
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

_GAP: Final = "  "
K = TypeVar("K", bound=Hashable)


class Column(NamedTuple):
    """A title, and how many characters stand below it."""

    title: str
    width: int
    number: bool = False
    """Numbers stand at the right."""

    def cell(self, text: str) -> str:
        return text.rjust(self.width) if self.number else set_cell_size(text, self.width)


class Rows(ScrollView, Generic[K], can_focus=True):
    """Rows by key, of which one is chosen."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {"rows--header", "rows--odd", "rows--chosen"}
    DEFAULT_CSS = """
    Rows { height: 1fr; width: 1fr; }
    Rows > .rows--header { background: $panel; color: $foreground; text-style: bold; }
    Rows > .rows--odd { background: $surface-lighten-1; }
    Rows > .rows--chosen { background: $primary; color: $text; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "by(-1)", show=False), Binding("down", "by(1)", show=False),
        Binding("pageup", "page(-1)", show=False), Binding("pagedown", "page(1)", show=False),
        Binding("home", "to(0)", show=False), Binding("end", "to(-1)", show=False),
    ]  # fmt: skip

    class Chosen(Message):
        """Another row was chosen by a key or a click."""

    def __init__(self, *columns: Column, id: str) -> None:  # noqa: A002  (textual's word)
        super().__init__(id=id)
        self._columns = columns
        self._keys: Sequence[K] = ()
        self._cells: Callable[[K], Sequence[str]] = lambda _: ()
        self._at = 0
        self._drawn: list[Sequence[str]] = []

    @property
    def count(self) -> int:
        return len(self._keys)

    @property
    def chosen(self) -> K | None:
        return self._keys[self._at] if self._keys else None

    def row(self, index: int) -> Sequence[str]:
        return self._cells(self._keys[index])

    def show(self, keys: Sequence[K], cells: Callable[[K], Sequence[str]]) -> None:
        """Show these rows. The chosen row stays chosen wherever it is now; the first place stays the first place."""
        self._cells = cells
        if keys != self._keys:
            was, seen = self.chosen, self._at - self.scroll_offset.y
            self._keys = keys
            width = sum(column.width + len(_GAP) for column in self._columns)
            self.virtual_size = Size(width, len(keys) + 1)
            if self._at:
                self._at = keys.index(was) if was in keys else min(self._at, max(0, len(keys) - 1))
                self.scroll_to(y=self._at - seen, animate=False, immediate=True)
        if self._visible() != self._drawn:
            self.refresh()

    def _visible(self) -> list[Sequence[str]]:
        first = self.scroll_offset.y
        return [self._cells(key) for key in self._keys[first : first + max(0, self.size.height - 1)]]

    def render_line(self, y: int) -> Strip:
        if y == 0:
            self._drawn = self._visible()
            return self._strip([column.title for column in self._columns], "rows--header")
        if y > len(self._drawn):
            return Strip.blank(self.size.width, self.rich_style)
        index = self.scroll_offset.y + y - 1
        look = "rows--chosen" if index == self._at else "rows--odd" if index % 2 else ""
        return self._strip(self._drawn[y - 1], look)

    def _strip(self, cells: Sequence[str], look: str) -> Strip:
        style = self.get_component_rich_style(look) if look else self.rich_style
        text = _GAP.join(column.cell(cell) for column, cell in zip(self._columns, cells, strict=True))
        left = self.scroll_offset.x
        return Strip([Segment(f" {text}", style)]).crop_extend(left, left + self.size.width, style)

    # --- what keys and clicks do ----------------------------------------------------------------------------------

    def action_by(self, rows: int) -> None:
        self._choose(self._at + rows)

    def action_page(self, pages: int) -> None:
        self._choose(self._at + pages * max(1, self.size.height - 2))

    def action_to(self, index: int) -> None:
        self._choose(index % len(self._keys) if self._keys else 0)

    def on_click(self, event: events.Click) -> None:
        place = self.scroll_offset.y + event.y - 1
        if event.y and place < len(self._keys):
            self._choose(place)

    def _choose(self, index: int) -> None:
        self._at = max(0, min(index, len(self._keys) - 1))
        # One line is asked for above the row, because the header covers the first.
        self.scroll_to_region(Region(0, self._at, 1, 2), animate=False, immediate=True)
        self.refresh()
        self.post_message(self.Chosen())

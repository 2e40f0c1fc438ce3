"""A table on the terminal: what is drawn, and what is chosen while rows come and go."""

from collections.abc import Sequence

from textual.app import App, ComposeResult

from sim.inspection.rows import Column, Rows


class OneTable(App[None]):
    """A table and nothing else."""

    def compose(self) -> ComposeResult:
        yield Rows[int](Column("number", 8, number=True), Column("name", 12), id="rows")


def said(rows: Rows[int], line: int) -> str:
    return rows.render_line(line).text.rstrip()


async def test_only_rows_on_the_screen_are_worked_for() -> None:
    asked: list[int] = []

    def cells(key: int) -> Sequence[str]:
        asked.append(key)
        return str(key), f"row {key}"

    app = OneTable()
    async with app.run_test(size=(60, 20)) as pilot:
        rows = app.query_one(Rows)
        rows.show(range(5_000), cells)
        await pilot.pause()
        assert said(rows, 0) == "   number  name"
        assert said(rows, 19) == "       18  row 18"
        rows.focus()
        await pilot.press("end")
        await pilot.pause()
        assert said(rows, 19) == "     4999  row 4999"
        assert rows.chosen == 4999
        assert len({*asked}) == 2 * 19


async def test_what_is_wider_than_the_screen_is_seen_by_scrolling() -> None:
    app = OneTable()
    async with app.run_test(size=(14, 6)) as pilot:
        rows = app.query_one(Rows)
        rows.show(range(3), lambda key: (str(key), f"row {key}"))
        await pilot.pause()
        assert (said(rows, 0), said(rows, 1)) == ("   number  nam", "        0  row")
        rows.scroll_to(x=8, animate=False, immediate=True)
        await pilot.pause()
        assert (said(rows, 0), said(rows, 1)) == ("r  name", "0  row 0")


async def test_keys_and_clicks_choose_a_row_that_stays_in_sight() -> None:
    app = OneTable()
    async with app.run_test(size=(60, 20)) as pilot:
        rows = app.query_one(Rows)
        rows.show(range(100), lambda key: (str(key), "x"))
        rows.focus()
        await pilot.press("down", "down", "up", "pagedown")
        assert rows.chosen == 19
        await pilot.pause()
        assert said(rows, 19).split() == ["19", "x"]
        await pilot.press("home", "up")
        assert rows.chosen == 0
        await pilot.click(rows, offset=(3, 5))
        assert rows.chosen == 4
        await pilot.click(rows, offset=(3, 0))
        assert rows.chosen == 4, "the header is no row"


async def test_a_chosen_row_stays_chosen_where_it_stands_on_the_screen_and_the_first_place_shows_the_newest() -> None:
    app = OneTable()
    async with app.run_test(size=(60, 20)) as pilot:
        rows = app.query_one(Rows)
        rows.show([*range(50, 0, -1)], lambda key: (str(key), "x"))
        await pilot.pause()
        rows.show([*range(60, 0, -1)], lambda key: (str(key), "x"))
        assert rows.chosen == 60
        rows.focus()
        await pilot.press("down", "down")
        rows.show([*range(90, 0, -1)], lambda key: (str(key), "x"))
        await pilot.pause()
        assert rows.chosen == 58
        assert said(rows, 3).split() == ["58", "x"]
        rows.show([3, 2], lambda key: (str(key), "x"))
        await pilot.pause()
        assert rows.chosen == 2
        rows.show([], lambda key: (str(key), "x"))
        await pilot.pause()
        assert rows.chosen is None
        assert said(rows, 1) == ""

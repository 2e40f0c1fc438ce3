"""What is printed for people does not depend on a width that some other program has stated."""

import io

import pytest

from sim.console import Console, table


@pytest.mark.parametrize(("columns", "lines"), [("0", 1), ("1", 1), ("abc", 1), ("40", 5)])
def test_a_width_in_which_nothing_fits_is_none(monkeypatch: pytest.MonkeyPatch, columns: str, lines: int) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    said = io.StringIO()
    Console(file=said).print("words " * 30)
    assert len(said.getvalue().splitlines()) == lines


def test_a_name_that_is_wider_than_its_column_is_not_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    said = io.StringIO()
    Console(file=said).print(table(["scenario", "what it is"], [["contention_broadcast", "many stations in a disc"]]))
    assert "".join(line[:15].strip() for line in said.getvalue().splitlines()[1:]) == "contention_broadcast"

"""What is printed for people does not depend on a width that some other program has stated."""

import io

import pytest

from sim.console import Console


@pytest.mark.parametrize(("columns", "lines"), [("0", 1), ("1", 1), ("abc", 1), ("40", 5)])
def test_a_width_in_which_nothing_fits_is_none(monkeypatch: pytest.MonkeyPatch, columns: str, lines: int) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    said = io.StringIO()
    Console(file=said).print("words " * 30)
    assert len(said.getvalue().splitlines()) == lines

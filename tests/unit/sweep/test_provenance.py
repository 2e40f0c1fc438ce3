"""The code of a row: what it notices, and what it does not."""

from pathlib import Path

import pytest

from sim.scenarios.shipped import entry
from sim.sweep.provenance import digest, meaning
from sim.sweep.spec import Sweep
from sim.sweep.tasks import tasks_of

SOURCE = b'''"""A module."""

LIMIT = 3  # of something


class Table:
    """A table."""

    width: int = 4
    """How wide it is."""

    def area(self, height: int) -> int:
        """The area."""
        return self.width * height if height is not None else LIMIT
'''


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"of something", b"of something else"),
        (b'"""A module."""', b'"""Another text."""'),
        (b'    """A table."""\n\n', b""),
        (b"How wide it is.", b"Its width."),
        (b"The area.", b"The area of it."),
        (b"self.width * height", b"(self.width\n * height)"),
    ],
)
def test_words_and_layout_do_not_change_the_code(old: bytes, new: bytes) -> None:
    assert SOURCE.count(old) == 1
    assert meaning(SOURCE.replace(old, new)) == meaning(SOURCE)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"LIMIT = 3", b"LIMIT = 4"),
        (b"LIMIT = 3", b"LIMIT = 3.0"),
        (b"LIMIT = 3", b"LIMIT = '3'"),
        (b"LIMIT = 3", b"LIMIT = None"),
        (b"self.width * height", b"self.width + height"),
        (b"is not None", b"is None"),
        (b"(self, height: int)", b"(self, *, height: int)"),
        (b"def area", b"def extent"),
    ],
)
def test_what_is_done_changes_the_code(old: bytes, new: bytes) -> None:
    assert meaning(SOURCE.replace(old, new)) != meaning(SOURCE)


def test_the_digest_knows_contents_that_were_parsed_once_and_parses_others(tmp_path: Path) -> None:
    kept = tmp_path / "__pycache__" / "code.json"
    first = digest([("a.py", SOURCE), ("b.py", b"x = 1")], kept)
    assert kept.exists()
    assert digest([("a.py", SOURCE), ("b.py", b"x = 1  # one")], kept) == first
    assert digest([("a.py", SOURCE), ("b.py", b"x = 2")], kept) != first
    assert digest([("a.py", SOURCE), ("c.py", b"x = 1")], kept) != first, "a module has another name"
    kept.write_text("[half a fi", "utf-8")
    assert digest([("a.py", SOURCE), ("b.py", b"x = 1")], kept) == first


def test_a_folder_that_cannot_be_written_costs_time_alone(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    assert digest([("a.py", SOURCE)], blocked / "code.json") == digest([("a.py", SOURCE)], tmp_path / "code.json")


def test_a_changed_scenario_file_gives_runs_other_keys(tmp_path: Path) -> None:
    text = entry("flooding").text

    def keys(content: str) -> list[str]:
        path = tmp_path / "flooding.toml"
        path.write_text(content, "utf-8")
        return [task.key for task in tasks_of(Sweep(base=str(path)))]

    assert keys(text) == [task.key for task in tasks_of(Sweep(base="flooding"))]
    assert keys(f"# a comment\n{text}") == keys(text)
    assert "count = 45" in text
    assert keys(text.replace("count = 45", "count = 44")) != keys(text)

"""Measured tables in the documents: every one is found, compared number by number, and written in place."""

import pytest

from tests.tables.markdown import Tolerance, begin, differences, end, names, near, read, replaced
from tests.tables.registry import DOCUMENTS, TABLES

TEXT = f"""Before.

{begin("speed")}
| case | ours | wall s |
|---|---|---|
| one | 0.95 (0.02) | 3 |
{end("speed")}

After.
"""
HEAD = ["case", "ours", "wall s"]
ROWS = [HEAD, ["one", "0.95 (0.02)", "3"]]
WITHIN = Tolerance(absolute=0.01)


def test_every_measured_table_of_the_documents_is_one_that_a_command_writes_and_the_other_way_round() -> None:
    marked = {
        (name, str(document.relative_to(DOCUMENTS)))
        for document in DOCUMENTS.rglob("*.md")
        for name in names(document.read_text("utf-8"))
    }
    assert marked == {(name, table.document) for name, table in TABLES.items()}
    for name, table in TABLES.items():
        assert len(read(table.path.read_text("utf-8"), name)) > 1, f"{name} is empty"


def test_a_table_is_read_from_between_its_markers_and_written_there() -> None:
    assert read(TEXT, "speed") == ROWS
    changed = replaced(TEXT, "speed", [["a", "b"], ["1", "2"]])
    assert read(changed, "speed") == [["a", "b"], ["1", "2"]]
    assert changed.startswith("Before.\n\n")
    assert changed.endswith("\n\nAfter.\n")
    assert read(replaced(changed, "speed", ROWS), "speed") == ROWS


@pytest.mark.parametrize("text", ["", begin("speed"), TEXT + TEXT])
def test_a_table_without_its_markers_once_each_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="once each"):
        replaced(text, "speed", ROWS)


@pytest.mark.parametrize(
    ("said", "found", "agrees"),
    [
        ("0.95", "0.96", True),
        ("0.95", "0.97", False),
        ("0.95 (0.02)", "0.95 (0.05)", False),
        ("12,345", "12,345.4", False),
        ("12,345", "12,345", True),
        ("yes", "no", False),
        ("-0.95", "0.95", False),
        ("none of 20,196", "none of 20,196", True),
    ],
)
def test_cells_agree_if_their_words_are_the_same_and_their_numbers_near(said: str, found: str, agrees: bool) -> None:
    assert near(said, found, WITHIN) is agrees


def test_what_differs_is_said_by_row_and_column_and_what_depends_on_the_machine_is_not_asked() -> None:
    slower = [HEAD, ["one", "0.90 (0.02)", "30"]]
    assert differences(ROWS, slower, WITHIN, machine=["wall s"]) == [
        "one, ours: 0.95 (0.02) in the document, 0.90 (0.02) measured"
    ]
    assert len(differences(ROWS, slower, WITHIN)) == 2
    assert differences(ROWS, [HEAD], WITHIN) == ["1 rows in the document, 0 measured"]
    assert differences([["x"]], ROWS, WITHIN)[0].startswith("head: ")
    assert differences(ROWS, ROWS, Tolerance()) == []

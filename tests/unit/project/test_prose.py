"""Docstrings and comments speak of things and not of their authors: no sentence says we or our."""

import io
import re
import tokenize
from collections.abc import Iterator

import pytest
from test_documents import ROOT

_AUTHORS = re.compile(r"\b(we|our|ours|ourselves)\b", re.IGNORECASE)


def prose(text: str) -> Iterator[tuple[int, str]]:
    """Comments, and strings that stand alone, with the lines where they begin."""
    before = tokenize.NEWLINE
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT or (
            token.type == tokenize.STRING and before in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
        ):
            yield token.start[0], token.string
        if token.type not in (tokenize.COMMENT, tokenize.NL):
            before = token.type


@pytest.mark.parametrize("folder", ["fanet_mw", "agents", "emulator", "sim"])
def test_no_sentence_speaks_of_its_authors(folder: str) -> None:
    paths = {*(ROOT / folder).rglob("*.py")} - {ROOT / "fanet_mw" / "dialect" / "fanet.py"}
    said = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted(paths)
        for line, sentence in prose(path.read_text(encoding="utf-8"))
        if _AUTHORS.search(sentence)
    ]
    assert paths
    assert not said


def test_a_sentence_of_an_author_is_found_in_docstrings_and_comments_and_not_in_code() -> None:
    text = '"""The law."""\n\nour = "we"  # as we found\n\n\nclass A:\n    """Ours."""\n    x: int\n'
    text += '    """What we hold."""\n'
    assert [line for line, sentence in prose(text) if _AUTHORS.search(sentence)] == [3, 7, 9]

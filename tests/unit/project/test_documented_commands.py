"""Every `fanet` command that a document shows is one that there is, with flags that it has."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclopts import CycloptsError

from sim.cli.app import app, changes_last

ROOT = Path(__file__).parents[3]
PAGES = sorted(
    {*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")} - {ROOT / "CHANGELOG.md"}
)
_BLOCK = re.compile(r"^ *```(?:console|sh|bash)?\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
_INLINE = re.compile(r"`fanet ([a-z][\w-]*)")
_NO_COMMANDS = {"rescue", "simul"}
"""The words behind `fanet` in titles of processes, and where completion is shown."""


def shown(text: str) -> Iterator[str]:
    """The commands in blocks of a page, one by one, without prompts, comments and what becomes of their output."""
    for block in _BLOCK.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|\||;", re.sub(r"\s#.*", "", line.strip().removeprefix("$ "))):
                command = re.sub(r">.*|&$", "", part).strip()
                if re.match(r"(\S*/)?fanet\s", command):
                    yield command


def test_every_command_that_is_shown_is_understood() -> None:
    commands = {(page, command) for page in PAGES for command in shown(page.read_text(encoding="utf-8"))}
    assert len(commands) > 50
    refused = []
    for page, command in sorted(commands):
        try:
            app.parse_args(changes_last(shlex.split(command)[1:]), print_error=False, exit_on_error=False)
        except CycloptsError as error:
            refused.append(f"{page.relative_to(ROOT)}: {command}: {error}")
    assert not refused


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_that_a_sentence_names_there_is(page: Path) -> None:
    named = set(_INLINE.findall(page.read_text(encoding="utf-8"))) - _NO_COMMANDS
    assert named <= set(app)

"""The page of results says of each figure of a summary what its definition in the source says."""

import runpy
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "generate_summary_reference.py"))


def test_a_page_that_is_not_what_the_source_says_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = SCRIPT["main"]
    assert main(["--check"]) == 0, "run scripts/generate_summary_reference.py"
    page = tmp_path / "results.md"
    page.write_text(SCRIPT["DOCUMENT"].read_text(encoding="utf-8").replace("| `pdr` |", "| `prd` |"), encoding="utf-8")
    assert main(["--check"], document=page) == 1
    assert "not what the source says" in capsys.readouterr().err
    assert main([], document=page) == 0
    assert page.read_text(encoding="utf-8") == SCRIPT["DOCUMENT"].read_text(encoding="utf-8")


def test_a_page_without_the_marks_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_text("nothing", encoding="utf-8")
    assert SCRIPT["main"]([], document=page) == 1
    assert SCRIPT["main"](["--chek"], document=page) == 2


def test_no_figure_is_defined_twice() -> None:
    figures = tomllib.loads(SCRIPT["FIGURES"].read_text(encoding="utf-8"))
    keys = [key for group in figures for key in group.split(", ")]
    assert len(keys) == len(set(keys))

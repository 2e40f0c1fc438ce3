"""The tutorial prints what it says: every command of it is run again."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_commands_of_the_tutorial_print_what_stands_below_them() -> None:
    main = runpy.run_path(str(ROOT / "scripts" / "transcripts.py"))["main"]
    assert main(["--check"]) == 0


def test_the_scenario_file_of_the_tutorial_is_the_one_that_is_written(tmp_path: Path) -> None:
    """The meanings of the keys change more often than anything else that the pages print."""
    script = runpy.run_path(str(ROOT / "scripts" / "transcripts.py"))
    page = (ROOT / "docs" / "tutorial" / "first-swarm.md").read_text(encoding="utf-8")
    (block,) = [found[0] for found in script["BLOCK"].finditer(page) if "fanet init" in found[0]]
    assert script["played"](block, tmp_path) == block


def test_a_page_is_played_and_a_changed_output_is_noticed(tmp_path: Path) -> None:
    played = runpy.run_path(str(ROOT / "scripts" / "transcripts.py"))["played"]
    page = "```python\n# two.py\nprint(1 + 1)\n```\n\n```console\n$ python two.py\n3\n$ cat two.py | head -1\n```\n"
    now = played(page, tmp_path)
    assert now == page.replace("\n3\n", "\n2\n").replace("head -1\n", "head -1\n# two.py\n")


def test_a_block_of_toml_is_a_file_and_how_long_a_sweep_took_is_not_compared(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "transcripts.py"))
    page = "```toml\n# some.toml\na = 1\n```\n\n```console\n$ cat some.toml\n```\n"
    assert script["played"](page, tmp_path).endswith("```console\n$ cat some.toml\n# some.toml\na = 1\n```\n")
    said = "relays: 15 of 40 runs, about 24 s left\n40 rows, 40 of them new, in 42 s (10 s of CPU)\n"
    assert script["TIMES"].sub("", said) == "40 rows, 40 of them new, \n"

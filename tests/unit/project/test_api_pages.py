"""The pages of the Python interface hold every public name, and say of each what it is."""

import re
import runpy
from pathlib import Path

import pytest

import fanet_mw
from fanet_mw.testing import plugin

ROOT = Path(__file__).parents[3]
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "generate_api_reference.py"))
PAGES = {name: SCRIPT["page"](name) for name in SCRIPT["PAGES"]}


def test_every_public_name_is_described_once() -> None:
    described = [name for page in PAGES.values() for name in re.findall("^### (.*)$", page, re.MULTILINE)]
    fixtures = {"swarm", "real_swarm"}
    assert sorted(described) == sorted((set(fanet_mw.__all__) - {"__version__"}) | fixtures)
    assert fixtures <= set(plugin.__all__)


@pytest.mark.parametrize("name", PAGES)
def test_each_name_says_what_it_is(name: str) -> None:
    for section in re.split("^### ", PAGES[name], flags=re.MULTILINE)[1:]:
        title, _, text = section.partition("\n")
        assert [line for line in text.splitlines() if not re.fullmatch(r"(\|.*|#.*|`[^`]*`)?", line)], title


def test_a_page_that_is_not_what_the_source_says_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main = SCRIPT["main"]
    assert main(["--check"]) == 0, "run scripts/generate_api_reference.py"
    assert main([], folder=tmp_path) == 0
    (tmp_path / "api.md").write_text("nothing")
    assert main(["--check"], folder=tmp_path) == 1
    assert "api.md: not what the source says" in capsys.readouterr().err
    assert main(["--chek"]) == 2

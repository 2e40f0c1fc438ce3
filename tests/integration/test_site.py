"""The documentation site builds without a network from the pages there are, and its links lead somewhere."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "build_site.py"
PAGE = '<html><body><h1 id="one">One</h1>{}</body></html>'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("built") / "site"
    done = subprocess.run([sys.executable, SCRIPT, out], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "0 broken links" in done.stdout
    return out


def test_the_site_has_every_page_its_pictures_and_a_search(site: Path) -> None:
    docs = SCRIPT.parents[1] / "docs"
    pages = {path.relative_to(docs).with_suffix(".html") for path in docs.rglob("*.md")} - {Path("README.html")}
    assert not {page for page in pages if not (site / page).exists()}
    assert (site / "how-to" / "view.png").exists()
    assert "guard time" in (site / "search.json").read_text("utf-8")
    front = (site / "index.html").read_text("utf-8")
    assert 'href="how-to/see-a-swarm.html' in front
    assert (site / "source" / "fanet_mw" / "mavlink.py.txt").exists(), "a page links it"


def test_links_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("build_site", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (tmp_path / "b.html").write_text(PAGE.format('<a href="a.html#one">fine</a><img src="data:image/png;base64,">'))
    (tmp_path / "a.html").write_text(
        PAGE.format('<a href="b.html#two">x</a><a href="c.html">x</a><script src="https://else.where/x.js"></script>')
    )
    assert module.check(tmp_path) == [
        "a.html: loads https://else.where/x.js",
        "a.html: b.html#two has no such heading",
        "a.html: c.html does not exist",
    ]

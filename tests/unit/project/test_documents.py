"""Documents lead where they say: every relative link, and every file of ours that is named with its folder, exists."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGES = sorted(
    {*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")} - {ROOT / "CHANGELOG.md"}
)
SOURCES = ("fanet_mw", "agents", "emulator", "sim")
_LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]+)?\)")
_FILE = re.compile(r"(?<![\w./-])((?:fanet_mw|agents|emulator|sim|tests|scripts|docs|examples)/[\w./-]*\w)(?![\w*{<])")
_WITH_FOLDER = re.compile(r"`([\w.-]+/[\w./-]*\w\.py)`")
_FENCED = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
_BELOW_HEAD = re.compile(r"\|[|: -]*-[|: -]*")
_ALONE = re.compile(r"`([a-z]\w*\.py)`")


def links(page: Path) -> Iterator[Path]:
    for target, _ in _LINK.findall(page.read_text(encoding="utf-8")):
        if "://" not in target and not target.startswith("mailto:"):
            yield page.parent / target


def names(page: Path) -> Iterator[str]:
    for name in _FILE.findall(page.read_text(encoding="utf-8")):
        if Path(name).suffix in {".py", ".toml", ".md", ".xml", ".csv", ".cc", ".sh"}:
            yield name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_and_every_file_that_it_names_exists(page: Path) -> None:
    missing = [str(target) for target in links(page) if not target.exists()]
    missing += [name for name in names(page) if not (ROOT / name).exists()]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_table_has_its_head_and_no_row_stands_apart_from_it(page: Path) -> None:
    lines = ["", *_FENCED.sub("", page.read_text(encoding="utf-8")).splitlines(), ""]
    firsts = [at for at in range(1, len(lines) - 1) if lines[at].startswith("|") and not lines[at - 1].startswith("|")]
    assert [lines[at] for at in firsts if not _BELOW_HEAD.fullmatch(lines[at + 1])] == []


def test_every_file_of_ours_that_source_text_names_exists() -> None:
    folders = ("fanet_mw", "agents", "emulator", "sim", "tests", "scripts")
    sources = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".toml"}]
    assert sources
    missing = {name: str(source) for source in sources for name in names(source) if not (ROOT / name).exists()}
    assert not missing


def test_a_file_that_source_text_names_by_itself_lies_beside_it() -> None:
    sources = [path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")]
    named = ((source, name) for source in sources for name in _ALONE.findall(source.read_text(encoding="utf-8")))
    astray = [(str(source), name) for source, name in named if not (source.parent / name).exists()]
    assert not astray, "a file of another folder is named with its path"


def test_a_file_that_source_text_names_with_a_part_of_its_path_exists_somewhere() -> None:
    ours = [
        path.relative_to(ROOT) for folder in (*SOURCES, "tests", "scripts") for path in (ROOT / folder).rglob("*.py")
    ]
    ends = {"/".join(path.parts[at:]) for path in ours for at in range(len(path.parts))}
    sources = [path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")]
    named = [(source, name) for source in sources for name in _WITH_FOLDER.findall(source.read_text(encoding="utf-8"))]
    assert named
    assert [(str(source), name) for source, name in named if name not in ends] == []


def test_every_file_that_an_explanation_names_by_itself_exists_somewhere() -> None:
    ours = {path.name for folder in (*SOURCES, "tests", "scripts") for path in (ROOT / folder).rglob("*.py")}
    pages = [page for page in PAGES if page.parent.name == "explanation"]
    named = ((str(page), name) for page in pages for name in _ALONE.findall(page.read_text(encoding="utf-8")))
    assert [(page, name) for page, name in named if name not in ours] == []


def anchor(heading: str) -> str:
    """The name that a heading gets on the page, as GitHub makes it."""
    return re.sub(r"[^\w\s-]", "", heading.lstrip("#").strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_to_a_heading_finds_it(page: Path) -> None:
    missing = []
    for target, name in _LINK.findall(page.read_text(encoding="utf-8")):
        if name and "://" not in target:
            lines = (page.parent / target if target else page).read_text(encoding="utf-8").splitlines()
            if name[1:] not in {anchor(line) for line in lines if line.startswith("#")}:
                missing.append(target + name)
    assert not missing

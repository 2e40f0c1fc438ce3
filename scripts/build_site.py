#!/usr/bin/env python
"""Builds the documentation site from the pages there are, without a network, and checks every link in it.

    scripts/build_site.py [FOLDER]     by default into site/; needs zensical (of the development group)

The pages are copied to a temporary folder: README.md becomes the front page, docs/README.md the list of documents. What
a page links outside of docs/ is copied beside them as text, so the site works without the repository.
"""

import argparse
import html.parser
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final
from urllib.parse import unquote

ROOT: Final = Path(__file__).parents[1]
TOP: Final = {"README.md": "index.md", "docs/README.md": "documents.md", "ARCHITECTURE.md": "architecture.md",
              "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}  # fmt: skip
SECTIONS: Final = (("Tutorial", "tutorial"), ("How to", "how-to"), ("Reference", "reference"),
                   ("Explanation", "explanation"), ("Results", "results"))  # fmt: skip
LINK: Final = re.compile(r"(\]\()([^)\s]+)(\))")
CONFIG: Final = """
[project]
site_name = "fanet-mw"
site_description = "Middleware for swarms of UAVs, and the network emulator on which it is proven"
docs_dir = "docs"
site_dir = "site"
use_directory_urls = false
nav = {nav}

[project.theme]
font = false
features = ["navigation.tabs", "navigation.top", "search.highlight", "content.code.copy", "toc.follow"]

[[project.theme.palette]]
media = "(prefers-color-scheme: light)"
scheme = "default"
primary = "indigo"

[[project.theme.palette]]
media = "(prefers-color-scheme: dark)"
scheme = "slate"

[project.markdown_extensions.tables]
[project.markdown_extensions.toc]
permalink = true
slugify = {{ object = "pymdownx.slugs.slugify", kwds = {{ case = "lower" }} }}
[project.markdown_extensions.pymdownx.highlight]
[project.markdown_extensions.pymdownx.superfences]
"""


def main() -> int:
    """Build and check; returns the exit code."""
    flags = argparse.ArgumentParser(description="Builds the documentation site, and checks its links.")
    flags.add_argument("folder", nargs="?", type=Path, default=ROOT / "site")
    out = flags.parse_args().folder.resolve()
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        missing = _stage(work / "docs")
        (work / "zensical.toml").write_text(CONFIG.format(nav=_nav()), encoding="utf-8")
        tool = Path(sys.executable).with_name("zensical")
        built = subprocess.run([tool, "build"], cwd=work, capture_output=True, text=True, check=False)  # noqa: S603
        if built.returncode:
            sys.stderr.write(built.stdout + built.stderr)
            return built.returncode
        wrong = [*missing, *check(work / "site")]
        if out.exists():
            shutil.rmtree(out)
        shutil.move(work / "site", out)
    for line in wrong[:50]:
        sys.stderr.write(f"{line}\n")
    pages = len(list(out.rglob("*.html")))
    sys.stdout.write(f"{out}: {pages} pages, {len(wrong)} broken links\n")
    return 1 if wrong else 0


def _pages() -> dict[str, str]:
    """The path of each page in the site, by its path in the repository."""
    docs = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
    examples = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "examples").rglob("*.md"))
    return {path: path.removeprefix("docs/") for path in (*docs, *examples)} | TOP


def _stage(folder: Path) -> list[str]:
    """Copy pages and what they link; returns the links that lead nowhere."""
    pages, wrong = _pages(), []
    for path in (ROOT / "docs").rglob("*"):
        if path.is_file() and path.suffix != ".md":
            target = folder / path.relative_to(ROOT / "docs")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, target)
    for source, staged in pages.items():

        def moved(match: re.Match[str], source: str = source, staged: str = staged) -> str:
            target = _moved(match.group(2), source, staged, pages, folder)
            if target is None:
                wrong.append(f"{source}: {match.group(2)} does not exist")
                return match.group()
            return match.group(1) + target + match.group(3)

        text = (ROOT / source).read_text(encoding="utf-8")
        (folder / staged).parent.mkdir(parents=True, exist_ok=True)
        (folder / staged).write_text(_outside_code(text, moved), encoding="utf-8")
    return wrong


def _outside_code(text: str, moved: Callable[[re.Match[str]], str]) -> str:
    """The text with its links moved, but for those in blocks of code."""
    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else LINK.sub(moved, part) for part in parts)


def _moved(link: str, source: str, staged: str, pages: dict[str, str], folder: Path) -> str | None:
    """A link of a page as it is in the site; None if it leads nowhere."""
    path, hash_, anchor = link.partition("#")
    if not path or "://" in path or path.startswith("mailto:"):
        return link
    target = os.path.normpath(Path(source).parent / path)
    here = str(Path(staged).parent)
    if target in pages:
        return os.path.relpath(pages[target], here) + hash_ + anchor
    if not (ROOT / target).exists() or target.startswith(".."):
        return None
    if target.startswith("docs/"):
        return os.path.relpath(target.removeprefix("docs/"), here) + hash_ + anchor
    if (ROOT / target).is_dir():
        files = sorted(path.name for path in (ROOT / target).iterdir() if not path.name.startswith((".", "__")))
        content, name = "\n".join(files) + "\n", f"source/{target}/index.txt"
    else:
        content, name = (ROOT / target).read_text(encoding="utf-8"), f"source/{target}.txt"
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(content, encoding="utf-8")
    return os.path.relpath(name, here)


def _nav() -> str:
    """The navigation, as TOML: the front page, the sections, and what is about the project."""
    pages = _pages()

    def entry(source: str) -> str:
        found = re.search(r"^# (.+)$", (ROOT / source).read_text(encoding="utf-8"), re.MULTILINE)
        title = found.group(1) if found else source
        return f"{{ {_quoted(title)} = {_quoted(pages[source])} }}"

    groups = [f'{{ "Home" = [{{ "fanet-mw" = "index.md" }}, {entry("docs/README.md")}] }}']
    for title, folder in SECTIONS:
        inside = [entry(source) for source in pages if source.startswith(f"docs/{folder}/")]
        groups.append(f"{{ {_quoted(title)} = [{', '.join(inside)}] }}")
    about = [entry(source) for source in ("ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    groups.append(f'{{ "Project" = [{", ".join(about)}] }}')
    return f"[{', '.join(groups)}]"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("`", "") + '"'


class _Links(html.parser.HTMLParser):
    """The links and anchors of one page, and what it would load from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := given.get(name))}
        link = given.get("href") or given.get("src")
        if link:
            rel = given.get("rel") or ""
            loads = tag in ("script", "img", "iframe") or (tag == "link" and "canonical" not in rel)
            (self.loaded if loads else self.links).append(link)


def check(site: Path) -> list[str]:
    """What is wrong with the links of a site: targets and anchors that are missing, and what is loaded from others."""
    pages: dict[Path, _Links] = {}
    for path in sorted(site.rglob("*.html")):
        pages[path] = _Links()
        pages[path].feed(path.read_text(encoding="utf-8"))
    wrong = []
    for path, found in pages.items():
        where = path.relative_to(site)
        wrong += [f"{where}: loads {link}" for link in found.loaded if "://" in link or link.startswith("//")]
        for link in [*found.links, *found.loaded]:
            target, _, anchor = link.partition("#")
            if "://" in link or link.startswith(("mailto:", "//", "data:", "javascript:")) or path.name == "404.html":
                continue
            goal = (path.parent / unquote(target)).resolve() if target else path
            goal = goal / "index.html" if goal.is_dir() else goal
            if not goal.exists():
                wrong.append(f"{where}: {link} does not exist")
            elif anchor and goal in pages and unquote(anchor) not in pages[goal].anchors:
                wrong.append(f"{where}: {link} has no such heading")
    return wrong


if __name__ == "__main__":
    sys.exit(main())

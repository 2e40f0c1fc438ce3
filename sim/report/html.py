"""A page as a list of blocks, which is written as one self-contained HTML file, and as Markdown with pictures beside
it.
"""

import base64
import html
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from fanet_mw.foreign_file import read_regular

_MOST_BYTES: Final = 1 << 26
"""The greatest size of a picture."""
_STYLE: Final = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 72rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.3rem; margin-top: 2.5rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: .8rem 0; font-size: .93rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .7rem; border-bottom: 1px solid #ddd; }
td div { min-width: 16rem; margin-bottom: .5rem; }
th { background: #f3f3f3; } figure { margin: 1rem 0; } figure img { max-width: 100%; height: auto; }
figcaption { color: #444; font-size: .93rem; } code, pre { background: #f5f5f5; font-size: .9rem; }
pre { padding: .7rem; overflow-x: auto; } .wide { overflow-x: auto; } .short { white-space: nowrap; }
.wide td:not([class]) { min-width: 10rem; }
.agrees { color: #00543d; font-weight: 600; }
.partly { color: #7a4b00; font-weight: 600; } .differs { color: #9c2a00; font-weight: 600; }
@media (max-width: 40rem) { body { margin: 1rem auto; padding: 0 .8rem; } th, td { padding: .25rem .45rem; }
  .cards thead { display: none; } .cards tr { display: block; padding: .5rem 0; border-bottom: 1px solid #bbb; }
  .cards td, .cards td:not([class]) { display: flex; min-width: 0; padding: .1rem .3rem; border: 0; }
  .cards td::before { content: attr(data-column); flex: 0 0 9rem; color: #555; }
  .cards td.short { white-space: normal; } .cards td:first-child { font-weight: 600; } }
"""


class Heading(NamedTuple):
    """The title of a part of the page."""

    text: str
    level: int = 2


class Text(NamedTuple):
    """A paragraph of the page."""

    text: str


class Quoted(NamedTuple):
    """A paragraph that somebody else has written: shown as it is, whatever it would mean in HTML or Markdown."""

    text: str


class Commands(NamedTuple):
    """Lines to be typed into a shell."""

    lines: Sequence[str]


class Picture(NamedTuple):
    """A PNG with its caption."""

    path: Path
    caption: str


class Rows(NamedTuple):
    """A table; a cell that is a verdict is shown as one."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


Block = Heading | Text | Quoted | Commands | Picture | Rows
_FIRST: Final = re.compile(r"^(\d*)([-+=.)#>])")
"""The beginning of a line that Markdown would take for that of a list, a heading or a quotation."""
_INSIDE: Final = re.compile(r"[\\`*_\[\]|~@]|(?<=\])\(|:(?=//)|(?<=www)\.", re.IGNORECASE)
"""The characters inside a line to which Markdown gives a meaning, among them those that make addresses links."""
_SHORT: Final = 21
"""A cell of at most so many characters, as a pair of coordinates, is not broken into lines."""
_MOST_COLUMNS: Final = 4
"""A row of a wider table is a card on a phone: a line for each column."""
_VERDICTS: Final = ("agrees", "partly", "differs")


def as_html(title: str, blocks: Iterable[Block]) -> str:
    """The page with its pictures inside, so that it can be mailed and opened without a network."""
    body = "\n".join(_html(block) for block in blocks)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>{html.escape(title)}</title>\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{html.escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def _html(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"<h{level}>{html.escape(text)}</h{level}>"
        case Text(text) | Quoted(text):
            return f"<p>{html.escape(text)}</p>"
        case Commands(lines):
            return f"<pre>{html.escape(chr(10).join(lines))}</pre>"
        case Picture(path, caption):
            image = base64.b64encode(read_regular(path, most_bytes=_MOST_BYTES, follow=False)).decode()
            said = html.escape(caption)
            drawn = f'<img alt="{said}" src="data:image/png;base64,{image}">'
            return f"<figure>{drawn}<figcaption>{said}</figcaption></figure>"
        case Rows(head, rows):
            cards = len(head) > _MOST_COLUMNS
            columns = head if cards else [""] * len(head)
            first = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
            rest = "".join(f"<tr>{''.join(map(_cell, row, columns))}</tr>\n" for row in rows)
            table = f"<thead><tr>{first}</tr></thead>\n<tbody>{rest}</tbody>"
            return f'<div class="wide"><table{" class=cards" if cards else ""}>{table}</table></div>'


def _cell(text: str, column: str) -> str:
    """A cell; with the name of its column where a narrow screen shows that beside it."""
    kind = f' class="{text}"' if text in _VERDICTS else ' class="short"' if len(text) <= _SHORT else ""
    lines = html.escape(text).split("\n")
    inside = lines[0] if len(lines) == 1 else "".join(f"<div>{line}</div>" for line in lines)
    named = f' data-column="{html.escape(column)}"' if column else ""
    return f"<td{kind}{named}>{inside}</td>"


def as_markdown(title: str, blocks: Iterable[Block], folder: Path) -> str:
    """The page as Markdown for this folder; pictures are linked by their paths relative to it."""
    return "\n\n".join([f"# {title}", *(_markdown(block, folder.resolve()) for block in blocks)]) + "\n"


def _markdown(block: Block, folder: Path) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {_without_tags(text)}"
        case Text(text):
            return text
        case Quoted(text):
            return _inert(_FIRST.sub(r"\1\\\2", " ".join(text.split())))
        case Commands(lines):
            return "\n".join(["```", *lines, "```"])
        case Picture(path, caption):
            place = path.resolve()
            near = place.relative_to(folder) if place.is_relative_to(folder) else place
            return f"![{_without_tags(caption).replace(']', ')')}]({near.as_posix()})"
        case Rows(head, rows):
            table: list[Sequence[str]] = [head, ["---"] * len(head), *rows]
            return "\n".join(f"| {' | '.join(_plain(cell) for cell in line)} |" for line in table)


def _plain(text: str) -> str:
    return _without_tags(text).replace("|", "\\|").replace("\n", "<br>")


def _without_tags(text: str) -> str:
    """Text in which nothing is HTML or the beginning of a link."""
    return text.replace("<", "&lt;").replace("](", "] (").replace("![", "! [")


def _inert(text: str) -> str:
    return _INSIDE.sub(r"\\\g<0>", text).replace("&", "&amp;").replace("<", "&lt;")

"""Identifies the code that produced a row: the version, and a digest of what the sources mean on which a row depends.

The digest is of syntax trees without documentation (strings that stand alone) and without positions. Comments,
docstrings and layout therefore change nothing, and one changed constant does. The scenario of a run is not in it:
whatever a shipped scenario file sets is part of the key of the run (`tasks.py`).

Parsing all sources takes seconds, so the digest of each file is kept in a file of Python's cache folder, under the
hash of the file's bytes.
"""

import ast
import contextlib
import functools
import hashlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Final

from fanet_mw import __version__

_PARTS: Final = (
    ("fanet_mw", "**/*.py"), ("agents", "**/*.py"), ("emulator", "**/*.py"), ("sim.run", "**/*.py"),
    ("sim.results", "**/*.py"), ("sim.world", "**/*.py"), ("sim.sweep", "measures.py"),
)  # fmt: skip
"""Changes in the command line, in the rest of sweeps and in figures change no row, so the digest leaves them out."""

_KEPT: Final = Path(__file__).parent / "__pycache__" / f"code-{sys.implementation.cache_tag}.json"


@functools.cache
def code() -> str:
    """The version and the digest, for example `0.1.0+3f2a9c01`."""
    return f"{__version__}+{digest(_sources(), _KEPT)[:8]}"


def digest(sources: Iterable[tuple[str, bytes]], kept: Path) -> str:
    """The digest of sources (name, content); `kept` is the file with the digests of contents that were parsed once."""
    known = _read(kept)
    meanings: dict[str, str] = {}
    whole = hashlib.sha256()
    for name, source in sources:
        content = hashlib.sha256(source).hexdigest()
        meanings[content] = known.get(content) or meaning(source)
        whole.update(f"{name} {meanings[content]}\n".encode())
    if not meanings.keys() <= known.keys():
        _write(kept, meanings)
    return whole.hexdigest()


def meaning(source: bytes) -> str:
    """The digest of one source's syntax tree; of its bytes where they are no Python, which nothing has imported."""
    try:
        words = "\n".join(_words(ast.parse(source)))
    except (SyntaxError, ValueError):
        return hashlib.sha256(source).hexdigest()
    return hashlib.sha256(words.encode("utf-8", "surrogatepass")).hexdigest()


def _words(value: object) -> Iterator[str]:
    """The tree in prefix order. A field that is empty is left out, so that those which later Pythons add are none."""
    match value:
        case ast.Constant():
            yield f"{type(value.value).__name__} {value.value!r}"
        case ast.AST():
            yield f"{type(value).__name__}("
            for name in value._fields:
                if (field := getattr(value, name, None)) not in (None, []):
                    yield f"{name}="
                    yield from _words(field)
            yield ")"
        case list():
            yield "["
            for element in value:
                if not _documents(element):
                    yield from _words(element)
            yield "]"
        case _:
            yield repr(value)


def _documents(element: object) -> bool:
    """True of a string that stands alone, as a statement."""
    return (
        isinstance(element, ast.Expr)
        and isinstance(element.value, ast.Constant)
        and isinstance(element.value.value, str)
    )


def _sources() -> Iterator[tuple[str, bytes]]:
    for package, pattern in _PARTS:
        folder = Path(str(files(package)))
        for path in sorted(folder.glob(pattern)):
            yield f"{package}/{path.relative_to(folder).as_posix()}", path.read_bytes()


def _read(kept: Path) -> Mapping[str, str]:
    try:
        found = json.loads(kept.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _write(kept: Path, meanings: Mapping[str, str]) -> None:
    """Write the file whole; where that cannot be done, the next process parses again, which only takes time."""
    with contextlib.suppress(OSError):
        kept.parent.mkdir(exist_ok=True)
        fresh = kept.with_name(f"{kept.stem}-{os.getpid()}.tmp")
        fresh.write_text(json.dumps(meanings), "utf-8")
        fresh.replace(kept)

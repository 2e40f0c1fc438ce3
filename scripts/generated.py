"""What the generators of this folder share: they write files, or with `--check` compare them with those checked in."""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path


def write_or_check(arguments: Sequence[str], *, script: str, wanted: Callable[[], Mapping[Path, str | None]]) -> int:
    """The exit code: 0 if all is written or as it should be, 1 if not, or if `wanted` raises ValueError, 2 for other
    arguments. `wanted`: the text of each file; None if it should not be there.
    """
    if arguments not in ([], ["--check"]):
        sys.stderr.write(f"usage: {script} [--check]; got {' '.join(arguments)}\n")
        return 2
    try:
        texts = wanted()
    except ValueError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    wrong = [path for path, text in texts.items() if (path.read_text("utf-8") if path.exists() else None) != text]
    for path in wrong:
        text = texts[path]
        if arguments:
            sys.stderr.write(f"{path}: not what the source says; run scripts/{script} and check the result in\n")
        elif text is None:
            path.unlink()
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
    return int(bool(arguments and wrong))


def between(document: Path, begin: str, end: str, part: str) -> dict[Path, str]:
    """The document with this part between two marks; raises ValueError when they are not there once."""
    text = document.read_text("utf-8")
    found = re.findall(f"{re.escape(begin)}.*?{re.escape(end)}", text, re.DOTALL)
    if len(found) != 1:
        raise ValueError(f"{document}: must hold {begin.strip()!r} and {end.strip()!r} once, in this order")
    return {document: text.replace(found[0], f"{begin}{part}{end}")}

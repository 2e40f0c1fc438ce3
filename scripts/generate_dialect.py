"""Generate fanet_mw/dialect/fanet.py from fanet.xml; `--check` compares with what is checked in.

The shipped XML includes common.xml, for other tools; the module is generated without the include, which makes 65 KB
instead of 1.5 MB: fanet_mw.mavlink joins its messages to pymavlink's own `common`.
"""

import contextlib
import difflib
import io
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from itertools import islice
from pathlib import Path

from pymavlink.generator import mavgen, mavparse

DIALECT = Path(__file__).resolve().parent.parent / "fanet_mw" / "dialect"
INCLUDE = "  <include>common.xml</include>\n"


class GenerationError(Exception):
    """The XML is not what it must be; the message is for a person."""


def generated(source: Path) -> str:
    """The module's text."""
    text = source.read_text(encoding="utf-8")
    if text.count(INCLUDE) != 1:
        raise GenerationError(f"{source}: must hold the line {INCLUDE.strip()!r} once, not {text.count(INCLUDE)} times")
    with tempfile.TemporaryDirectory() as folder:
        alone = Path(folder) / source.name
        alone.write_text(text.replace(INCLUDE, ""), encoding="utf-8")
        target = alone.with_suffix(".py")
        options = mavgen.Opts(
            str(target), wire_protocol=mavparse.PROTOCOL_2_0, language="Python3", validate=True, strict_units=True
        )
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                done = mavgen.mavgen(options, [str(alone)])
        except (Exception, SystemExit) as error:  # mavparse raises its own class, expat's and plain ones; it also exits
            raise GenerationError(f"{source}: {error}\n{said.getvalue()}") from error
        if not done or not target.exists():
            raise GenerationError(f"{source}: pymavlink refuses it:\n{said.getvalue()}")
        return target.read_text(encoding="utf-8")


def main(arguments: Sequence[str], *, dialect: Path = DIALECT) -> int:
    """Write the module, or with --check say whether it is the one checked in."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write(f"usage: generate_dialect.py [--check]; got {' '.join(arguments)}\n")
        return 2
    target = dialect / "fanet.py"
    try:
        text = generated(dialect / "fanet.xml")
    except GenerationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if not arguments:
        target.write_text(text, encoding="utf-8")
        return 0
    present = target.read_text(encoding="utf-8") if target.exists() else ""
    if present == text:
        return 0
    lines = difflib.unified_diff(present.splitlines(), text.splitlines(), "checked in", "generated", lineterm="", n=0)
    sys.stderr.write(
        f"{target} is not what fanet.xml gives with pymavlink {version('pymavlink')}; "
        "run scripts/generate_dialect.py and check the result in. The first differences:\n"
    )
    sys.stderr.writelines(f"  {line}\n" for line in islice(lines, 12))
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

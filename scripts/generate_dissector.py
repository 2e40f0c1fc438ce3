"""Generate emulator/wireshark/mavlink.lua.gz, Wireshark's dissector for `common` and our messages, with pymavlink's own
generator; `--check` compares with what is checked in.

Three megabytes of Lua, 50,000 lines: kept compressed, compared uncompressed (zlib's versions differ in bytes).
"""

import contextlib
import gzip
import io
import shutil
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from pymavlink.dialects.v20 import common
from pymavlink.generator import mavgen, mavparse

ROOT = Path(__file__).resolve().parent.parent
XML = ROOT / "fanet_mw" / "dialect" / "fanet.xml"
TARGET = ROOT / "emulator" / "wireshark" / "mavlink.lua.gz"
INCLUDED = ("common.xml", "standard.xml", "minimal.xml")
"""As pymavlink ships them."""


def generated(source: Path) -> str:
    """The dissector's text; raises ValueError with what pymavlink said."""
    theirs = Path(common.__file__).parent
    with tempfile.TemporaryDirectory() as folder:
        for path in (source, *(theirs / name for name in INCLUDED)):
            shutil.copy(path, folder)
        target = Path(folder) / "mavlink.lua"
        options = mavgen.Opts(str(target), wire_protocol=mavparse.PROTOCOL_2_0, language="WLua", validate=True)
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            done = mavgen.mavgen(options, [str(Path(folder) / source.name)])
        if not done or not target.exists():
            raise ValueError(f"{source}: pymavlink refuses it:\n{said.getvalue()}")
        return target.read_text(encoding="utf-8")


def main(arguments: Sequence[str], *, xml: Path = XML, target: Path = TARGET) -> int:
    """Write the dissector, or with --check say whether it is the one checked in."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write(f"usage: generate_dissector.py [--check]; got {' '.join(arguments)}\n")
        return 2
    text = generated(xml).encode()
    if not arguments:
        target.write_bytes(gzip.compress(text, mtime=0))
        return 0
    if target.exists() and gzip.decompress(target.read_bytes()) == text:
        return 0
    sys.stderr.write(
        f"{target} is not what {xml.name} gives with pymavlink {version('pymavlink')}; "
        "run scripts/generate_dissector.py and check the result in\n"
    )
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

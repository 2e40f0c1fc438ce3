"""Generate fanet_mw/dialect/fanet.py from fanet.xml; `--check` compares with what is checked in.

The shipped XML includes common.xml, for other tools; the module is generated without the include, which makes 55 KB
instead of 1.5 MB: fanet_mw.mavlink joins its messages to pymavlink's own `common`.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

from pymavlink.generator import mavgen, mavparse

DIALECT = Path(__file__).resolve().parent.parent / "fanet_mw" / "dialect"


def generated() -> str:
    """The module's text."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "fanet.xml"
        text = (DIALECT / "fanet.xml").read_text(encoding="utf-8")
        source.write_text(text.replace("  <include>common.xml</include>\n", ""), encoding="utf-8")
        target = Path(folder) / "fanet.py"
        options = mavgen.Opts(
            str(target), wire_protocol=mavparse.PROTOCOL_2_0, language="Python3", validate=False, strict_units=False
        )
        with contextlib.redirect_stdout(io.StringIO()):
            mavgen.mavgen(options, [str(source)])
        return target.read_text(encoding="utf-8")


def main() -> int:
    """Write the module, or with --check say whether it is the one checked in."""
    target = DIALECT / "fanet.py"
    text = generated()
    if "--check" in sys.argv[1:]:
        if target.read_text(encoding="utf-8") != text:
            sys.stderr.write(f"{target} is not what fanet.xml gives; run scripts/generate_dialect.py\n")
            return 1
        return 0
    target.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

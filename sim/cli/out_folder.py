"""The folder of `--out` before a run: it can be written, and nothing in it is of another run.

Looked at first, because a run may take an hour and its result has nowhere else to go.
"""

import tempfile
from pathlib import Path
from typing import Final

from emulator.capture_file import NAME as CAPTURE
from emulator.capture_file import captures
from fanet_mw.errors import ConfigError

FILES: Final = ("summary.json", "scenario.toml", "reports.json", "links.json", "trace.jsonl", "mavlink.tlog")
"""What a run writes, besides captures."""
PAGES: Final = ("report.html", "report.md")
"""What `--report` adds."""


def prepare(out: Path, *, force: bool) -> None:
    """Make the folder; with `force` remove what an earlier run left in it, and nothing else.

    Raises ConfigError when it cannot be written, or when there is something of an earlier run and no `force`.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out) as file:
            file.write(b"a run would be lost")
        used = [
            path for path in (*(out / name for name in (*FILES, *PAGES)), *captures(out / CAPTURE)) if path.exists()
        ]
        if used and not force:
            raise ConfigError(
                f"--out {out}: holds the result of another run ({', '.join(path.name for path in used)}); "
                "choose another folder, or replace it with --force"
            )
        for path in used:
            path.unlink()
    except OSError as error:
        raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from error

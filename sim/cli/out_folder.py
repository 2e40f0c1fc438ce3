"""Prepares the folder of `--out` before a run: it must be writable, and must not contain the result of another run.

It is checked first, because a run may take an hour, and its result has nowhere else to go. The folder is locked as long
as the run lasts: another one would otherwise take it between the check and the first file, or by --force.
"""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from emulator.pcap_file import NAME as CAPTURE
from emulator.pcap_file import captures
from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import keep_alone, writing
from sim.results.file_names import PAGES, PICTURES, RESERVED, RUN_FILES, pictures

_MOST_SAID: Final = 8


@contextlib.contextmanager
def alone(out: Path | None) -> Iterator[None]:
    """Make a folder and keep it from other runs, unless its file system locks nothing; raises ConfigError."""
    if out is None:
        yield
        return
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        folder = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    try:
        keep_alone(folder, f"--out {out}: another run writes there now; choose another folder")
        yield
    finally:
        os.close(folder)


def prepare(out: Path, *, force: bool) -> None:
    """Make the folder, or raise ConfigError; with `force`, remove what an earlier run has left, and nothing else."""
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out) as file:
            file.write(b"a run would be lost")
        named = (out / name for name in (*RUN_FILES, *PAGES, *RESERVED))
        used = [path for path in (*named, *captures(out / CAPTURE), *pictures(out)) if os.path.lexists(path)]
        if used and not force:
            raise ConfigError(
                f"--out {out}: holds the result of another run ({_said(used)}); "
                "choose another folder, or replace it with --force"
            )
        for path in used:
            path.unlink()
        with contextlib.suppress(OSError):  # the file is missing, or belongs to another program
            (out / PICTURES).rmdir()


def _said(paths: Sequence[Path]) -> str:
    """The names of some files, and the number of the others."""
    others = len(paths) - _MOST_SAID
    return ", ".join(path.name for path in paths[:_MOST_SAID]) + (f" and {others} more" if others > 0 else "")

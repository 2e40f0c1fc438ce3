"""Writes the output folder of a run: resolved scenario, summary, trace, `.tlog`. The hash in the summary is that of the
trace file.

Each file is written separately, the smallest first. If a file cannot be written completely, it keeps what fits, the
summary's `unwritten` names it and the reason, and the other files are not affected.
"""

import hashlib
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import tomli_w

from fanet_mw import tlog
from fanet_mw.errors import ConfigError
from fanet_mw.scenario.named_files import digest_of_bytes
from fanet_mw.scenario.tables.world import FILE_KEYS
from fanet_mw.whole_file import batches, write_items
from sim.results.file_names import (
    LINKS_FILE,
    REPORTS_FILE,
    RUN_FILES,
    SCENARIO_FILE,
    SUMMARY_FILE,
    TLOG_FILE,
    TRACE_FILE,
)
from sim.results.links import described
from sim.results.metrics import summarize
from sim.run.collecting.record_kinds import lines
from sim.run.outcome import Outcome

_HASHED_BYTES: Final = 1 << 16


def finish(outcome: Outcome, *, out: Path | None) -> dict[str, Any]:
    """Summarize a run and, if a folder is given, write its files.

    Raises ConfigError if the folder cannot be used at all. The trace is written even if summarizing raises.
    """
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from error
    digest = hashlib.sha256()
    for some in batches(lines(outcome.records), least_bytes=_HASHED_BYTES):
        digest.update(b"".join(some))
    summary: dict[str, Any] = {}
    try:
        summary = {**summarize(outcome, trace_sha256=digest.hexdigest()), "unwritten": {}}
    finally:
        if out is not None:
            unwritten = _write(outcome, summary, out)
            if unwritten:
                summary["unwritten"] = unwritten
                _try(partial(_replace, out / SUMMARY_FILE, summary))
    return summary


def _write(outcome: Outcome, summary: dict[str, Any], out: Path) -> dict[str, str]:
    """Write all files that can be written; returns what was wrong with the others, by name."""
    resolved = outcome.scenario.model_dump(mode="json", exclude_none=True)
    maps = _maps(resolved["world"])
    links = ",\n".join(json.dumps(row) for row in described(outcome.links.rows()))  # one line per link
    writers: dict[str, Callable[[Path], object]] = {
        SUMMARY_FILE: lambda path: write_items(path, _json_lines(summary)),
        SCENARIO_FILE: lambda path: write_items(path, [tomli_w.dumps(resolved).encode()]),
        REPORTS_FILE: lambda path: write_items(path, _json_lines(dict(outcome.reports))),
        LINKS_FILE: lambda path: write_items(path, f"[\n{links}\n]\n".encode().splitlines(keepends=True)),
        TRACE_FILE: lambda path: write_items(path, lines(outcome.records)),
        TLOG_FILE: lambda path: tlog.write(path, outcome.taps, epoch_us=outcome.epoch_unix_ns // 1000),
    }
    writers |= {name: partial(_copy, *source) for name, source in maps.items()}
    failed = {name: _try(partial(write, out / name)) for name, write in writers.items()}
    return {name: why for name, why in failed.items() if why is not None}


def _maps(world: dict[str, Any]) -> dict[str, tuple[Path, str]]:
    """The files that a world names, which go into the folder, by the names that they have there; the world then names
    those; each with its digest.
    """
    found: dict[str, tuple[Path, str]] = {}
    for key, digest_key in FILE_KEYS.items():
        if world[digest_key]:
            source = Path(world[key])
            world[key] = source.name if source.name not in (*RUN_FILES, *found) else f"{key}-{source.name}"
            found[world[key]] = source, world[digest_key]
    return found


def _copy(source: Path, digest: str, path: Path) -> None:
    data = source.read_bytes()
    if digest_of_bytes(data) != digest:
        raise OSError(f"{source} has changed since the run began")
    if not (path.exists() and path.samefile(source)):
        write_items(path, [data])


def _json_lines(content: dict[str, Any]) -> list[bytes]:
    return [f"{json.dumps(content, indent=2)}\n".encode()]


def _replace(path: Path, summary: dict[str, Any]) -> None:
    """Write the summary again in a file beside the old one and rename it, so that the old one stays if that fails."""
    fresh = path.with_suffix(".new")
    try:
        write_items(fresh, _json_lines(summary))
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def _try(write: Callable[[], object]) -> str | None:
    """The reason why something could not be written; None if it was."""
    try:
        write()
    except OSError as error:
        return error.strerror or str(error)
    return None

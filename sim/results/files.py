"""Writes the output folder of a run: resolved scenario, summary, trace, `.tlog`.

    begin     room is kept for the small files, and the summary says that the run has not ended
    finish    scenario, reports, links, trace, log: each as far as it fits; the summary replaces the first one last

So whenever a run is killed, and wherever a disk is full, the summary on disk is not `valid`, or it is whole and names
the size and digest of each file. What ends early is named in `unwritten`, and its run is not valid.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import tomli_w

from emulator.pcap_file import NAME as CAPTURE
from fanet_mw import tlog
from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.scenario.named_files import MOST_BYTES, digest_of_bytes
from fanet_mw.scenario.tables.world import FILE_KEYS
from fanet_mw.whole_file import Written, batches, replace_file, write_items
from sim.records.record_kinds import lines
from sim.results.file_names import (
    LINKS_FILE,
    REPORTS_FILE,
    RESERVED,
    RUN_FILES,
    SCENARIO_FILE,
    SUMMARY_FILE,
    TLOG_FILE,
    TRACE_FILE,
)
from sim.results.links import described
from sim.results.metrics import summarize
from sim.results.outcome import Outcome

_HASHED_BYTES: Final = 1 << 16
_NOT_ENDED: Final = {
    "valid": False, "invalid_because": ["the run has not ended, or was killed before its files were whole"],
    "pdr": None, "trace_sha256": "", "unwritten": {}, "files": {},
}  # fmt: skip


def begin(out: Path) -> None:
    """Keep room for the small files, and say in the summary that the run has not ended; raises ConfigError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, size in RESERVED.items():
            with contextlib.suppress(FileNotFoundError):
                (out / name).unlink()
            with (out / name).open("xb") as file:
                os.posix_fallocate(file.fileno(), 0, size)
        replace_file(out / SUMMARY_FILE, _json_of(_NOT_ENDED))
    except OSError as error:
        forget(out)
        raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from error


def forget(out: Path) -> None:
    """Take back what `begin` has written, because there is no result."""
    for name in (*RESERVED, SUMMARY_FILE):
        with contextlib.suppress(OSError):
            (out / name).unlink()


def finish(
    outcome: Outcome,
    *,
    out: Path | None,
    page: Callable[[], object] | None = None,
    cut: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Summarize a run and, if a folder is given, write its files, and then what `page` makes of them. `cut` names what
    was written during the run and ends early. Raises ConfigError if the folder cannot be used.
    """
    if out is not None and not all((out / name).exists() for name in RESERVED):
        begin(out)
    digest = hashlib.sha256()
    for some in batches(lines(outcome.records), least_bytes=_HASHED_BYTES):
        digest.update(b"".join(some))
    summary: dict[str, Any] = {}
    files: dict[str, dict[str, Any]] = {}
    unwritten: dict[str, str] = {}
    try:
        summary = {**summarize(outcome, trace_sha256=digest.hexdigest()), "unwritten": unwritten, "files": files}
    finally:
        if out is not None:
            _write(outcome, out, files, unwritten)
    unwritten |= cut or {}
    capture = outcome.reports.get("emulator", {}).get("capture_failed")
    if capture is not None:
        unwritten[CAPTURE] = capture
    _say_cut(summary)
    if out is not None:
        _write_summary(summary, out, page)
    return summary


def _write_summary(summary: dict[str, Any], out: Path, page: Callable[[], object] | None) -> None:
    """Write the summary, then the page; a summary that says what became of the page replaces the first one."""
    fresh, last, _ = (out / name for name in RESERVED)
    _say_cut(summary)
    summary_why = _try(partial(_put, fresh, out / SUMMARY_FILE, summary))
    if page is not None and summary_why is None:
        try:
            page()
        except ConfigError as error:
            summary["unwritten"]["report.html"] = str(error)
            _say_cut(summary)
            summary_why = _try(partial(_put, last, out / SUMMARY_FILE, summary))
    if summary_why is not None:
        summary["unwritten"][SUMMARY_FILE] = summary_why
        _say_cut(summary)
    for name in RESERVED:
        (out / name).unlink(missing_ok=True)


def _say_cut(summary: dict[str, Any]) -> None:
    """A result of which something is cut is not valid, and says what."""
    for name, why in summary["unwritten"].items():
        sentence = f"{name} ends early or is missing: {why}"
        if sentence not in summary["invalid_because"]:
            summary["invalid_because"] = [*summary["invalid_because"], sentence]
    summary["valid"] = not summary["invalid_because"]


def _write(outcome: Outcome, out: Path, files: dict[str, dict[str, Any]], unwritten: dict[str, str]) -> None:
    """Write all files but the summary, the smallest first, each as far as it can be written."""
    resolved = outcome.scenario.model_dump(mode="json", exclude_none=True)
    maps = _maps(resolved["world"])
    rows = described(outcome.links.rows())
    links = ",\n".join(json.dumps(row) for row in rows)  # one line per link
    writers: dict[str, Callable[[Path, Written], object]] = {
        SCENARIO_FILE: lambda path, held: write_items(path, [tomli_w.dumps(resolved).encode()], held),
        REPORTS_FILE: lambda path, held: write_items(path, [_json_of(dict(outcome.reports))], held),
        LINKS_FILE: lambda path, held: write_items(path, f"[\n{links}\n]\n".encode().splitlines(keepends=True), held),
        TRACE_FILE: lambda path, held: write_items(path, lines(outcome.records), held),
        TLOG_FILE: lambda path, held: tlog.write(path, outcome.taps, epoch_us=outcome.epoch_unix_ns // 1000, held=held),
    }
    writers |= {name: partial(_copy, *source) for name, source in maps.items()}
    (out / ".scenario.toml.new").unlink(missing_ok=True)  # the first one has its room
    for name, write in writers.items():
        held = Written()
        why = _try(partial(write, out / name, held))
        files[name] = {"bytes": held.bytes, "sha256": held.sha256}
        if why is not None:
            unwritten[name] = why


def _maps(world: dict[str, Any]) -> dict[str, tuple[Path, str]]:
    """The files that a world names, by their names in the folder, which the world then has; each with its digest."""
    found: dict[str, tuple[Path, str]] = {}
    for key, digest_key in FILE_KEYS.items():
        if world[digest_key]:
            source = Path(world[key])
            world[key] = source.name if source.name not in (*RUN_FILES, *found) else f"{key}-{source.name}"
            found[world[key]] = source, world[digest_key]
    return found


def _copy(source: Path, digest: str, path: Path, held: Written) -> None:
    data = read_regular(source, most_bytes=MOST_BYTES)
    if digest_of_bytes(data) != digest:
        raise OSError(f"{source} has changed since the run began")
    if not (path.exists() and path.samefile(source)):
        write_items(path, [data], held)
    else:
        held.add(data)


def _json_of(content: dict[str, Any]) -> bytes:
    return f"{json.dumps(content, indent=2)}\n".encode()


def _put(kept: Path, path: Path, summary: dict[str, Any]) -> None:
    """Write the summary into the room that was kept for it, and put it in its place whole."""
    data = _json_of(summary)
    with kept.open("r+b" if kept.exists() else "xb", buffering=0) as file:
        written = 0
        while written < len(data):
            written += os.write(file.fileno(), data[written:])
        file.truncate(len(data))
    kept.replace(path)


def _try(write: Callable[[], object]) -> str | None:
    """The reason why something could not be written; None if it was."""
    try:
        write()
    except (OSError, ConfigError) as error:
        return getattr(error, "strerror", None) or str(error)
    return None

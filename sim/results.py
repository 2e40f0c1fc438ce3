"""The output folder of a run: resolved scenario, summary, trace, `.tlog`. Its bytes are what the hash is of."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import tomli_w

from fanet_mw import tlog, trace
from fanet_mw.errors import ConfigError
from fanet_mw.trace import Record
from sim.links import described
from sim.metrics import summarize
from sim.outcome import Outcome


def trace_bytes(records: Iterable[Record]) -> bytes:
    """The trace file: one JSON array per line."""
    return "".join(f"{trace.line(record)}\n" for record in records).encode()


def finish(outcome: Outcome, *, out: Path | None) -> dict[str, Any]:
    """Summarize a run and, when a folder is given, write it; raises ConfigError when that cannot be done."""
    data = trace_bytes(outcome.records)
    summary = summarize(outcome, trace_sha256=hashlib.sha256(data).hexdigest())
    if out is not None:
        try:
            _write(outcome, summary, data, out)
        except OSError as error:
            raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from error
    return summary


def _write(outcome: Outcome, summary: dict[str, Any], data: bytes, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    resolved = outcome.scenario.model_dump(mode="json", exclude_none=True)
    (out / "scenario.toml").write_text(tomli_w.dumps(resolved), encoding="utf-8")
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    (out / "reports.json").write_text(json.dumps(dict(outcome.reports), indent=2) + "\n", encoding="utf-8")
    links = ",\n".join(json.dumps(row) for row in described(outcome.links.rows()))  # a line per link
    (out / "links.json").write_text(f"[\n{links}\n]\n", encoding="utf-8")
    (out / "trace.jsonl").write_bytes(data)
    tlog.write(out / "mavlink.tlog", outcome.taps, epoch_us=outcome.epoch_unix_ns // 1000)

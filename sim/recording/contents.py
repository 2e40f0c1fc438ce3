"""What the folder of a run, or a recording, holds, as lines and a table for people."""

import os
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import open_regular
from fanet_mw.trace import Record, kind_of
from fanet_mw.units import S
from sim.results.run_folder import RunFolder

_MAGIC: Final = b"\x89MCAP0\r\n"
"""The first bytes of an MCAP file, and its last."""


class Contents(NamedTuple):
    """What there is."""

    lines: Sequence[str]
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def of_folder(folder: Path) -> Contents:
    """The run, and the number of records of each kind in its trace; raises ConfigError."""
    run = RunFolder(folder)
    summary = run.summary
    kinds: Counter[str] = Counter()
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    records: Iterator[Record] = run.records()
    for record in records:
        kind = kind_of(record)
        kinds[kind] += 1
        first.setdefault(kind, record.t_ns)
        last[kind] = record.t_ns
    valid = "valid" if summary["valid"] else f"not valid: {'; '.join(summary['invalid_because'])}"
    lines = [
        f"{summary['scenario']}, seed {summary['seed']}, {summary['nodes']} nodes, {summary['mode']} time, "
        f"{summary['simulated_s']:g} s; {valid}",
        *(f"{name}: {said['bytes']:,} bytes" for name, said in summary["files"].items()),
    ]
    rows = [
        (kind, f"{count:,}", f"{first[kind] / S:.3f}", f"{last[kind] / S:.3f}") for kind, count in kinds.most_common()
    ]
    return Contents(lines, ("record", "count", "first [s]", "last [s]"), rows)


def _ends_whole(file: BinaryIO) -> bool:
    length = file.seek(0, os.SEEK_END)
    file.seek(max(0, length - len(_MAGIC)))
    return length >= 2 * len(_MAGIC) and file.read() == _MAGIC


def of_recording(path: Path) -> Contents:
    """The topics of a recording; raises ConfigError for a file that is none, or that was cut off."""
    from mcap.exceptions import EndOfFile, McapError
    from mcap.reader import make_reader

    try:
        with open_regular(path) as file:
            if file.read(len(_MAGIC)) == _MAGIC and not _ends_whole(file):
                raise EndOfFile("it was cut off, and has no index; mcap recover makes one of what is there")
            file.seek(0)
            summary = make_reader(file).get_summary()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except (McapError, ValueError, struct.error) as error:
        raise ConfigError(f"{path}: is no whole MCAP file: {str(error)[:200] or 'it ends too soon'}") from error
    if summary is None or summary.statistics is None:
        raise ConfigError(f"{path}: was cut off before its index; `mcap recover` of Foxglove's command line mends it")
    held = summary.statistics
    span_s = (held.message_end_time - held.message_start_time) / S
    counts = held.channel_message_counts
    schemas = {number: schema.name for number, schema in summary.schemas.items()}
    rows = [
        (channel.topic, schemas.get(channel.schema_id, ""), f"{counts.get(channel.id, 0):,}")
        for channel in sorted(summary.channels.values(), key=lambda channel: channel.topic)
    ]
    lines = [
        f"{held.message_count:,} messages in {held.channel_count} topics over {span_s:.1f} s, "
        f"{path.stat().st_size:,} bytes"
    ]
    return Contents(lines, ("topic", "schema", "messages"), rows)

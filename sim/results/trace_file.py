"""The recorded events of a run, read back from its `trace.jsonl`: all of them, or those of some kinds.

    ["delivered", 12045000000, 7, ...]  ->  Delivered(t_ns=12045000000, node=7, ...)

Lines of other kinds are told by their first word and not parsed, and no more than one record is held at a time.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.trace import Record, name_of, parse
from sim.results.file_names import TRACE_FILE


def read_trace(folder: Path, *kinds: type[Any]) -> Iterator[Record]:
    """The records of these kinds, or of all, in the order of the trace.

    Raises ConfigError if `folder` has no trace that can be read, and at a line that is no record, by its number.
    """
    path, number = folder / TRACE_FILE, 0
    beginnings = tuple(f'["{name_of(kind)}",' for kind in kinds) or ("[",)
    try:
        with path.open(encoding="utf-8") as lines:
            for text in lines:
                number += 1
                if text.startswith(beginnings) or not text.startswith('["'):
                    yield parse(text)
    except MalformedFrameError as error:
        raise ConfigError(f"{path}, line {number}: {error}") from error
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error

"""Values that all UAVs of a swarm, or all runs of a seed, compute alike, also with another release: digests of them.

FANET_KEEP=1 pytest FILE     writes what FILE keeps anew, in `kept_values.json`: on purpose, and the commit says why
"""

import dataclasses
import json
import os
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

FILE: Final = Path(__file__).with_suffix(".json")


def rounded(value: Any) -> Any:
    """A value as JSON has it, to six digits: processors differ in the last bits."""
    match value:
        case bool() | int() | str() | None:
            return value
        case float():
            return float(f"{round(value, 6):.6g}") + 0.0
        case bytes():
            return value.hex()
        case np.ndarray() | np.generic():
            return rounded(value.tolist())
        case Mapping():
            return {str(key): rounded(inner) for key, inner in sorted(value.items(), key=lambda item: str(item[0]))}
        case set() | frozenset():
            return sorted((rounded(inner) for inner in value), key=str)
        case Iterable():
            return [rounded(inner) for inner in value]
    return rounded(dataclasses.asdict(value)) if dataclasses.is_dataclass(value) else str(value)


def kept(name: str, values: Iterable[Any]) -> None:
    """Fails if these values are not what they were."""
    known: dict[str, str] = json.loads(FILE.read_text()) if FILE.exists() else {}
    listed = rounded(list(values))
    found = f"{len(listed)} values, {zlib.crc32(json.dumps(listed).encode()):08x}"
    if os.environ.get("FANET_KEEP"):
        FILE.write_text(json.dumps(dict(sorted({**known, name: found}.items())), indent=1) + "\n")
        return
    assert found == known.get(name), f"{name}: on purpose? then FANET_KEEP=1, and say why in the commit"

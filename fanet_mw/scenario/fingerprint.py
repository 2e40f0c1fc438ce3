"""Compares the scenarios of two processes: a fingerprint of all values, and which keys differ."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any, Final

from fanet_mw.scenario.model import Scenario

DIGITS: Final = 16
"""Hexadecimal digits of a fingerprint."""


def as_json(scenario: Scenario) -> str:
    """All values of a scenario as text, the same text for the same values."""
    return json.dumps(scenario.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))


def fingerprint(scenario: Scenario) -> str:
    """The fingerprint of a scenario, on which all processes of a swarm must agree."""
    return hashlib.sha256(as_json(scenario).encode()).hexdigest()[:DIGITS]


def differences(ours: Mapping[str, Any], theirs: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """(dotted key, value here, value there) of all that differs between two trees of plain values."""
    for key in sorted({*ours, *theirs}):
        here, there = ours.get(key), theirs.get(key)
        if isinstance(here, Mapping) and isinstance(there, Mapping):
            yield from differences(here, there, f"{path}{key}.")
        elif here != there:
            yield f"{path}{key}", here, there

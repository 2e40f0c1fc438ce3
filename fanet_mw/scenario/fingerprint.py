"""Compares the scenarios of two processes: a fingerprint of all that makes one, and which keys differ."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus.codecs import LAYOUT
from fanet_mw.errors import BusError
from fanet_mw.scenario.foreign_modules import modules_of
from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.tables.world import FILE_KEYS

DIGITS: Final = 16


def identity(scenario: Scenario) -> dict[str, Any]:
    """All that makes this scenario another than others: values, contents of named files, sources of foreign parts."""
    tree: dict[str, Any] = scenario.model_dump(mode="json")
    for key, digest_key in FILE_KEYS.items():
        if tree["world"][digest_key]:
            tree["world"][key] = Path(tree["world"][key]).name
    return {**tree, "modules": modules_of(scenario)}


def as_json(scenario: Scenario) -> str:
    """The identity of a scenario and the layout of the bus as text, the same text for the same scenario."""
    return json.dumps({**identity(scenario), "bus": LAYOUT}, sort_keys=True, separators=(",", ":"))


def told_by(swarm: str, answer: bytes) -> dict[str, Any]:
    """The identity that a keeper told as text; BusError: other layouts, ValueError or RecursionError: nonsense."""
    tree = json.loads(answer)
    if not isinstance(tree, dict):
        raise ValueError("no table of keys")  # noqa: TRY004  (like all other texts that are none)
    theirs = tree.pop("bus", LAYOUT)
    if theirs != LAYOUT:
        raise BusError(
            f"swarm {swarm} lays bus messages out as {theirs!r}, this fanet-mw as {LAYOUT!r}: "
            "both must be of the same version"
        )
    return tree


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

"""Missions that are kept when they were flown, so that a table of hours can be measured in pieces.

    runs/missions.jsonl    one line per mission: its scenario and seed, the key of both with every setting, the code
                           that flew it, and what it came to

A line that is there is not flown again, whichever code wrote it: remove the file to measure all of it anew. A line that
was half written when the machine stopped is left out.
"""

import contextlib
import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from fanet_mw.scenario import Scenario
from sim.sweep.provenance import code

KEPT: Final = Path(__file__).parents[2] / "runs" / "missions.jsonl"
Run = Mapping[str, Any]


class OutOfTime(Exception):  # noqa: N818 nothing went wrong: the rest is for the next piece
    """The next run would end after the time that this piece may take."""


class Kept:
    """The missions of one file. Within `seconds`, if given, no more is begun than is likely to end."""

    def __init__(self, path: Path, fly: Callable[[Scenario], Run], *, seconds: float | None = None) -> None:
        self._path = path
        self._fly = fly
        self._until_s = None if seconds is None else time.monotonic() + seconds
        self._longest_s = 0.0
        self._runs = {line["key"]: line["run"] for line in _lines(path)}

    def of(self, scenario: Scenario) -> Run:
        """What this mission came to: as it was kept, or flown now. Raises OutOfTime if the time does not suffice."""
        key = key_of(scenario)
        if key not in self._runs:
            began_s = time.monotonic()
            if self._until_s is not None and began_s + self._longest_s > self._until_s:
                raise OutOfTime
            self._runs[key] = self._fly(scenario)
            self._longest_s = max(self._longest_s, time.monotonic() - began_s)
            self._path.parent.mkdir(parents=True, exist_ok=True)
            broken = self._path.exists() and not self._path.read_text(encoding="utf-8").endswith("\n")
            with self._path.open("a", encoding="utf-8") as file:
                named = {"scenario": scenario.name, "seed": scenario.seed, "key": key, "code": code()}
                file.write("\n" * broken + json.dumps({**named, "run": self._runs[key]}) + "\n")
        return self._runs[key]


def key_of(scenario: Scenario) -> str:
    """A hash of the scenario whole, but for its description: equal keys are equal missions."""
    told = scenario.model_dump(mode="json", exclude_defaults=True, exclude={"description"})
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:16]


def _lines(path: Path) -> Iterator[Mapping[str, Any]]:
    if not path.exists():
        return
    for text in path.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(json.JSONDecodeError):
            yield json.loads(text)

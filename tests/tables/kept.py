"""The missions of which long tables are made, kept in the repository: a table of hours can be flown in pieces, and is
written from the file by everybody.

    docs/results/data/missions.jsonl    one line per mission: its scenario and seed, what differs from the scenario as
                                        shipped, the key of all settings, the code that flew it, and those figures of
                                        it that tables read, to six digits

A mission whose line is there is not flown again, whichever code wrote the line: each table says which. Whoever wants
it measured anew removes its line, flies it (`python -m tests.tables.pieces TABLE`), writes the table (`scripts/tables
TABLE`), and commits both. Lines are sorted, so that two branches that flew different missions merge.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from fanet_mw.scenario import Scenario
from sim.sweep.provenance import code

KEPT: Final = Path(__file__).parents[2] / "docs" / "results" / "data" / "missions.jsonl"
Run = Mapping[str, Any]
_DIGITS: Final = 6


class OutOfTime(Exception):  # noqa: N818 nothing went wrong: the rest is for the next piece
    """The next run would end after the time that this piece may take."""


class Missing(Exception):  # noqa: N818 nothing went wrong: somebody has to fly them
    """A table needs missions that were not flown yet."""

    def __init__(self, missions: Collection[str]) -> None:
        super().__init__("\n".join(missions))
        self.missions = missions


class Kept:
    """The missions of one file; those that are missing are flown by `fly`, and without it they are refused.

    Within `seconds`, if given, no mission is begun that is likely to end later.
    """

    def __init__(
        self, path: Path, fly: Callable[[Scenario], Run] | None = None, *, seconds: float | None = None
    ) -> None:
        self._path = path
        self._fly = fly
        self._until_s = None if seconds is None else time.monotonic() + seconds
        self._longest_s = 0.0
        self._runs = {line["key"]: {**line["run"], "code": line["code"]} for line in _lines(path)}

    def __contains__(self, scenario: Scenario) -> bool:
        return key_of(scenario) in self._runs

    def of(self, scenario: Scenario, differences: Iterable[str] = ()) -> Run:
        """What this mission came to, and the `code` that flew it: as it was kept, or flown now.

        `differences` say to readers of the file what differs from the shipped scenario. Raises Missing if the mission
        is not there and may not be flown, and OutOfTime if the time does not suffice.
        """
        key = key_of(scenario)
        if key not in self._runs:
            if self._fly is None:
                raise Missing([f"{scenario.name}, seed {scenario.seed}"])
            began_s = time.monotonic()
            if self._until_s is not None and began_s + self._longest_s > self._until_s:
                raise OutOfTime
            run = rounded(self._fly(scenario))
            self._runs[key] = {**run, "code": code()}
            self._longest_s = max(self._longest_s, time.monotonic() - began_s)
            named = {"scenario": scenario.name, "seed": scenario.seed, "differences": [*differences]}
            _add(self._path, {**named, "key": key, "code": code(), "run": run})
        return self._runs[key]


def codes(runs: Iterable[Run]) -> str:
    """The codes that flew some missions, for a column of their table: without the version."""
    return ", ".join(sorted({run["code"].rpartition("+")[2] for run in runs}))


def key_of(scenario: Scenario) -> str:
    """A hash of the scenario whole, but for its description: equal keys are equal missions."""
    told = scenario.model_dump(mode="json", exclude_defaults=True, exclude={"description"})
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:16]


def rounded(found: Any) -> Any:
    """The same figures to the digits that are kept."""
    if isinstance(found, float):
        return float(f"{found:.{_DIGITS}g}")
    if isinstance(found, Mapping):
        return {name: rounded(value) for name, value in found.items()}
    return [rounded(value) for value in found] if isinstance(found, list) else found


def _add(path: Path, line: Mapping[str, Any]) -> None:
    """Put a line into the file as that is now, which another process may have written to."""
    lines = {kept["key"]: kept for kept in _lines(path)} | {line["key"]: line}
    path.parent.mkdir(parents=True, exist_ok=True)
    whole = path.with_suffix(f".{os.getpid()}")
    whole.write_text("".join(json.dumps(one) + "\n" for one in sorted(lines.values(), key=_place)), encoding="utf-8")
    whole.replace(path)  # a reader finds the file before or after, never a half of it


def _place(line: Mapping[str, Any]) -> tuple[str, list[str], int, str]:
    return line["scenario"], line["differences"], line["seed"], line["key"]


def _lines(path: Path) -> Iterator[Mapping[str, Any]]:
    if path.exists():
        yield from map(json.loads, path.read_text(encoding="utf-8").splitlines())

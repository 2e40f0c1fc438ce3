"""One run of a sweep: its scenario, the key under which its result is stored, and the command that repeats it."""

import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.fingerprint import identity
from fanet_mw.scenario.foreign_modules import modules_of
from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.named_files import digest_of
from sim.scenarios import catalog
from sim.sweep import measures
from sim.sweep.spec import MOST_RUNS, NO_CASE, Setting, Sweep
from sim.world.possible_world import PossibleWorlds


@dataclass(frozen=True, slots=True)
class Task:
    """One run as plain values, which can be sent to any process on any machine."""

    key: str
    """A hash of the resolved scenario, of its files and modules, and of the measures: equal runs have equal keys."""
    case: str
    seed: int
    tree: Mapping[str, Any]
    """The resolved scenario, with all defaults."""
    measure: tuple[str, ...]
    command: str
    """The command that repeats this run alone."""
    realtime: bool = False
    """True for a run as real processes, which needs the machine to itself."""
    slow_down_to: float | None = None
    """The scale to which their clock may slow down."""
    contents: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """The digests of the modules and files of others, by which the run is told from one with other contents."""

    def value(self, key: str) -> object:
        """The resolved value of a dotted scenario key; None if the scenario leaves it unset."""
        at: object = self.tree
        for part in key.split("."):
            if isinstance(at, Sequence) and not isinstance(at, str):
                at = dict(enumerate(at)).get(int(part)) if part.isdecimal() else None
            else:
                at = at.get(part) if isinstance(at, Mapping) else None
        return at


def tasks_of(sweep: Sweep) -> list[Task]:
    """All runs of a sweep, validated; raises ConfigError with the mistakes of all settings."""
    if sweep.count() > MOST_RUNS:
        raise ConfigError(f"the sweep has more than {MOST_RUNS} runs")
    measures.check(sweep.measure)
    tasks: list[Task] = []
    mistakes: dict[str, list[str]] = {}
    worlds = PossibleWorlds()
    for setting in sweep.settings():
        overrides = setting.overrides()
        if "seed" in setting.changes:
            raise ConfigError("seed: every setting of a sweep has the same seeds: say seeds = [1, 5], or --seeds N")
        for seed in sweep.seed_list():
            try:
                scenario = catalog.find(sweep.base, [*overrides, f"seed={seed}"])
                if setting.realtime and not scenario.radio.lead_ms:
                    raise ConfigError("radio.lead_ms = 0 is for virtual time: must be > 0 in real time, for example 20")
                worlds.require(scenario)
            except ConfigError as error:
                case = [] if setting.case == NO_CASE else [f"case {setting.case}"]
                mistakes.setdefault(str(error), []).append(", ".join([*case, *overrides]))
                break
            sets = [f"--set {shlex.quote(override)}" for override in overrides]
            verb = "launch" if setting.realtime else "simulate"
            slower = [] if setting.slow_down_to is None else [f"--slow-down-to {setting.slow_down_to:g}"]
            command = " ".join([f"fanet {verb}", shlex.quote(sweep.base), *sets, f"--seed {seed}", *slower])
            tasks.append(_task(scenario, setting, sweep.measure, command))
    if mistakes:
        raise ConfigError("\n".join(f"{error}{_first_of(settings)}" for error, settings in mistakes.items()))
    return tasks


def _first_of(settings: Sequence[str]) -> str:
    """The first setting with a mistake, and the number of others that have it, too; nothing where there is only one."""
    others = len(settings) - 1
    first = f"{settings[0]}{f'; and in {others} other settings' if others else ''}"
    return f" ({first})" if first else ""


def _task(scenario: Scenario, setting: Setting, measure: tuple[str, ...], command: str) -> Task:
    tree = scenario.model_dump(mode="json", exclude_none=True)
    named = {key: value for key, value in identity(scenario).items() if key != "description"}
    contents = {"modules": modules_of(scenario), "files": dict(_files_in(tree))}
    realtime = ["realtime"] if setting.realtime else []
    text = json.dumps([named, contents["files"], sorted(measure), *realtime], sort_keys=True)
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    return Task(
        key, setting.case, scenario.seed, tree, measure, command, setting.realtime, setting.slow_down_to, contents
    )


def require_same(task: Task, scenario: Scenario) -> None:
    """Raises ConfigError if a file or a module of the run is another one here, or now, than when the sweep began."""
    here = {"modules": modules_of(scenario), "files": dict(_files_in(task.tree))}
    for kind, wanted in task.contents.items():
        for name, digest in wanted.items():
            if here[kind].get(name) != digest:
                raise ConfigError(
                    f"{name} is another one here than when the sweep began; start the sweep, and its workers, again"
                )


def _files_in(tree: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Files that options of parts of other packages name, with their digests."""
    for table in (tree["routing"], tree["mobility"], tree["clusters"], tree["radio"], *tree["applications"]):
        for value in table.get("options", {}).values():
            if isinstance(value, str) and (digest := digest_of(value)):
                yield value, digest

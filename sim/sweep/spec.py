"""The sweep file: a base scenario, what is changed in all runs, what is varied, and the seeds (docs/how-to/sweep.md).

    [quick]                             # a variant replaces what it names
    seeds = 2
    [full]
    like = "quick"                      # a variant of a variant

A seed draws the same places, births and losses in all settings (common random numbers).
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import toml_of
from fanet_mw.scenario.text_files import read_text
from sim.scenarios.shipped import is_file
from sim.sweep.toml_values import toml_value

MOST_RUNS: Final = 100_000
"""A file with more runs than this is taken for a mistake."""
NO_CASE: Final = "-"
"""The name of the case of a sweep that has none."""


def flattened(tree: object) -> object:
    """Nested tables as dotted keys; the value of a scenario key is never a table."""
    if not isinstance(tree, Mapping):
        return tree
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            inner = flattened(value)
            assert isinstance(inner, Mapping), "a table stays one"
            flat.update({f"{key}.{rest}": leaf for rest, leaf in inner.items()})
        else:
            flat[str(key)] = value
    return flat


Changes = Annotated[dict[str, Any], BeforeValidator(flattened)]
"""Scenario keys, each with its value."""
Axes = Annotated[dict[str, Annotated[list[Any], Field(min_length=1)]], BeforeValidator(flattened)]
"""Scenario keys, each with the values that it takes in turn."""
_Seed = Annotated[int, Field(strict=True, ge=0)]
Seeds = Annotated[int, Field(strict=True, ge=1, le=10_000)] | Annotated[list[_Seed], Field(min_length=1)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Case(_Table):
    """Settings with a name, which are mostly drawn as one line of a figure."""

    name: Annotated[str, Field(min_length=1, max_length=64)]
    set: Changes = {}
    grid: Axes = {}
    realtime: Annotated[bool, Field(strict=True)] = False
    """True for runs as real processes: on this machine, one at a time, after all others."""
    slow_down_to: Annotated[float, Field(ge=1e-3, le=100)] | None = None
    """The scale to which the clock of runs as processes may slow down while the machine cannot keep up; None: never."""

    @model_validator(mode="after")
    def _only_processes_slow_down(self) -> "Case":
        if self.slow_down_to is not None and not self.realtime:
            raise ValueError("slow_down_to is for runs with realtime = true: virtual time keeps up with every machine")
        return self


class SweepVariant(_Table):
    """What a variant replaces: the seeds, single keys of `set`, single axes of the grid, the cases."""

    like: Literal["quick"] | None = None
    """The variant of which this one replaces what it names itself."""
    seeds: Seeds | None = None
    set: Changes = {}
    grid: Axes = {}
    cases: Annotated[tuple[str, ...] | None, Field(min_length=1)] = None
    """The names of the cases that are run; all of them by default."""


class Setting(_Table):
    """One combination of settings: its case, and all scenario keys that differ from the base."""

    case: str
    changes: dict[str, Any]
    realtime: bool = False
    slow_down_to: float | None = None

    def overrides(self) -> list[str]:
        return [f"{key}={toml_value(value)}" for key, value in self.changes.items()]


class Sweep(_Table):
    """A sweep, as its file describes it."""

    description: str = ""
    base: str
    """A shipped scenario, or a .toml file beside the sweep's own."""
    seeds: Seeds = 1
    set: Changes = {}
    grid: Axes = {}
    case: tuple[Case, ...] = ()
    measure: tuple[str, ...] = ()
    """The measures that are taken in addition to the summary (`sim/sweep/measures.py`)."""
    quick: SweepVariant | None = None
    full: SweepVariant | None = None

    @field_validator("case")
    @classmethod
    def _every_case_has_a_name_of_its_own(cls, cases: tuple[Case, ...]) -> tuple[Case, ...]:
        names = [case.name for case in cases]
        twice = next((name for at, name in enumerate(names) if name in names[:at]), None)
        if twice is not None:  # rows and figures know a case by its name
            raise ValueError(f"two cases have the name {twice!r}")
        return cases

    def variant(self, name: str | None) -> "Sweep":
        """The sweep with the changes of a variant; None: without any."""
        if name is None:
            return self
        chosen = getattr(self, name, None) if name in VARIANTS else None
        if not isinstance(chosen, SweepVariant):
            has = [known for known in VARIANTS if getattr(self, known) is not None]
            raise ConfigError(f"--variant {name}: the sweep has {' and '.join(has) or 'no variants'}")
        if chosen.like == name:
            raise ConfigError(f'{name}.like = "{name}": a variant must be like another one')
        base = self.variant(chosen.like)
        cases = base.case
        if chosen.cases is not None:
            unknown = set(chosen.cases) - {case.name for case in cases}
            if unknown:
                raise ConfigError(f"{name}.cases: no case is called {', '.join(sorted(unknown))}")
            cases = tuple(case for case in cases if case.name in chosen.cases)
        return self.model_copy(
            update={
                "seeds": base.seeds if chosen.seeds is None else chosen.seeds,
                "set": {**base.set, **chosen.set},
                "grid": {**base.grid, **chosen.grid},
                "case": cases,
            }
        )

    def seed_list(self) -> Sequence[int]:
        """The seeds in order, without repetitions."""
        return range(1, self.seeds + 1) if isinstance(self.seeds, int) else list(dict.fromkeys(self.seeds))

    def varied(self) -> list[str]:
        """All scenario keys that an axis or a case sets, in order: the columns by which runs are told apart."""
        keys = [key for case in self.case for key in case.set]
        keys += [key for grid in (self.grid, *(case.grid for case in self.case)) for key in grid]
        return list(dict.fromkeys(keys))

    def settings(self) -> Iterator[Setting]:
        """All combinations of settings; the last axis changes fastest."""
        for case in self.case or (Case(name=NO_CASE),):
            axes = {**self.grid, **case.grid}
            for values in itertools.product(*axes.values()):
                changes = {**self.set, **case.set, **dict(zip(axes, values, strict=True))}
                yield Setting(case=case.name, changes=changes, realtime=case.realtime, slow_down_to=case.slow_down_to)

    def count(self) -> int:
        points = sum(1 for _ in itertools.islice(self.settings(), MOST_RUNS + 1))
        return points * len(self.seed_list())


VARIANTS: Final = ("quick", "full")


def shipped() -> list[str]:
    return sorted(
        item.name.removesuffix(".toml") for item in files("sim.sweeps").iterdir() if item.name.endswith(".toml")
    )


def find(name: str) -> Sweep:
    """The shipped sweep of this name, or that of a file with the key `base`; otherwise that of a scenario alone."""
    if not is_file(name, shipped()):
        if name not in shipped():
            return Sweep(base=name)
        return parse(files("sim.sweeps").joinpath(f"{name}.toml").read_text(encoding="utf-8"), source=f"sweep {name}")
    path = Path(name)
    text = read_text(path, what=name)
    if "base" not in toml_of(text, source=name):
        return Sweep(base=name)
    sweep = parse(text, source=name)
    if sweep.base.endswith(".toml") and not Path(sweep.base).is_absolute():
        return sweep.model_copy(update={"base": str(path.parent / sweep.base)})
    return sweep


def parse(text: str, *, source: str) -> Sweep:
    """The sweep of some TOML text; raises ConfigError with every mistake."""
    tree = toml_of(text, source=source)
    try:
        return Sweep.model_validate(tree)
    except ValidationError as error:
        lines = dict.fromkeys(_sentence(dict(item)) for item in error.errors())
        raise ConfigError("\n".join(f"{source}: {line}" for line in lines)) from error


def _sentence(item: Mapping[str, Any]) -> str:
    """One mistake as `key = value: bound`."""
    key = ".".join(str(part) for part in item["loc"] if "constrained-int" not in str(part))
    if item["type"] == "extra_forbidden":
        tables: Mapping[str, type[_Table]] = {"case": Case, "quick": SweepVariant, "full": SweepVariant}
        table = tables.get(str(item["loc"][0]), Sweep)
        return f"{key}: unknown key; known keys: {', '.join(table.model_fields)}"
    if item["type"] == "missing":
        return f"{key}: is missing"
    message = str(item["msg"])
    return f"{key} = {item['input']!r}: {message[0].lower()}{message[1:]}"

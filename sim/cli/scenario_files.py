"""`fanet scenarios`, `init`, `show`, `check`, `schema`: scenario files for people and for their editors."""

import json
import shlex
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from fanet_mw.errors import ConfigError
from sim.cli.options import ScenarioFlags, ScenarioName, print_notes
from sim.console import Console, table, tell
from sim.scenarios.shipped import shipped

if TYPE_CHECKING:
    from fanet_mw.scenario import Scenario

Switch = Annotated[bool, Parameter(negative="")]


def scenarios(*, json_: Annotated[bool, Parameter(name="--json", negative="")] = False) -> int:
    """List the shipped scenarios.

    Args:
        json_: Print JSON instead of a table.

    """
    entries = shipped()
    if json_:
        sys.stdout.write(json.dumps([{"name": e.name, "description": e.description} for e in entries], indent=2) + "\n")
        return 0
    Console().print(table(("scenario", "what it is"), ((entry.name, entry.description) for entry in entries)))
    return 0


def init(
    file: Path,
    *,
    from_: Annotated[ScenarioName, Parameter(name="--from")] = "quick",
    short: Switch = False,
    schema: Switch = False,
    force: Switch = False,
) -> int:
    """Write a scenario file to start from, with every key, its meaning, unit, bound and default in comments.

    Args:
        file: The file to write, for example mine.toml.
        from_: The scenario that it starts from: a shipped one's name or a .toml file.
        short: Write only those keys that the scenario sets.
        schema: Write the JSON schema beside it too, and name it in the first line, so that editors complete and check
            keys.
        force: Replace a file that is there.

    """
    import tomllib

    from fanet_mw.scenario import config
    from fanet_mw.scenario.commented import SCHEMA_NAME, commented
    from sim.scenarios import catalog

    text = catalog.text_of(from_)
    content = commented(tomllib.loads(text), every_key=not short, schema=schema)
    config.parse(content, source=str(file), name="made", folder=file.parent)
    if file.exists() and not force:
        raise ConfigError(f"{file}: is there already; choose another name, or replace it with --force")
    _write(file, content)
    if schema:
        _write(file.parent / SCHEMA_NAME, _schema_text())
    word = shlex.quote(str(file))
    tell(f"written to {file}; next: fanet check {word}, fanet simulate {word}")
    return 0


def show(
    scenario: ScenarioName,
    *,
    choice: ScenarioFlags = ScenarioFlags(),
    changed: Switch = False,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> int:
    """Print a scenario with every value that a run of it would use, as TOML.

    Args:
        scenario: A shipped scenario's name (see `fanet scenarios`) or a .toml file.
        changed: Print only what differs from the defaults.
        json_: Print JSON instead.

    """
    import tomli_w

    from fanet_mw.scenario.config import departures

    chosen = choice.scenario(scenario)
    tree = departures(chosen) if changed else chosen.model_dump(mode="json", exclude_none=True)
    sys.stdout.write(json.dumps(tree, indent=2) + "\n" if json_ else _encodable(tomli_w.dumps(tree)))
    return 0


def check(file: ScenarioName, *, choice: ScenarioFlags = ScenarioFlags()) -> int:
    """Say whether a scenario file is right; name every mistake with its key, value and bound.

    Exit code 0: it is right; 2: it is not.

    Args:
        file: A .toml file, or a shipped scenario's name.

    """
    from fanet_mw.scenario.foreign_modules import modules_of
    from sim.world.possible_world import require_possible

    chosen = choice.scenario(file)
    require_possible(chosen)
    parts = modules_of(chosen)
    if not parts:
        return _say_right(file, chosen)
    from sim.cli.foreign_parts import in_own_process

    return in_own_process(partial(_check_parts, file, chosen), parts)


def _check_parts(file: str, chosen: "Scenario") -> int:
    """Make the parts of other packages as a run does, because their constructors may refuse what they are given."""
    from fanet_mw.part_failure import exits_raised
    from fanet_mw.routing.clustered.clustering.division import Division
    from sim.run.virtual import actors_of

    with exits_raised():
        actors_of(chosen, chosen.name)
        if chosen.routing.protocol == "clustered":  # else nobody leads; a leader makes it in flight
            Division.of(chosen)
    return _say_right(file, chosen)


def _say_right(file: str, chosen: "Scenario") -> int:
    print_notes(chosen)
    Console().print(f"{file}: {_sentence(chosen)}", highlight=False, soft_wrap=True)
    return 0


def schema(file: Path | None = None) -> int:
    """Print the JSON schema of scenario files, from which editors complete and check keys.

    Args:
        file: Where to write it; by default it is printed.

    """
    if file is None:
        sys.stdout.write(_schema_text())
    else:
        _write(file, _schema_text())
        tell(f"written to {file}")
    return 0


def _sentence(scenario: "Scenario") -> str:
    protocol = scenario.routing.protocol
    return (
        f"scenario {scenario.name} is right: {scenario.nodes.count} nodes"
        f"{', a post on the ground' if scenario.post else ''}, {scenario.duration_s:g} s, "
        f"{protocol}, seed {scenario.seed}"
    )


def _encodable(toml: str) -> str:
    """TOML is UTF-8: what an output of another encoding cannot hold is escaped in it."""
    if sys.stdout.encoding.lower() in {"utf-8", "utf8"}:
        return toml
    return "".join(c if c.isascii() else f"\\U{ord(c):08x}" for c in toml)


def _schema_text() -> str:
    from fanet_mw.scenario.reference import json_schema

    return json.dumps(json_schema(), indent=2) + "\n"


def _write(path: Path, text: str) -> None:
    from fanet_mw.whole_file import replace_file, writing

    with writing(path):
        replace_file(path.resolve(), text.encode())

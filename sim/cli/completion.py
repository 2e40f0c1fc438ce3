"""The words that the shell completes: names of scenarios, and keys of a scenario for `--set`."""

from typing import Annotated, TypeAlias

from cyclopts import Parameter
from cyclopts.completion import CompletionContext

from sim.scenarios.shipped import shipped


def scenario_names(context: CompletionContext) -> list[str]:
    """Shipped scenarios; the shell itself offers files."""
    return [entry.name for entry in shipped() if entry.name.startswith(context.incomplete)]


def keys(context: CompletionContext) -> list[str]:
    from fanet_mw.scenario.reference import dotted_keys

    return [f"{key}=" for key in dotted_keys() if key.startswith(context.incomplete)]


ScenarioName: TypeAlias = Annotated[str, Parameter(completer=scenario_names)]
"""A shipped scenario's name, or a .toml file."""

"""What a program hands to a run: a scenario, and applications for its nodes.

A scenario is given as a `Scenario`, as the name of a shipped one, or as the path of a file.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from fanet_mw.application import Application
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from sim.scenarios import catalog
from sim.scenarios.catalog import with_engine

OfUser = Callable[[int], Sequence[Application]] | Mapping[int, Sequence[Application]]
"""A user's applications: a list for each node, or a function that makes the list for a node."""


def scenario_of(given: Scenario | str | Path, *, seed: int | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario that a program has named, with another seed and other values (`KEY=VALUE`); raises ConfigError."""
    if not isinstance(given, Scenario):
        return catalog.find(given, overrides if seed is None else [*overrides, f"seed={seed}"])
    if overrides:
        raise ConfigError("overrides are for scenarios that are named; this one is built already")
    return with_engine(given if seed is None else config.build({**given.model_dump(), "seed": seed}))


def by_node(applications: object, scenario: Scenario) -> Callable[[int], Sequence[Application]]:
    """A function that makes the applications of each node; raises ConfigError for anything else, and unknown nodes."""
    if applications is None:
        return lambda _: ()
    if isinstance(applications, Mapping):
        known_nodes("applications", applications, scenario)
    elif not callable(applications):
        kind = type(applications).__name__
        raise ConfigError(f"applications must be a mapping by node, or be called with a node's id, not a {kind}")

    aboard: dict[int, tuple[Application, int]] = {}  # which keeps them, so that no other object gets the same id

    def checked(node: int) -> Sequence[Application]:
        made = applications.get(node, ()) if isinstance(applications, Mapping) else applications(node)
        if not isinstance(made, Sequence) or not all(isinstance(one, Application) for one in made):
            raise ConfigError(f"applications of node {node} = {made!r}: must be a sequence of Application objects")
        for one in made:
            other = aboard.setdefault(id(one), (one, node))[1]
            if other != node:
                raise ConfigError(f"applications of node {node}: {one.name!r} is that of node {other}, must be its own")
        return made

    return checked


def known_nodes(what: str, nodes: Collection[int], scenario: Scenario) -> None:
    """Raise ConfigError for a node that the scenario does not have."""
    for node in nodes:
        if node not in scenario.node_ids:
            raise ConfigError(f"{what}: node {node!r} must be in [1, {scenario.last_id}]")

"""Finds a scenario by name or path, reads and checks it."""

import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.text_files import read_text
from fanet_mw.wire.search_plan import MOST_PLACES
from sim.scenarios.shipped import Entry, entry, is_file, shipped

__all__ = ["Entry", "find", "shipped", "text_of"]


def find(name: str | Path, overrides: Iterable[str] = ()) -> Scenario:
    """The scenario in a file (a Path, or text with a slash or ending in .toml), or else the shipped one of that name.

    `overrides` are `KEY=VALUE`. Raises ConfigError with all mistakes.
    """
    if not isinstance(name, str | Path):
        raise ConfigError(f"scenario = {name!r}: must be a Scenario, the name of a shipped one, or a file")
    if isinstance(name, Path) or _is_file(name):
        return _searchable(config.load(Path(name), overrides), str(name))
    source = f"scenario {name}"
    return _searchable(config.parse(entry(name).text, source=source, name=name, overrides=overrides), source)


def _searchable(scenario: Scenario, source: str) -> Scenario:
    """The scenario with an engine that is there, if it has enough UAVs for the search that it asks for; raises
    ConfigError otherwise.
    """
    scenario = with_engine(scenario)
    search = scenario.mission.search
    if scenario.mission.formation != "none":
        for problem in _beyond_the_fence(scenario):
            raise ConfigError(f"{source}: {problem}")
    if search == "none":
        return scenario
    from agents.mission.searcher import demands_of, formation, least_nodes, unflyable

    for problem in unflyable(scenario):
        raise ConfigError(f"{source}: {problem}")
    count, area_m = scenario.nodes.count, scenario.world.area_m
    if formation(scenario, count) is None:
        least, demands, mission = least_nodes(scenario), demands_of(scenario), scenario.mission
        limit = f"radio.range_m = {scenario.radio.range_m:g}"
        if demands.phones_limit:
            limit += (
                f" and phones received within {demands.seen_m:.0f} m of a lane (mission.detection_dbm = "
                f"{mission.detection_dbm:g}, phone_power_dbm = {mission.phone_power_dbm:g}, phone_exponent = "
                f"{mission.phone_exponent:g}, rubble_db = {mission.rubble_db:g}, nodes.altitude_m = "
                f"{scenario.nodes.altitude_m:g})"
            )
        raise ConfigError(
            f"{source}: nodes.count = {count}: mission.search = {search!r} over world.area_m = {area_m:g} needs "
            f"{f'more than {MOST_PLACES}' if least is None else f'at least {least}'} UAVs with {limit}"
            f"{f'; a plan names at most {MOST_PLACES}' if least is None else ''}"
        )
    return scenario


def _beyond_the_fence(scenario: Scenario) -> Iterator[str]:
    route_m = scenario.mission.route_m
    if not route_m:
        return
    from sim.world.mobility.geofence import FENCE_M, fence_of

    fence = fence_of(scenario)
    for index, (east, north) in enumerate(route_m):
        if abs(east) > fence.reach_m[0] or abs(north) > fence.reach_m[1]:
            reach = ", ".join(f"+-{reach_m:g}" for reach_m in fence.reach_m)
            yield (
                f"mission.route_m.{index} = [{east:g}, {north:g}] must be within [{reach}], the geofence {FENCE_M:g} m "
                f"around world.area_m = {scenario.world.area_m:g} and all starts: the leader would never get there"
            )


def text_of(name: str) -> str:
    """The text of a valid scenario: that of a file, or that of the shipped scenario of this name."""
    find(name)
    return read_text(Path(name), what=name) if _is_file(name) else entry(name).text


def _is_file(name: str) -> bool:
    return is_file(name, [entry.name for entry in shipped()])


def with_engine(scenario: Scenario) -> Scenario:
    """The scenario; with the engine `kinematic` in place of a pybullet that is not there, which is said once."""
    if scenario.world.engine != "pybullet" or find_spec("pybullet") is not None:
        return scenario
    say_engine()
    world = scenario.world.model_copy(update={"engine": "kinematic"})
    return scenario.model_copy(update={"world": world})


@cache
def say_engine() -> None:
    sys.stderr.write(
        "pybullet is not installed (pip install 'fanet-mw[pybullet]'): world.engine = \"kinematic\" serves instead.\n"
    )

"""What a scenario says that will not happen, or that had to be guessed: sentences for its author, who may have meant
something else. No run is refused for it.
"""

from collections.abc import Iterator
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import S

_NAMED: Final = 3
"""A note names at most this many things, and gives the number of the others."""


def notes(scenario: Scenario) -> list[str]:
    """One sentence for each."""
    return [*_after_the_end(scenario), *_guessed(scenario)]


def _after_the_end(scenario: Scenario) -> Iterator[str]:
    for index, fault in enumerate(scenario.faults):
        if fault.at_s >= scenario.duration_s:
            yield f"faults.{index}.at_s = {fault.at_s:g}: after the end, duration_s = {scenario.duration_s:g}"
    begins_s, ends_s = (instant / S for instant in scenario.traffic_window_ns)
    for name, traffic in scenario.traffic_classes.items():
        start_s = begins_s if traffic.start_s is None else traffic.start_s
        if traffic.arrivals != "none" and start_s >= ends_s:
            yield f"{name}: start_s = {start_s:g}, after the last packet, duration_s - drain_s = {ends_s:g}"
        elif late := [at_s for at_s, _ in traffic.packets if start_s + at_s >= ends_s]:
            yield (
                f"{name}: {len(late)} of {len(traffic.packets)} packets come too late to be sent, from "
                f"{start_s + min(late):g} s on; duration_s - drain_s = {ends_s:g}"
            )


def _guessed(scenario: Scenario) -> Iterator[str]:
    world = scenario.world
    if not world.buildings_geojson:
        return
    from sim.world.environment.obstacles import town_of  # it brings numpy

    try:
        town = town_of(world)
    except ConfigError:
        return  # whoever builds the world says what is wrong with the file
    for what, found in (("of heights that were guessed", town.guessed), ("outlines that enclose nothing", town.broken)):
        if found:
            others = f"; and {len(found) - _NAMED} others" if len(found) > _NAMED else ""
            noun = "buildings " if found is town.guessed else ""
            yield f"world.buildings_geojson: {len(found)} {noun}{what}: {'; '.join(found[:_NAMED])}{others}"

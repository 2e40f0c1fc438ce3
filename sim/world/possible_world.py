"""Refuses, before a run begins, what no run could build: obstacles, no-fly areas and starts that contradict each
other.
"""

import json

from fanet_mw.scenario import Scenario


def require_possible(scenario: Scenario) -> None:
    """Build what stands in the world, and place the UAVs, as a run does; raises ConfigError as that would."""
    world = scenario.world
    if not (world.has_obstacles or world.no_fly_m):
        return
    # imported here, because they bring numpy, which scenarios without any of this do not need
    import numpy as np

    from sim.world.environment.layout import positions
    from sim.world.environment.obstacles import obstacles
    from sim.world.incidents import NoFlyEntries

    starts = np.array(positions(scenario), dtype=np.float64)
    if world.has_obstacles:
        obstacles(scenario, starts)
    NoFlyEntries(world.no_fly_m, starts[: scenario.nodes.count])


class PossibleWorlds:
    """Does the same for many scenarios, and builds each distinct world once."""

    def __init__(self) -> None:
        self._built: set[str] = set()

    def require(self, scenario: Scenario) -> None:
        """Raises ConfigError if the world of this scenario cannot be built."""
        world = scenario.world
        drawn = scenario.nodes.layout == "disc" or world.terrain_m > 0 or isinstance(world.buildings, int)
        seed = scenario.seed if drawn else None
        key = json.dumps([seed, world.model_dump(mode="json"), scenario.nodes.model_dump(mode="json"),
                          scenario.ground.model_dump(mode="json")])  # fmt: skip
        if key not in self._built:
            require_possible(scenario)
            self._built.add(key)

"""Where the survivors are, and which of them are buried. Ids run from 1."""

from collections.abc import Callable

import numpy as np

from fanet_mw.rng import stream
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu
from sim.world.engine import Flags, Rows, Values


def place(scenario: Scenario) -> list[Enu]:
    """The true positions: uniform over the area, on the plain."""
    random = stream(scenario.seed, "survivors")
    half = scenario.world.area_m / 2
    return [
        Enu(random.uniform(-half, half), random.uniform(-half, half), 0.0) for _ in range(scenario.mission.survivors)
    ]


class Survivors:
    """The survivors of a run, as sensors need them; row i is survivor i + 1."""

    places: Rows
    """Positions, on the ground."""
    buried: Flags
    """Who lies under rubble: a phone and a voice come through it weakened, nothing is seen."""

    def __init__(self, scenario: Scenario, ground_m: Callable[[Rows], Values] | None = None) -> None:
        """`ground_m`: heights of the ground at places [n, 3]; None: a plain at 0."""
        count = scenario.mission.survivors
        self.places = np.array(place(scenario), dtype=np.float64).reshape(-1, 3)
        if ground_m is not None and count:
            self.places[:, 2] = ground_m(self.places)
        self.buried = np.zeros(count, bool)
        random = stream(scenario.seed, "buried")
        self.buried[random.sample(range(count), round(scenario.mission.buried * count))] = True

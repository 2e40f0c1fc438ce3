"""Finds out which pairs of nodes have something solid between them.

Only pairs within the radio's reach are examined, and only if one end is below the highest obstacle. Not modeled:
diffraction over an edge, the Fresnel zone, and the thickness of an obstacle. Survivors' phones are not examined,
because they can be received through walls.
"""

from array import array

import numpy as np

from emulator.channel.propagation import gains_dbi, pairs_in_reach
from fanet_mw.bus.messages import Obstructions
from fanet_mw.scenario import Scenario
from sim.world.engines.contract import Rows
from sim.world.environment.solids import Solids


class Sight:
    """The lines of sight between bodies."""

    def __init__(self, scenario: Scenario, solids: Solids) -> None:
        self._radio, self._gains = scenario.radio, gains_dbi(scenario)
        self._solids = solids

    def obstructions(self, at: Rows, now_ns: int) -> Obstructions:
        """The blocked pairs among nodes at `at` [nodes, 3]."""
        found, _ = pairs_in_reach(at, self._radio, self._gains)
        found = found[found[:, 0] < found[:, 1]]
        found = found[np.minimum(at[found[:, 0], 2], at[found[:, 1], 2]) < self._solids.top_m]
        if len(found):
            found = found[self._solids.blocked(at[found[:, 0]], at[found[:, 1]])]
        return Obstructions(now_ns, array("H", (found + 1).ravel().tolist()))

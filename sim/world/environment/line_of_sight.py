"""Finds out which pairs of nodes have something solid between them, and what that costs their link.

Only pairs within the radio's reach are examined, and only if one end is below the highest obstacle. With
`radio.obstruction_loss_db = "knife_edge"` pairs count whose straight line passes near an edge, too (`diffraction.py`).
Not modeled: waves through walls. Survivors' phones are not examined, because they can be received through walls.
"""

from array import array

import numpy as np

from emulator.channel.propagation import gains_dbi, pairs_in_reach
from fanet_mw.bus.messages import Obstructions
from fanet_mw.scenario import Scenario
from fanet_mw.units import LIGHT_M_PER_S
from sim.world.arrays import Rows
from sim.world.environment.diffraction import FRESNEL_M, loss_db
from sim.world.environment.solids import Solids


class Sight:
    """The lines of sight between bodies."""

    def __init__(self, scenario: Scenario, solids: Solids) -> None:
        radio = self._radio = scenario.radio
        self._gains = gains_dbi(scenario)
        self._wavelength_m = LIGHT_M_PER_S / (radio.frequency_mhz * 1e6)
        self._knife_edges = radio.channel != "range" and radio.obstruction_loss_db == "knife_edge"
        self._solids = solids

    def obstructions(self, at: Rows, now_ns: int) -> Obstructions:
        """The pairs among nodes at `at` [nodes, 3] with something between them."""
        ground = array("f", self._solids.ground_m(at).tolist() if self._solids.hilly else ())
        found, _ = pairs_in_reach(at, self._radio, self._gains)
        found = found[found[:, 0] < found[:, 1]]
        top_m = self._solids.top_m + (FRESNEL_M if self._knife_edges else 0.0)
        found = found[np.minimum(at[found[:, 0], 2], at[found[:, 1], 2]) < top_m]
        losses = array("H")
        if len(found) and self._knife_edges:
            first, second = at[found[:, 0]], at[found[:, 1]]
            tenths = np.rint(10 * loss_db(self._solids, first, second, wavelength_m=self._wavelength_m)).astype(int)
            found, losses = found[tenths > 0], array("H", tenths[tenths > 0].tolist())
        elif len(found):
            found = found[self._solids.blocked(at[found[:, 0]], at[found[:, 1]])]
        return Obstructions(now_ns, array("H", (found + 1).ravel().tolist()), losses, ground)

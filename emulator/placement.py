"""The places of the stations, what stands between them, and the links that follow from both."""

import numpy as np
import numpy.typing as npt

from emulator.channel.propagation import LinkTable, pair_codes
from emulator.channel.shadowing import Shadowing
from fanet_mw.scenario import Scenario


class Placement:
    """Positions and obstructions in force; at first no station is within reach of another."""

    def __init__(self, scenario: Scenario, *, stations: int) -> None:
        self._radio = scenario.radio
        self._shadowing = Shadowing(scenario.radio, seed=scenario.seed) if scenario.radio.shadowing_db else None
        self.at = np.full((stations, 3), np.inf)
        """The positions [m]."""
        self._blocked = np.zeros(0, np.int64)
        self._sight_changed = False
        """True when the obstructions have changed since the stations were placed."""

    def obstruct(self, pairs: npt.NDArray[np.int64]) -> None:
        """Set the pairs of stations [n, 2] between which something stands; it counts from the next `place` on."""
        blocked = np.unique(pair_codes(pairs, len(self.at)))
        self._sight_changed = self._sight_changed or not np.array_equal(blocked, self._blocked)
        self._blocked = blocked

    def place(self, at: npt.NDArray[np.float64]) -> bool:
        """Take over new positions; returns False when the links stay as they are."""
        if np.array_equal(at, self.at) and not self._sight_changed:
            return False
        self._sight_changed = False
        self.at = at
        return True

    def links(self, *, spare: int) -> LinkTable:
        """The links between the stations, with room for `spare` more."""
        at = np.ascontiguousarray(self.at)
        return LinkTable(at, self._radio, spare=spare, shadowing=self._shadowing, blocked=self._blocked)

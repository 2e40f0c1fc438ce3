"""The places of the stations, the obstructions between them, and the links that follow from both."""

import numpy as np
import numpy.typing as npt

from emulator.channel.propagation import Blocked, LinkTable, gains_dbi, pair_codes
from emulator.channel.shadowing import Shadowing
from fanet_mw.scenario import Scenario


class Placement:
    """The positions and obstructions in force; at first no station is within reach of another."""

    def __init__(self, scenario: Scenario, *, stations: int) -> None:
        self._radio = scenario.radio
        self._gains = gains_dbi(scenario)
        self._shadowing = Shadowing(scenario.radio, seed=scenario.seed) if scenario.radio.shadowing_db else None
        self.at = np.full((stations, 3), np.inf)
        """The positions [m]."""
        self._blocked = Blocked(np.zeros(0, np.int64), np.zeros(0))
        self._sight_changed = False
        """True if the obstructions have changed since the stations were placed."""

    def obstruct(self, pairs: npt.NDArray[np.int64], losses_db: npt.NDArray[np.float64]) -> None:
        """Set the pairs of stations [n, 2] with something solid between them, and the loss of each, if that is known.

        It takes effect at the next `place`.
        """
        codes, first = np.unique(pair_codes(pairs, len(self.at)), return_index=True)
        blocked = Blocked(codes, losses_db[first] if len(losses_db) else losses_db)
        changed = not all(map(np.array_equal, blocked, self._blocked))
        self._sight_changed = self._sight_changed or changed
        self._blocked = blocked

    def place(self, at: npt.NDArray[np.float64]) -> bool:
        """Take over new positions; returns False if the links stay as they are."""
        if np.array_equal(at, self.at) and not self._sight_changed:
            return False
        self._sight_changed = False
        self.at = at
        return True

    def links(self, *, spare: int) -> LinkTable:
        """The links between the stations, with room for `spare` more."""
        at = np.ascontiguousarray(self.at)
        return LinkTable(
            at, self._radio, spare=spare, shadowing=self._shadowing, blocked=self._blocked, gains=self._gains
        )

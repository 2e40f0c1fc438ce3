"""Which confirmations are contradicted by what one UAV has heard and seen since: somebody else lies where they were.

Whose phone a person carries is told by received powers, and few powers may tell it wrongly where two people lie near
each other. The powers that are heard after a confirmation go into the filter of the phone all the same. Once another
assignment of phones to people is far more likely than any with the confirmed pair, the confirmation is taken back.
"""

from typing import Final

from agents.mission.finding.finds import Find, Finds
from agents.mission.finding.identities import Identities

_FRESH: Final = 4
"""A confirmation is judged each time that so many further powers have been received."""
_SAMPLES: Final = 12
"""The fewest powers that refute."""
_SURE_M: Final = 45.0
"""The largest standard deviation of the place of a phone, by received powers alone, that refutes."""
_MARGIN: Final = 6.0
"""Twice the difference of the logarithms of likelihoods that refutes: the confirmed pair is 20 times less likely. Of
577 simulated pairs of people 35 to 100 m apart who were confirmed rightly, none came to more than 1."""


class Contradictions:
    """The confirmations that one UAV judges, by its own filters and by the people whom it has seen."""

    def __init__(self, finds: Finds, identities: Identities) -> None:
        self._finds, self._identities = finds, identities
        self._judged: dict[int, int] = {}
        """For each confirmed survivor, how many powers had been received when it was judged last."""

    def review(self) -> list[int]:
        """The confirmed survivors who cannot be where they were confirmed, in order of id."""
        return [
            survivor for survivor, find in sorted(self._finds.known.items()) if self._is_contradicted(survivor, find)
        ]

    def _is_contradicted(self, survivor: int, find: Find) -> bool:
        if find.confirmed is None:
            self._judged.pop(survivor, None)
            return False
        received = find.filter.included_powers + find.filter.pending_powers
        if received - self._judged.setdefault(survivor, received) < _FRESH:
            return False
        self._judged[survivor] = received
        margin = self._identities.against(find.confirmed)  # takes in what is pending
        heard = find.filter.estimate_by_power()
        sure = heard is not None and heard.sigma_m <= _SURE_M and find.filter.included_powers >= _SAMPLES
        return sure and margin >= _MARGIN

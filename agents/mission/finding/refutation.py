"""Decides when a confirmation is taken back: later powers make another assignment of phones to people far likelier."""

from typing import Final

from agents.mission.finding.identities import Identities
from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors

_FRESH: Final = 4
"""A confirmation is judged each time that this number of further powers of the phone has been received."""
_SAMPLES: Final = 12
"""A confirmation is not refuted by fewer powers of the phone than this."""
_SURE_M: Final = 45.0
"""A confirmation is not refuted while the phone's place, by powers alone, has a greater standard deviation."""
_MARGIN: Final = 6.0
"""The least difference of costs (`Identities.against`) that refutes: the confirmed pair is then 20 times less likely.
Of 577 simulated pairs of people 35 to 100 m apart who were confirmed rightly, none came to more than 1."""


class Refutation:
    """The confirmations that later powers contradict."""

    def __init__(self, survivors: KnownSurvivors, identities: Identities) -> None:
        self._survivors, self._identities = survivors, identities
        self._judged: dict[int, int] = {}
        """For each confirmed survivor, the number of received powers when the confirmation was last judged."""

    def review(self) -> list[int]:
        """The survivors whose confirmations are refuted, in order of id."""
        return [
            survivor for survivor, known in sorted(self._survivors.by_id.items()) if self._is_refuted(survivor, known)
        ]

    def _is_refuted(self, survivor: int, known: KnownSurvivor) -> bool:
        if known.confirmed is None:
            self._judged.pop(survivor, None)
            return False
        received = known.filter.received_powers
        if received - self._judged.setdefault(survivor, received) < _FRESH:
            return False
        self._judged[survivor] = received
        margin = self._identities.against(known.confirmed)  # this also makes the filter include all pending powers
        sure = known.is_heard_within(_SURE_M) and known.filter.included_powers >= _SAMPLES
        return sure and margin >= _MARGIN

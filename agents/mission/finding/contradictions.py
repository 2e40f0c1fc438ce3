"""Finds the confirmations that are contradicted by powers and sightings that came later: a person was confirmed who
does not carry that phone.

Received powers decide which person carries which phone, and where two people lie near each other, few powers may decide
wrongly. Powers that are received after a confirmation therefore go into the phone's filter, too. Once another
assignment of phones to people is far more likely than any with the confirmed pair of person and phone, the confirmation
is taken back.
"""

from typing import Final

from agents.mission.finding.identities import Identities
from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors

_FRESH: Final = 4
"""A confirmation is judged each time that this number of further powers of the phone has been received."""
_SAMPLES: Final = 12
"""A confirmation is not refuted by fewer powers of the phone than this."""
_SURE_M: Final = 45.0
"""A confirmation is not refuted while the place of the phone, by received powers alone, has a greater standard
deviation than this."""
_MARGIN: Final = 6.0
"""The least difference of costs (`Identities.against`) that refutes: the confirmed pair is then 20 times less likely.
Of 577 simulated pairs of people 35 to 100 m apart who were confirmed rightly, none came to more than 1."""


class Contradictions:
    """Judges confirmations at one UAV, by its filters and by the people whom it has seen."""

    def __init__(self, survivors: KnownSurvivors, identities: Identities) -> None:
        self._survivors, self._identities = survivors, identities
        self._judged: dict[int, int] = {}
        """For each confirmed survivor, the number of received powers when the confirmation was judged last, or first
        noticed here."""

    def review(self) -> list[int]:
        """The survivors whose confirmations are contradicted, in order of id."""
        return [
            survivor
            for survivor, known in sorted(self._survivors.by_id.items())
            if self._is_contradicted(survivor, known)
        ]

    def _is_contradicted(self, survivor: int, known: KnownSurvivor) -> bool:
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

"""What a UAV believes of what others say about survivors: no report and no place that cannot be.

    instant     not in the future: such a report would be the newest one for ever, and fill all hellos
    power       no greater than that of the strongest phone at 1 m: the grid of a phone lies around its strongest power
    place       a reporter not so far from the area that no phone there can be received; a survivor in the area

A message is refused by what it says alone. Whether one that could be true is true, only other measurements tell
(`sightings.py`), or signatures.
"""

import math
from typing import Final

from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from fanet_mw.node.reader import FUTURE_NS
from fanet_mw.units import FARTHEST_M, US
from fanet_mw.wire.search_messages import Told
from fanet_mw.wire.survivors import Found, Survivor

_STRONGER_DB: Final = 18.0
"""By how much a phone may be stronger than assumed: as far as the calibration looks for it (`calibration.py`)."""
_SHADOWING_SIGMAS: Final = 4.0
"""How many standard deviations of the shadowing may add to that."""
_BESIDE_M: Final = 100.0
"""How far outside the area the place of a survivor may be stated, whose ground is taken to be level."""


class Plausibility:
    """The bounds of what others may say about survivors."""

    def __init__(self, model: PhoneModel) -> None:
        """`model`: the assumptions about phones, and the area."""
        strongest_dbm = model.power_dbm + _STRONGER_DB + _SHADOWING_SIGMAS * model.shadowing_db
        self._most_dbm = strongest_dbm - REFERENCE_LOSS_DB
        decades = (self._most_dbm - model.threshold_dbm) / (10 * model.exponent)
        self._reporter_m = model.half_m + math.pow(10.0, max(0.0, min(math.log10(FARTHEST_M), decades)))
        self._survivor_m = model.half_m + _BESIDE_M

    def holds(self, told: Told, *, now_ns: int) -> bool:
        """False for a report or a find that cannot be true; True for all other messages."""
        if isinstance(told, Survivor):
            at = told.position
            possible = told.rssi_dbm <= self._most_dbm and max(abs(at.east), abs(at.north)) <= self._reporter_m
        elif isinstance(told, Found):
            possible = max(abs(told.east_m), abs(told.north_m)) <= self._survivor_m
        else:
            return True
        return possible and told.t_us * US <= now_ns + FUTURE_NS

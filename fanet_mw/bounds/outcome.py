"""A bound either holds or is refused with the sentence that says why; there is no third, optimistic answer."""

from typing import NamedTuple


class Bounded(NamedTuple):
    """No packet waits longer than this, under the assumptions of the function that returned it."""

    delay_ns: int


class Refused(NamedTuple):
    """No bound exists, or none can be given: the name, the value and the limit that was passed."""

    reason: str


Outcome = Bounded | Refused

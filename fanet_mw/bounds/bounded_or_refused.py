"""The result of a function that bounds a delay: either a bound that holds, or a refusal with the reason."""

from typing import NamedTuple


class Bounded(NamedTuple):
    """No packet waits longer than this, under the assumptions of the function that returned it."""

    delay_ns: int


class Refused(NamedTuple):
    """No bound exists, or none can be given; the reason names the quantity, its value and the limit it exceeds."""

    reason: str


DelayBound = Bounded | Refused

"""What a bound's function returns: a bound that holds, or a refusal with its reason; there is no optimistic third."""

from typing import NamedTuple


class Bounded(NamedTuple):
    """No packet waits longer than this, under the assumptions of the function that returned it."""

    delay_ns: int


class Refused(NamedTuple):
    """No bound exists, or none can be given; the reason names the quantity, its value and the limit it exceeds."""

    reason: str


DelayBound = Bounded | Refused

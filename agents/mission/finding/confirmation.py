"""Decides when a survivor may be confirmed: a person was seen at close range, and one phone surely is that person's.

    camera and voice     show the person often enough from close by, so that the place is certain within metres
    received powers      are enough, from enough nodes, to tell roughly where the phone is
    the next best        assignment of phones to people (`identities.py`) is far less likely

A UAV that is not certain receives more powers, and is content with less certainty after a while.
"""

from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.person_track import PersonTrack
from fanet_mw.units import S
from fanet_mw.wire.survivors import Standing

CLOSE_M: Final = 100.0
"""The greatest slant range from which a call counts for a confirmation. Whom a camera shows counts from any height: how
often it shows people from there is known (`camera_view.py`)."""
GREATEST_MARGIN: Final = 9.0
"""By how much the next best assignment must cost more, at first: it is then 90 times less likely."""
_LEAST_MARGIN: Final = 2.0
"""By how much the next best assignment must cost more in the end: it is then 2.7 times less likely."""
_PATIENT_NS: Final = 15 * S
"""The time since the first sighting up to which the whole margin is required."""
_IMPATIENT_NS: Final = 50 * S
"""The time since the first sighting from which only the least margin is required; it decreases linearly in between."""
_UNDECIDED_NS: Final = 30 * S
"""The time since the first sighting after which a survivor is said to be among several people."""
_SIGHTINGS: Final = 2
"""A person is not confirmed before this number of sightings by a camera, or calls from close by."""
_SURE_M: Final = 3.5
"""The greatest standard deviation of a confirmed place."""
_VAGUE_M: Final = 120.0
"""No owner is confirmed for a phone whose place, by received powers, has a greater standard deviation than this."""
_SAMPLES: Final = 6
"""The least number of received powers of a phone for confirming its owner, if `_REPORTERS` nodes have received it."""
_REPORTERS: Final = 2
"""With fewer nodes than this that have received a phone, `_SAMPLES_ALONE` powers are needed."""
_SAMPLES_ALONE: Final = 8
"""The least number of received powers if only one node has received the phone, as may be at the edge of the area."""


def is_seen_enough(person: PersonTrack) -> bool:
    """True if a person was seen often enough from close by, so that it is no false alarm."""
    return person.close_sightings >= _SIGHTINGS and person.is_proven


def is_confirmable(person: PersonTrack, phone: KnownSurvivor) -> bool:
    """True if sightings and received powers suffice; how likely the assignment is, `required_margin` judges."""
    enough = _SAMPLES if len(phone.reporters) >= _REPORTERS else _SAMPLES_ALONE
    return (
        is_seen_enough(person)
        and person.place.sigma_m <= _SURE_M
        and phone.is_heard_within(_VAGUE_M)
        and phone.filter.included_powers >= enough
    )


def required_margin(person: PersonTrack, phone: KnownSurvivor, now_ns: int) -> float:
    """By how much more all other carriers together must cost; decreases with the time since the first sighting, unless
    the owner is known to be among several people, for whom nobody waits any more.
    """
    if phone.settled is not None and phone.settled.standing is Standing.AMONG:
        return GREATEST_MARGIN
    share = (now_ns - person.first_ns - _PATIENT_NS) / (_IMPATIENT_NS - _PATIENT_NS)
    return GREATEST_MARGIN - (GREATEST_MARGIN - _LEAST_MARGIN) * min(1.0, max(0.0, share))


def is_undecided(person: PersonTrack, margin: float, now_ns: int) -> bool:
    """True if looking longer would hardly tell whose phone it is: not even the least margin is reached after long."""
    return margin < _LEAST_MARGIN and now_ns - person.first_ns >= _UNDECIDED_NS

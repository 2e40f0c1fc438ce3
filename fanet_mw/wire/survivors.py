"""The messages about survivors: a report that a phone was received, and an estimate or a verdict about a place."""

import math
from enum import IntEnum
from typing import Any, Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import FARTHEST_M, Enu
from fanet_mw.wire.checks import place_within, refuse_unless, require_sender
from fanet_mw.wire.frame import ANY_NODE, FOUND, LATEST_US, SURVIVOR, VERSION, Packed, decode_first, encode_inner

MOST_DBM: Final = 300.0
"""The greatest absolute value of a received power."""
MOST_SURVIVORS: Final = 10_000
"""The greatest id of a survivor, which bounds how much must be remembered."""
_FIRST_PERSON: Final = 1_000_000
_PER_NODE: Final = 10_000
"""People without a phone have numbers from `_FIRST_PERSON` on, so many for each node that may find them."""
_MOST_VARIANCE_M2: Final = 1e10


def person_id(node: int, number: int) -> int:
    """The number of a person whom a node has found without a phone, its first, second, ... one from 0 on."""
    return _FIRST_PERSON + node * _PER_NODE + number % _PER_NODE


def is_person(survivor: int) -> bool:
    """True for the number of a person who was found without a phone, not that of a phone."""
    return survivor >= _FIRST_PERSON


def called(survivor: int) -> str:
    return "a person without a phone" if is_person(survivor) else f"survivor {survivor}"


class Survivor(NamedTuple):
    """FANET_SURVIVOR: `reporter`, at `position`, receives the phone of `survivor`."""

    t_us: int
    survivor: int
    reporter: int
    position: Enu
    rssi_dbm: float

    def encode_frame(self, node: int) -> bytes:
        payload = SURVIVOR.layout.pack(self.t_us, self.survivor, *self.position, self.rssi_dbm, self.reporter, VERSION)
        return encode_inner(SURVIVOR, payload, node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        return cls.checked(decode_first(SURVIVOR, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        t_us, survivor, east, north, up, rssi_dbm, reporter, version = fields
        require_sender(version, reporter, t_us=t_us)
        if not abs(rssi_dbm) <= MOST_DBM or not 0 < survivor <= MOST_SURVIVORS:  # also true for NaN
            raise MalformedFrameError(f"rssi {rssi_dbm} of survivor {survivor}")
        return cls(t_us, survivor, reporter, place_within(east, north, up, most=FARTHEST_M), rssi_dbm)


class Standing(IntEnum):
    """The meaning of a FANET_FOUND for the place that it names."""

    ESTIMATED = 0
    CONFIRMED = 1
    REFUTED = 2
    """Confirmations at this place are taken back, because later receptions contradict them."""
    INSIDE = 3
    """The survivor is most probably inside the building at this place, where no camera shows anybody."""
    AMONG = 4
    """The survivor is one of several people who were seen around this place; powers do not tell which."""


class Found(NamedTuple):
    """FANET_FOUND: the estimated place of a survivor, a confirmation at that place, or its refutation."""

    t_us: int
    survivor: int
    east_m: float
    north_m: float
    east_variance_m2: float
    covariance_m2: float
    north_variance_m2: float
    node: int
    standing: Standing

    @property
    def sigma_m(self) -> float:
        """The standard deviation of the place in its worst direction."""
        mean = (self.east_variance_m2 + self.north_variance_m2) / 2
        spread = math.hypot((self.east_variance_m2 - self.north_variance_m2) / 2, self.covariance_m2)
        return math.sqrt(max(0.0, mean + spread))

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(FOUND, FOUND.layout.pack(*self, VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_FOUND in a frame; raises MalformedFrameError, also for an impossible covariance."""
        return cls.checked(decode_first(FOUND, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        *values, standing, version = fields
        refuse_unless(version == VERSION and standing <= Standing.AMONG, f"a find of standing {standing}")
        found = cls._make((*values, Standing(standing)))
        refuse_unless(
            (0 < found.survivor <= MOST_SURVIVORS or _is_of_a_node(found))
            and 0 < found.node < ANY_NODE
            and found.t_us <= LATEST_US,
            f"survivor {found.survivor} found by {found.node}",
        )
        east, north = found.east_variance_m2, found.north_variance_m2
        refuse_unless(
            abs(found.east_m) <= FARTHEST_M
            and abs(found.north_m) <= FARTHEST_M
            and 0 <= east <= _MOST_VARIANCE_M2
            and 0 <= north <= _MOST_VARIANCE_M2
            and abs(found.covariance_m2) <= math.sqrt(east * north) * (1 + 1e-3) + 1e-3,
            f"an estimate with variances {east}, {north} and covariance {found.covariance_m2}",
        )
        return found


def _is_of_a_node(found: Found) -> bool:
    """True for the verdict on a person without a phone, whose number is one of those of a node."""
    of_a_node = person_id(1, 0) <= found.survivor < person_id(ANY_NODE, 0)
    return of_a_node and found.standing in (Standing.CONFIRMED, Standing.REFUTED)

"""The inner messages of a planned search: the plan, statuses of UAVs, bids for tasks, and the places of survivors.

Like the rest of this dialect they are coded by struct. Any bytes decode to a message or to MalformedFrameError; values
that no node of this project would send are malformed.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import Any, Final, NamedTuple, Self

from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.units import FARTHEST_M, Enu
from fanet_mw.wire.frame import (
    ANY_NODE,
    BIDS,
    COVERED,
    FOUND,
    LATEST_US,
    SEARCH,
    STATUS,
    SURVIVOR,
    VERSION,
    Packed,
    decode_first,
    encode_inner,
    fields_of_each,
)
from fanet_mw.wire.inner import MOST_SURVIVORS, Survivor

MOST_PLACES: Final = 79
"""The number of places of a formation that one message can assign."""
MOST_BIDS: Final = 12
"""The number of bids in one message."""
COVERED_SIDE: Final = 32
"""The number of rows and columns of cells into which the area is divided for the map of searched cells."""
_COVERED_BYTES: Final = COVERED_SIDE * COVERED_SIDE // 8
WITHDRAWN: Final = 0xFFFF
"""The time of arrival that marks a withdrawn bid."""
_MOST_VARIANCE_M2: Final = 1e10
_LINES: Final = 0
_SPIRAL: Final = 1
_LAST_SHAPE: Final = 2
_LEAST_M: Final = 1.0
"""The least value of those lengths of a formation that must not be 0."""
_FASTEST_M_S: Final = 1000.0


def _refuse_unless(holds: bool, what: str) -> None:
    if not holds:
        raise MalformedFrameError(what)


class Search(NamedTuple):
    """FANET_SEARCH: the plan of a search."""

    start_us: int
    half_width_m: float
    first_m: float
    last_m: float
    height_m: float
    speed_m_s: float
    deploy_ds: int
    revision: int
    planner: int
    nodes: tuple[int, ...]
    """The node at each place; 0 if the place is vacant."""
    lanes: int
    relays: int
    followers: int
    shape: int = 0
    """0: lines, 1: spiral, 2: sectors."""
    teams: int = 2

    def encode_frame(self, node: int) -> bytes:
        if len(self.nodes) > MOST_PLACES:
            raise LocalProtocolError(f"a plan of {len(self.nodes)} places must have <= {MOST_PLACES}")
        unused = (0,) * (MOST_PLACES - len(self.nodes))
        return encode_inner(SEARCH, SEARCH.layout.pack(*self[:9], *self.nodes, *unused, *self[10:], VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first plan in a frame; raises MalformedFrameError for a plan that no swarm could fly."""
        return cls.checked(decode_first(SEARCH, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        """The plan of these fields; raises MalformedFrameError."""
        lanes, relays, followers, shape, teams, version = fields[-6:]
        places = teams * lanes + relays + followers
        in_lines = shape == _LINES and teams == 2 and lanes >= 2
        other = _LINES < shape <= _LAST_SHAPE and teams >= 1 and lanes >= 1 and relays == 0
        _refuse_unless(
            version == VERSION and (in_lines or other) and places <= MOST_PLACES,
            f"a plan of {places} places in {teams} teams, shape {shape}",
        )
        nodes = fields[9 : 9 + places]
        plan = cls._make((*fields[:9], nodes, lanes, relays, followers, shape, teams))
        named = [node for node in nodes if node]
        _refuse_unless(
            plan.start_us <= LATEST_US
            and 0 < plan.planner < ANY_NODE
            and plan.revision > 0
            and ANY_NODE not in named
            and len(set(named)) == len(named),
            f"plan {plan.revision} of {plan.planner}",
        )
        lengths = (plan.half_width_m, plan.first_m, plan.last_m, plan.height_m)
        _refuse_unless(
            all(0 <= length <= FARTHEST_M for length in lengths)
            and plan.last_m - plan.first_m >= (0.0 if shape == _SPIRAL else _LEAST_M)
            and (shape == _LINES or (plan.first_m >= _LEAST_M and plan.half_width_m >= _LEAST_M))
            and 0.1 <= plan.speed_m_s <= _FASTEST_M_S,
            f"a formation of {lengths} m at {plan.speed_m_s} m/s",
        )
        return plan


class SearchStatus(NamedTuple):
    """FANET_STATUS: the position and the state of a UAV."""

    t_us: int
    position: Enu
    node: int
    revision: int
    charge: int
    """The percentage of the battery that may still be spent, above the way home and a reserve; 0:
    the UAV flies home."""

    def encode_frame(self, node: int) -> bytes:
        payload = STATUS.layout.pack(self.t_us, *self.position, *self[2:], VERSION)
        return encode_inner(STATUS, payload, node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_STATUS in a frame; raises MalformedFrameError."""
        return cls.checked(decode_first(STATUS, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        """The status of these fields; raises MalformedFrameError."""
        t_us, east, north, up, node, revision, charge, version = fields
        position = Enu(east, north, up)
        _refuse_unless(
            version == VERSION
            and 0 < node < ANY_NODE
            and t_us <= LATEST_US
            and charge <= 100
            and position.is_within(FARTHEST_M),
            f"status of {node}: {position}, {charge} %",
        )
        return cls(t_us, position, node, revision, charge)


class Bid(NamedTuple):
    """One entry of FANET_BIDS: `bidder` can be at `survivor` within `eta_ds` tenths of a second."""

    survivor: int
    bidder: int
    eta_ds: int
    serial: int
    age_s: int = 0
    """The time since the bidder last confirmed the bid."""


def encode_bids(bids: Sequence[Bid], *, node: int) -> bytes:
    """One FANET_BIDS message."""
    if len(bids) > MOST_BIDS:
        raise LocalProtocolError(f"{len(bids)} bids must be <= {MOST_BIDS} for one message")
    unused = (0,) * (MOST_BIDS - len(bids))
    columns = [[bid[axis] for bid in bids] for axis in range(5)]
    flat = [value for column in columns[:4] for value in (*column, *unused)]
    payload = BIDS.layout.pack(*flat, node, *columns[4], *unused, len(bids), VERSION)
    return encode_inner(BIDS, payload, node=node)


def checked_bids(fields: tuple[Any, ...]) -> "Bids":
    """The bids of the fields of one message; raises MalformedFrameError."""
    count, version = fields[-2:]
    _refuse_unless(version == VERSION and count <= MOST_BIDS, f"{count} bids")
    columns = [fields[at : at + count] for at in (0, 12, 24, 36, 49)]
    found = tuple(Bid(*row) for row in zip(*columns, strict=True))
    for bid in found:
        _refuse_unless(
            0 < bid.survivor <= MOST_SURVIVORS and 0 < bid.bidder < ANY_NODE, f"bid of {bid.bidder} for {bid.survivor}"
        )
    return Bids(found)


class Bids(NamedTuple):
    """The content of one FANET_BIDS message."""

    bids: tuple[Bid, ...]


class Standing(IntEnum):
    """The meaning of a FANET_FOUND for the place that it names."""

    ESTIMATED = 0
    CONFIRMED = 1
    REFUTED = 2
    """Confirmations at this place are taken back, because later receptions contradict them."""


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

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(FOUND, FOUND.layout.pack(*self, VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_FOUND in a frame; raises MalformedFrameError, also for an impossible covariance."""
        return cls.checked(decode_first(FOUND, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        """The estimate of these fields; raises MalformedFrameError."""
        *values, standing, version = fields
        _refuse_unless(version == VERSION and standing <= Standing.REFUTED, f"a find of standing {standing}")
        found = cls._make((*values, Standing(standing)))
        _refuse_unless(
            0 < found.survivor <= MOST_SURVIVORS and 0 < found.node < ANY_NODE and found.t_us <= LATEST_US,
            f"survivor {found.survivor} found by {found.node}",
        )
        east, north = found.east_variance_m2, found.north_variance_m2
        _refuse_unless(
            abs(found.east_m) <= FARTHEST_M
            and abs(found.north_m) <= FARTHEST_M
            and 0 <= east <= _MOST_VARIANCE_M2
            and 0 <= north <= _MOST_VARIANCE_M2
            and abs(found.covariance_m2) <= math.sqrt(east * north) * (1 + 1e-3) + 1e-3,
            f"an estimate with variances {east}, {north} and covariance {found.covariance_m2}",
        )
        return found


class Covered(NamedTuple):
    """FANET_COVERED: the cells of the area that have been searched, as far as its sender knows."""

    cells: int
    """Bit `COVERED_SIDE * row + column` is that of a cell, from the south-western corner of the area."""

    def encode_frame(self, node: int) -> bytes:
        cells = self.cells.to_bytes(_COVERED_BYTES, "little")
        return encode_inner(COVERED, COVERED.layout.pack(*cells, VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_COVERED in a frame; raises MalformedFrameError."""
        return cls.checked(decode_first(COVERED, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        """The cells of these fields; raises MalformedFrameError."""
        *cells, version = fields
        _refuse_unless(version == VERSION, f"covered cells of version {version}")
        return cls(int.from_bytes(cells, "little"))


Told = Survivor | Search | SearchStatus | Bids | Found | Covered
"""The messages that searching UAVs send each other."""
_CHECKED: Final[Mapping[int, Callable[[tuple[Any, ...]], Told]]] = {
    SURVIVOR.msgid: Survivor.checked,
    SEARCH.msgid: Search.checked,
    STATUS.msgid: SearchStatus.checked,
    BIDS.msgid: checked_bids,
    FOUND.msgid: Found.checked,
    COVERED.msgid: Covered.checked,
}


def told_in(packed: Packed) -> tuple[Told, ...]:
    """Every message of a search in a frame, in order; raises MalformedFrameError."""
    return tuple(_CHECKED[spec.msgid](fields) for spec, fields in fields_of_each(packed) if spec.msgid in _CHECKED)

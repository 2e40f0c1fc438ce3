"""The messages that searching UAVs, and a post on the ground, send each other, found in a frame.

`search_plan.py` has the plan and the states of UAVs, `survivors.py` who was heard and found; here are orders
(FANET_ORDER), when each UAV of the plan was last heard and who is lost (FANET_ROLL), and bids for survivors
(FANET_BIDS), which UAVs pass on in hellos.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple, Self

from fanet_mw.errors import LocalProtocolError
from fanet_mw.orders import Order, OrderKind, is_told, wrong
from fanet_mw.units import MS
from fanet_mw.wire.checks import refuse_unless, require_sender
from fanet_mw.wire.frame import (
    ANY_NODE,
    BIDS,
    FOUND,
    ORDER,
    ROLL,
    SEARCH,
    STATUS,
    SURVIVOR,
    VERSION,
    Packed,
    encode_inner,
    encode_truncated,
    fields_of_each,
)
from fanet_mw.wire.search_plan import MOST_PLACES, Search, SearchStatus
from fanet_mw.wire.survivors import MOST_SURVIVORS, Found, Survivor


class ToldOrder(NamedTuple):
    """One order, with its number."""

    t_us: int
    """The swarm time at which it was given."""
    post: int
    """The node that gave it."""
    serial: int
    """The number of the order; each of a post has a greater one."""
    order: Order

    def encode_frame(self, node: int) -> bytes:
        kind, of_node, *place = self.order
        return encode_inner(
            ORDER, ORDER.layout.pack(self.t_us, *place, self.serial, self.post, of_node, kind, VERSION), node=node
        )

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        t_us, east_m, north_m, radius_m, serial, post, node, kind, version = fields
        require_sender(version, post, t_us=t_us)
        refuse_unless(kind in OrderKind.__members__.values() and serial > 0, f"order {kind}, number {serial}")
        order = Order(OrderKind(kind), node, east_m, north_m, radius_m)
        refuse_unless(wrong(order, uavs=ANY_NODE - 1) is None and is_told(order), f"{order}")
        return cls(t_us, post, serial, order)


ROLL_NS: Final = 500 * MS
"""The unit in which instants are told, by swarm time; a whole one, so that nothing is lost from hop to hop."""
LONG_AGO: Final = 127
"""An entry that says no more than that a UAV was heard this many units ago or before that, or never."""
_LOST: Final = 0x80
"""The bit of an entry that says that the UAV is lost: those who heard it have not for some time."""


class Roll(NamedTuple):
    """FANET_ROLL: the UAVs of a plan, as they were last heard."""

    at: int
    """The instant of the sender, in units of `ROLL_NS`."""
    planner: int
    revision: int
    """With `planner` the plan whose places are told."""
    ages: tuple[int, ...]
    """How long before `at` the UAV of each place was last heard, in units of `ROLL_NS`, at most `LONG_AGO`."""
    lost: frozenset[int]
    """The places whose UAVs are lost."""

    def encode_frame(self, node: int) -> bytes:
        if len(self.ages) > MOST_PLACES:
            raise LocalProtocolError(f"a roll of {len(self.ages)} places must have <= {MOST_PLACES}")
        entries = [min(age, LONG_AGO) | (_LOST if place in self.lost else 0) for place, age in enumerate(self.ages)]
        unused = (0,) * (MOST_PLACES - len(entries))
        packed = ROLL.layout.pack(self.at, self.planner, self.revision, VERSION, *entries, *unused)
        return encode_truncated(ROLL, packed, node=node)

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        at, planner, revision, version, *entries = fields
        refuse_unless(version == VERSION and 0 < planner < ANY_NODE and revision > 0, f"roll of {planner}, {revision}")
        lost = frozenset(place for place, entry in enumerate(entries) if entry & _LOST)
        return cls(at, planner, revision, tuple(entry & ~_LOST for entry in entries), lost)


MOST_BIDS: Final = 12
WITHDRAWN: Final = 0xFFFF
"""The time of arrival that marks a withdrawn bid."""


class Bid(NamedTuple):
    """One entry of FANET_BIDS: `bidder` can be at `survivor` within `eta_ds` tenths of a second."""

    survivor: int
    bidder: int
    eta_ds: int
    serial: int
    age_s: int = 0
    """The time since the bidder last confirmed the bid."""


def encode_bids(bids: Sequence[Bid], *, node: int) -> bytes:
    if len(bids) > MOST_BIDS:
        raise LocalProtocolError(f"{len(bids)} bids must be <= {MOST_BIDS} for one message")
    unused = (0,) * (MOST_BIDS - len(bids))
    columns = [[bid[axis] for bid in bids] for axis in range(5)]
    flat = [value for column in columns[:4] for value in (*column, *unused)]
    payload = BIDS.layout.pack(*flat, node, *columns[4], *unused, len(bids), VERSION)
    return encode_inner(BIDS, payload, node=node)


def checked_bids(fields: tuple[Any, ...]) -> "Bids":
    count, version = fields[-2:]
    refuse_unless(version == VERSION and count <= MOST_BIDS, f"{count} bids")
    columns = [fields[at : at + count] for at in (0, 12, 24, 36, 49)]
    found = tuple(Bid(*row) for row in zip(*columns, strict=True))
    for bid in found:
        refuse_unless(
            0 < bid.survivor <= MOST_SURVIVORS and 0 < bid.bidder < ANY_NODE, f"bid of {bid.bidder} for {bid.survivor}"
        )
    return Bids(found)


class Bids(NamedTuple):
    """The content of one FANET_BIDS message."""

    bids: tuple[Bid, ...]


Told = Survivor | Search | SearchStatus | Bids | Found | Roll | ToldOrder
"""The messages that searching UAVs, and a post on the ground, send each other."""
_CHECKED: Final[Mapping[int, Callable[[tuple[Any, ...]], Told]]] = {
    SURVIVOR.msgid: Survivor.checked,
    SEARCH.msgid: Search.checked,
    STATUS.msgid: SearchStatus.checked,
    BIDS.msgid: checked_bids,
    FOUND.msgid: Found.checked,
    ROLL.msgid: Roll.checked,
    ORDER.msgid: ToldOrder.checked,
}


def told_in(packed: Packed) -> tuple[Told, ...]:
    """Every message of a search in a frame, in order; raises MalformedFrameError."""
    return tuple(_CHECKED[spec.msgid](fields) for spec, fields in fields_of_each(packed) if spec.msgid in _CHECKED)

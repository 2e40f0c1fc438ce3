"""FANET_BIDS: the bids of UAVs for survivors, as UAVs pass them on in hellos."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.wire.checks import refuse_unless
from fanet_mw.wire.frame import ANY_NODE, BIDS, VERSION, encode_inner
from fanet_mw.wire.survivors import MOST_SURVIVORS

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

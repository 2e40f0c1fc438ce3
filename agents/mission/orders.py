"""The orders of the post on the ground at one UAV: which are known, which are in force, and whom they are told on.

learned     from a flood or a neighbor's hello, each once, by its number
for it      of recalls, errands and releases for this UAV that with the greatest number holds, in whatever order
            they arrive; the end of the search is for good
told on     in hellos for a while
"""

from typing import Final

from fanet_mw.orders import Order, OrderKind
from fanet_mw.serial_number import newer
from fanet_mw.trace import Ordered
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_messages import ToldOrder

_TOLD_NS: Final = 12 * S
"""How long hellos tell an order on."""
_TOLD: Final = 2
_MOST_KNOWN: Final = 1000
"""The greatest number of orders that are remembered, so that forged ones take no more memory."""
_SERIAL_BITS: Final = 16


class KnownOrders:
    """The orders that one UAV has learned."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._learned_ns: dict[ToldOrder, int] = {}
        self._latest: ToldOrder | None = None
        """Of the orders that change what this UAV does, that with the greatest number."""

    def learn(self, told: ToldOrder, now_ns: int) -> bool:
        """Take in an order; returns True if it is new."""
        if told in self._learned_ns or len(self._learned_ns) >= _MOST_KNOWN:
            return False
        self._learned_ns[told] = now_ns
        order, latest = told.order, self._latest
        ends = order.kind is OrderKind.END  # for good, whatever was learned of later orders before
        overruled = latest is not None and (
            latest.order.kind is OrderKind.END or not (ends or newer(told.serial, latest.serial, bits=_SERIAL_BITS))
        )
        if order.kind is not OrderKind.NO_FLY and order.node in (0, self._node) and not overruled:
            self._latest = told
        return True

    def is_to_obey(self, told: ToldOrder) -> bool:
        return told is self._latest or told.order.kind is OrderKind.NO_FLY

    @property
    def errand(self) -> Order | None:
        """The order to stay over a place, or to search around it, that this UAV carries out; None without one."""
        order = None if self._latest is None else self._latest.order
        return order if order is not None and order.kind in (OrderKind.STAY, OrderKind.SEARCH) else None

    def hello_frames(self, now_ns: int) -> bytes:
        """The inner frames with the latest orders for the next hello."""
        fresh = [told for told, since_ns in self._learned_ns.items() if now_ns - since_ns < _TOLD_NS]
        return b"".join(told.encode_frame(self._node) for told in fresh[-_TOLD:])


def record_of(told: ToldOrder, node: int, now_ns: int) -> Ordered:
    """The trace record of a node that learns of an order, or gives it."""
    kind, other, east_m, north_m, radius_m = told.order
    return Ordered(
        now_ns, node, told.serial, OrderKind(kind).name.lower(), other, round(east_m, 2), round(north_m, 2),
        round(radius_m, 2),
    )  # fmt: skip

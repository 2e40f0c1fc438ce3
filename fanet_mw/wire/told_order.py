"""FANET_ORDER: an order of the post on the ground."""

from typing import Any, NamedTuple, Self

from fanet_mw.orders import Order, OrderKind, is_told, wrong
from fanet_mw.wire.checks import refuse_unless, require_sender
from fanet_mw.wire.frame import ANY_NODE, ORDER, VERSION, Packed, decode_first, encode_inner


class ToldOrder(NamedTuple):
    """One order, with its number."""

    t_us: int
    """The swarm time at which it was given."""
    post: int
    """The node that gave it."""
    serial: int
    """The number of the order; each of a post has the next one."""
    order: Order

    def encode_frame(self, node: int) -> bytes:
        kind, of_node, *place = self.order
        return encode_inner(
            ORDER, ORDER.layout.pack(self.t_us, *place, self.serial, self.post, of_node, kind, VERSION), node=node
        )

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_ORDER in a frame; raises MalformedFrameError."""
        return cls.checked(decode_first(ORDER, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        t_us, east_m, north_m, radius_m, serial, post, node, kind, version = fields
        require_sender(version, post, t_us=t_us)
        refuse_unless(kind in OrderKind.__members__.values() and serial > 0, f"order {kind}, number {serial}")
        order = Order(OrderKind(kind), node, east_m, north_m, radius_m)
        refuse_unless(wrong(order, uavs=ANY_NODE - 1) is None and is_told(order), f"{order}")
        return cls(t_us, post, serial, order)
